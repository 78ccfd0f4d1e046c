#![doc = include_str!("../README.md")]
#![deny(clippy::print_stderr, clippy::print_stdout)]

mod cloud;
mod events;
mod histograms;
mod packed;
pub mod shared;
#[cfg(test)]
mod tests;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use sha2::{Digest, Sha256};

pub use cloud::Cloud;
pub use histograms::Decisions;

use dtof_draw::svg::{escape, one_line};

use self::shared::STYLE;

/// A picture of the report.
#[derive(Clone, Copy, Debug)]
pub struct Figure<'a> {
    /// An SVG document. It is placed in the page as it is, so it has to come
    /// from a trusted source.
    pub svg: &'a str,
    /// The text below it.
    pub caption: &'a str,
}

/// A table of names and values, such as settings or totals.
#[derive(Clone, Copy, Debug)]
pub struct Section<'a> {
    /// The heading of the table.
    pub heading: &'a str,
    /// Names and values.
    pub rows: &'a [(String, String)],
}

/// Every page has it near its start.
pub const MARK: &str = "<meta name=\"generator\" content=\"dtof\">";

const OWN_STYLE: &str = include_str!("report.css");

/// Bytes of a page. Larger ones are slow to open, and to send.
const PAGE: usize = 5_000_000;
/// Bytes of a page for all but events and figures, at most.
const ALL_ELSE: usize = 200_000;
/// So many pixels, at most, are shown as plots, not as maps.
pub const FEW: usize = 16;

/// A page with `title` and the paragraph `lead`, the events to turn and look at, then
/// all `figures`, then all `sections`. Events and histograms are thinned until the page has
/// less than 5 MB.
///
/// The page is whole: it loads nothing, and runs no script but its own, which the
/// policy at its head names by its hash. All texts are escaped. Figures are taken as
/// they are, and define no identifiers.
#[must_use]
pub fn html(
    title: &str,
    lead: &str,
    sections: &[Section],
    figures: &[Figure],
    events: Cloud,
) -> String {
    let hash = BASE64.encode(Sha256::digest(&*cloud::SCRIPT));
    let script = format!("script-src 'sha256-{hash}'; ");
    let taken: usize = figures.iter().map(|figure| figure.svg.len()).sum();
    let interactive = events.html(PAGE.saturating_sub(ALL_ELSE + taken));
    page(title, lead, (&script, &interactive), sections, figures)
}

/// The same page without events, and so without a script.
#[must_use]
pub fn still(title: &str, lead: &str, sections: &[Section], figures: &[Figure]) -> String {
    page(title, lead, ("", ""), sections, figures)
}

/// `interactive` is the policy of its script, and what the script fills.
fn page(
    title: &str,
    lead: &str,
    (script, interactive): (&str, &str),
    sections: &[Section],
    figures: &[Figure],
) -> String {
    let title = text(title);
    let lead = text(lead);
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n{MARK}\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <meta http-equiv=\"Content-Security-Policy\" \
         content=\"default-src 'none'; {script}\
         style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'\">\n\
         <title>{title}</title>\n<style>\n{STYLE}{OWN_STYLE}</style>\n</head>\n\
         <body>\n<main>\n<header>\n<h1>{title}</h1>\n<p>{lead}</p>\n</header>\n"
    );
    page += interactive;
    page += "<div class=\"cards\">\n";
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
