//! The report on a run: one HTML page with everything in it.

#[cfg(test)]
mod tests;

use crate::picture::{escape, one_line};

/// A picture of the report.
#[derive(Clone, Copy, Debug)]
pub struct Figure<'a> {
    /// An SVG document. It is placed in the page as it is, so it has to come
    /// from a trusted source.
    pub svg: &'a str,
    /// What can be seen.
    pub caption: &'a str,
}

/// A table of names and values, such as settings or totals.
#[derive(Clone, Copy, Debug)]
pub struct Section<'a> {
    /// What the table is about.
    pub heading: &'a str,
    /// Names and values.
    pub rows: &'a [(String, String)],
}

/// Colours follow the reader's scheme, the columns the width of the window.
const STYLE: &str = "\
:root{color-scheme:light dark;\
--page:#f6f8fa;--card:#fff;--ink:#1f2328;--soft:#59636e;--line:#d1d9e0}
@media (prefers-color-scheme:dark){:root{\
--page:#010409;--card:#0d1117;--ink:#e6edf3;--soft:#9198a1;--line:#30363d}}
*{box-sizing:border-box}
body{margin:0;background:var(--page);color:var(--ink);\
font:1rem/1.5 system-ui,sans-serif;-webkit-text-size-adjust:100%}
main{max-width:84rem;margin:0 auto;padding:clamp(1rem,4vw,3rem)}
h1{font-size:clamp(1.5rem,4vw,2.1rem);line-height:1.2;margin:0 0 .5rem}
h1,h2,p,figcaption,th,td{overflow-wrap:anywhere}
h2{font-size:1.1rem;line-height:1.3;margin:0;padding:1rem 1rem .5rem}
header p{max-width:44rem;margin:0;color:var(--soft)}
.cards{columns:2 30rem;column-gap:1.25rem;margin-top:1.75rem}
figure,section{margin:0 0 1.25rem;overflow:hidden;break-inside:avoid;background:var(--card);\
border:1px solid var(--line);border-radius:.6rem}
svg{display:block;margin:0 auto;max-width:100%;height:auto}
figcaption{padding:.7rem 1rem .8rem;border-top:1px solid var(--line);color:var(--soft)}
table{width:100%;border-collapse:collapse}
th,td{padding:.4rem 1rem;border-top:1px solid var(--line);text-align:left;vertical-align:top}
th{width:42%;font-weight:400;color:var(--soft)}
td{font-variant-numeric:tabular-nums}
@media (max-width:34rem){main{padding:1rem .6rem}figure,section{margin-bottom:.9rem}}
";

/// A page with `title` and the paragraph `lead`, then all `figures`, then all
/// `sections`.
///
/// The page is whole: it loads nothing and runs no script. All texts are
/// escaped. Figures are taken as they are, and define no identifiers.
#[must_use]
pub fn html(title: &str, lead: &str, sections: &[Section], figures: &[Figure]) -> String {
    let title = text(title);
    let lead = text(lead);
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <meta http-equiv=\"Content-Security-Policy\" \
         content=\"default-src 'none'; style-src 'unsafe-inline'; img-src data:\">\n\
         <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n\
         <body>\n<main>\n<header>\n<h1>{title}</h1>\n<p>{lead}</p>\n</header>\n\
         <div class=\"cards\">\n"
    );
    for figure in figures {
        let svg = element(figure.svg);
        let caption = text(figure.caption);
        page += &format!("<figure>\n{svg}\n<figcaption>{caption}</figcaption>\n</figure>\n");
    }
    for (index, section) in sections.iter().enumerate() {
        let id = format!("section-{}", index + 1);
        let heading = text(section.heading);
        page += &format!(
            "<section aria-labelledby=\"{id}\">\n<h2 id=\"{id}\">{heading}</h2>\n\
             <table aria-labelledby=\"{id}\">\n<tbody>\n"
        );
        for (name, value) in section.rows {
            let (name, value) = (text(name), text(value));
            page += &format!("<tr><th scope=\"row\">{name}</th><td>{value}</td></tr>\n");
        }
        page += "</tbody>\n</table>\n</section>\n";
    }
    page + "</div>\n</main>\n</body>\n</html>\n"
}

fn text(text: &str) -> String {
    escape(&one_line(text))
}

/// The `<svg>` element of a document: a page has no room for its declaration.
fn element(svg: &str) -> &str {
    svg.find("<svg").map_or("", |start| svg[start..].trim_end())
}
