//! What `docs/paper.md` names is there, and its verdicts are those of the studies.

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The cells of each row: in the paper, here, test, study, verdict, criterion.
fn rows(page: &str) -> Vec<[&str; 6]> {
    let rows = page.lines().filter(|line| line.starts_with('|'));
    let rows = rows.map(|line| line.trim_matches('|').split('|').map(str::trim).collect());
    let rows: Vec<Vec<&str>> = rows.collect();
    // Those of the verdicts, backgrounds and choices have two or three.
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
    assert!(!is_there("`core/src/pixel.rs: Pixel`") && !is_there("`core/src/nothing.rs`"));
}

#[test]
fn verdicts_of_the_page_are_those_of_the_studies() {
    let page = read("docs/paper.md");
    let claims = read("docs/results/paper-claims.md");
    let studies = read("docs/results/figures.md");
    for [paper, _, test, study, verdict, _] in rows(&page) {
        let judged = ["agrees", "differs", "refuted"].contains(&verdict);
        let built = verdict == "built";
        assert!(
            judged || built || verdict.contains(": "),
            "{paper}: {verdict}"
        );
        assert!(!built || !test.is_empty(), "{paper}: built, but no test");
        let study = study.trim_matches('`');
        let named = !study.is_empty();
        assert!(!judged || named, "{paper}: a verdict without a study");
        let is_study = studies.contains(&format!("\n## {study}\n"));
        assert!(!named || is_study, "{paper}: no study {study}");
        let parts = [format!("`{study}`"), format!("**{verdict}**")];
        let mut claims = claims.lines();
        let given = claims.any(|line| parts.iter().all(|part| line.contains(part)));
        assert!(
            !judged || given,
            "{paper}: no claim of {study} that {verdict}"
        );
    }
}
