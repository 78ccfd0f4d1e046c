//! Every link on a page leads to an existing file and heading, and every promise names tests that exist.

use std::fs;
use std::path::{Path, PathBuf};

/// The pages in `folder`, and in `docs` and `.github` below it.
fn pages(folder: &Path, pages: &mut Vec<PathBuf>) {
    let entries = fs::read_dir(folder).unwrap();
    for path in entries.map(|entry| entry.unwrap().path()) {
        if path.is_dir() {
            if path.ends_with("docs")
                || path.ends_with(".github")
                || folder.ends_with("docs")
                || folder.ends_with("results")
            {
                self::pages(&path, pages);
            }
        } else if path.extension().is_some_and(|extension| extension == "md") {
            pages.push(path);
        }
    }
}

/// The anchor of a heading.
fn anchor(heading: &str) -> String {
    let heading = heading.trim_start_matches('#').trim().to_lowercase();
    let kept = heading
        .chars()
        .filter(|c| c.is_alphanumeric() || "-_ ".contains(*c));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// Whether the `target` of a link on `page` exists.
fn leads_somewhere(page: &Path, target: &str) -> bool {
    let (file, heading) = target.split_once('#').unwrap_or((target, ""));
    let path = if file.is_empty() {
        page.to_owned()
    } else {
        page.parent().unwrap().join(file)
    };
    if heading.is_empty() {
        return path.exists();
    }
    let Ok(text) = fs::read_to_string(path) else {
        return false;
    };
    let mut headings = text.lines().filter(|line| line.starts_with('#'));
    headings.any(|line| anchor(line) == heading)
}

#[test]
fn every_link_of_a_page_leads_somewhere() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let root = root.canonicalize().unwrap();
    let mut found = Vec::new();
    pages(&root, &mut found);
    let (mut links, mut broken) = (0, Vec::new());
    for page in &found {
        let text = fs::read_to_string(page).unwrap();
        let targets = text.split("](").skip(1);
        let targets = targets.filter_map(|rest| Some(rest.split_once(')')?.0));
        for target in targets.filter(|target| !target.contains("://") && !target.contains(' ')) {
            links += 1;
            if !leads_somewhere(page, target) {
                let page = page.strip_prefix(&root).unwrap().display();
                broken.push(format!("{page}: {target}"));
            }
        }
    }
    assert!(links > 80, "{links} links in {} pages", found.len());
    assert_eq!(broken, [""; 0]);
}

#[test]
fn every_promise_is_filled_in_and_its_tests_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let text = fs::read_to_string(root.join("docs/reliability.md")).unwrap();
    let promises = text.split("## Promises").nth(1).unwrap();
    let promises = promises.split("## ").next().unwrap();
    let rows = promises
        .lines()
        .filter(|line| line.starts_with("| "))
        .skip(1);
    let (mut count, mut tests, mut missing) = (0, 0, Vec::new());
    for row in rows {
        let cells: Vec<&str> = row.trim_matches('|').split(" | ").map(str::trim).collect();
        let full = cells.len() == 3 && cells.iter().all(|cell| !cell.is_empty());
        assert!(full, "{row}");
        count += 1;
        let paths = cells[1].split('`').skip(1).step_by(2);
        // Others are commands and packages.
        for path in paths.filter(|span| span.contains('/') && !span.contains(' ')) {
            tests += 1;
            if !root.join(path).exists() {
                missing.push(path.to_owned());
            }
        }
    }
    assert!(count > 20 && tests > 20, "{count} promises, {tests} tests");
    assert_eq!(missing, [""; 0]);
}
