//! One HTML page about a run: pictures, tables, and the events as a cloud to turn, with histograms of single pixels.
//!
//! The page is one file. It loads nothing, so it can be sent by mail and opened without a network. A content security
//! policy names its only script by hash. All texts are escaped. Events are thinned evenly until the page has less than 5
//! MB. `html` makes a page with events, `still` one without them and without a script.
//!
//! ## Example
//!
//! ```rust
//! use dtof_draw::picture::{Map, heat_map};
//! use dtof_run::report::{Figure, Section, still};
//!
//! let svg = heat_map(&Map {
//!     title: "Two pixels see a wall",
//!     unit: "m",
//!     axis_names: ["column", "row"],
//!     missing: "event",
//!     columns: 2,
//!     rows: 1,
//!     values: &[Some(3.0), Some(3.01)],
//! })?;
//! let figures = [Figure { svg: &svg, caption: "Range of the last event" }];
//! let rows = [("events".to_owned(), "48".to_owned())];
//! let sections = [Section { heading: "Run", rows: &rows }];
//! let page = still("Wall", "Simulated, 2,000 laser cycles", &sections, &[], &figures);
//! assert!(page.contains("<h1>Wall</h1>") && page.contains("<td>48</td>"));
//! assert!(!page.contains("<script"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! ## What it does not know
//!
//! - It runs nothing and knows no scene. The caller has the events, the figures and the rows.
//! - It writes no file. A page is a `String`.
//! - It knows no comparison and no calibration; both make their pages with it.
//! - A figure is placed in the page as it is: it must come from a source you trust.

/// A JavaScript module of this folder. Paths of modules begin at `host`.
macro_rules! module {
    ($path:literal) => {
        (concat!("run/src/report/", $path), include_str!($path))
    };
}

mod bundle;
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
    /// An SVG document from a trusted source: it is placed in the page as it is.
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

/// A table of several columns: a name and a value for each of them.
#[derive(Clone, Copy, Debug)]
pub struct Table<'a> {
    /// The heading of the table.
    pub heading: &'a str,
    /// The headings of the columns of values.
    pub head: &'a [String],
    /// The name and the values of each row.
    pub rows: &'a [(String, Vec<String>)],
    /// The text below it.
    pub note: &'a str,
}

/// The mark near the start of every page.
pub const MARK: &str = "<meta name=\"generator\" content=\"dtof\">";

const OWN_STYLE: &str = include_str!("report/report.css");

/// The size limit of a page in bytes. Larger ones are slow to open and to send.
const MAX_PAGE: usize = 5_000_000;
/// The most bytes of a page for all but events and figures.
const MAX_OTHER: usize = 200_000;
/// Up to so many pixels are shown as plots, not as maps.
pub const FEW: usize = 16;

/// A page with `title`, the paragraph `lead`, an interactive cloud of events, `figures` and `sections`.
/// Events and histograms are thinned until the page has less than 5 MB.
///
/// The page loads nothing. Its content security policy names its only script by hash. All texts are
/// escaped. Figures are placed as they are, and must not define identifiers.
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
    let interactive = events.html(MAX_PAGE.saturating_sub(MAX_OTHER + taken));
    page(
        title,
        lead,
        (&script, &interactive),
        (sections, &[]),
        figures,
    )
}

/// The same page without events, and so without a script.
#[must_use]
pub fn still(
    title: &str,
    lead: &str,
    sections: &[Section],
    tables: &[Table],
    figures: &[Figure],
) -> String {
    page(title, lead, ("", ""), (sections, tables), figures)
}

/// `script` is the policy of the script, `interactive` the elements that it fills.
fn page(
    title: &str,
    lead: &str,
    (script, interactive): (&str, &str),
    (sections, tables): (&[Section], &[Table]),
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
    for table in tables {
        let (heading, note) = (text(table.heading), text(table.note));
        let head = table
            .head
            .iter()
            .map(|name| format!("<th scope=\"col\">{}</th>", text(name)));
        page += &format!(
            "<section class=\"wide\">\n<h2>{heading}</h2>\n<div><table>\n\
             <thead><tr><td></td>{}</tr></thead>\n<tbody>\n",
            head.collect::<String>()
        );
        for (name, values) in table.rows {
            let values = values
                .iter()
                .map(|value| format!("<td>{}</td>", text(value)));
            let (name, values) = (text(name), values.collect::<String>());
            page += &format!("<tr><th scope=\"row\">{name}</th>{values}</tr>\n");
        }
        page += &format!("</tbody>\n</table></div>\n<p class=\"hint\">{note}</p>\n</section>\n");
    }
    page + "</div>\n</main>\n</body>\n</html>\n"
}

fn text(text: &str) -> String {
    escape(&one_line(text))
}

/// The `<svg>` element of a document, without the XML declaration.
fn element(svg: &str) -> &str {
    svg.find("<svg").map_or("", |start| svg[start..].trim_end())
}

/// `word` with a capital letter, for the start of a sentence.
#[must_use]
pub fn capitalised(word: &str) -> String {
    let mut letters = word.chars();
    let first = letters.next().map(|first| first.to_ascii_uppercase());
    first.into_iter().chain(letters).collect()
}
