//! The files and names in `docs/paper.md` exist, and its verdicts match the studies.

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The cells of each row: in the paper, here, test, claim, verdict, criterion.
fn rows(page: &str) -> Vec<[&str; 6]> {
    let rows = page.lines().filter(|line| line.starts_with('|'));
    let rows = rows.map(|line| line.trim_matches('|').split('|').map(str::trim).collect());
    let rows: Vec<Vec<&str>> = rows.collect();
    // Rows of the other tables have two or three cells.
    assert!(
        rows.iter().all(|row| matches!(row.len(), 2 | 3 | 6)),
        "a | in a cell"
    );
    let rows = rows
        .iter()
        .filter_map(|row| <[&str; 6]>::try_from(row.as_slice()).ok());
    rows.filter(|row| row[0] != "in the paper" && !row[0].starts_with("---"))
        .collect()
}

/// A cell `file` or `file: name`. The name must be defined there.
fn is_there(cell: &str) -> bool {
    let cell = cell.trim_matches('`');
    let (path, name) = cell.split_once(": ").unwrap_or((cell, ""));
    let Ok(text) = fs::read_to_string(root().join(path)) else {
        return false;
    };
    let kinds = ["fn", "struct", "enum", "trait", "type", "const", "mod"];
    let defined = |kind: &&str| {
        let start = format!("{kind} {name}");
        text.match_indices(&start).any(|(at, _)| {
            let next = text[at + start.len()..].chars().next();
            !next.is_some_and(|next| next.is_alphanumeric() || next == '_')
        })
    };
    name.is_empty() || kinds.iter().any(defined)
}

#[test]
fn names_of_the_page_are_there() {
    let page = read("docs/paper.md");
    let rows = rows(&page);
    let cells = rows
        .iter()
        .flat_map(|row| [row[1], row[2]])
        .filter(|cell| !cell.is_empty());
    let gone: Vec<&str> = cells.filter(|cell| !is_there(cell)).collect();
    assert_eq!(gone, [""; 0]);
    assert!(rows.len() >= 70, "{} rows", rows.len());
    assert!(!is_there("`core/src/pixel/mod.rs: Pixel`") && !is_there("`core/src/nothing.rs`"));
}

/// The verdict of a claim, by its name in the template: the row in the results begins with the same
/// words.
fn verdict_of(claim: &str, template: &str, results: &str) -> Option<String> {
    let place = format!("**{{{claim}}}**");
    let row = template.lines().find(|line| line.contains(&place))?;
    let (words, _) = row.trim_start_matches("| ").split_once(" | ")?;
    let start = format!("| {words} | ");
    let row = results.lines().find(|line| line.starts_with(&start))?;
    let (_, verdict) = row.split_once("| **")?;
    Some(verdict.split_once("** |")?.0.to_owned())
}

#[test]
fn verdicts_of_the_page_are_those_of_the_studies() {
    let page = read("docs/paper.md");
    let results = read("docs/results/paper-claims.md");
    let template = read("lab/src/pages/paper-claims.md");
    let mut judged = 0;
    for [paper, _, test, claim, verdict, _] in rows(&page) {
        let claim = claim.trim_matches('`');
        // A reason may follow.
        let (word, _) = verdict.split_once(": ").unwrap_or((verdict, ""));
        assert!(
            verdict != "not here" && (verdict != "built" || !test.is_empty()),
            "{paper}: {verdict}"
        );
        if claim.is_empty() {
            let has_reason = verdict.contains(": ") || verdict == "built";
            assert!(has_reason, "{paper}: a verdict without a claim");
            continue;
        }
        let given = verdict_of(claim, &template, &results);
        assert!(given.is_some(), "{paper}: no claim {claim}");
        if word != "not here" {
            assert_eq!(given.as_deref(), Some(word), "{paper}: {claim}");
            judged += 1;
        }
    }
    assert!(judged >= 40, "{judged}");
    assert_eq!(verdict_of("hit-rate.nothing", &template, &results), None);
}
