//! Every link on a page leads to an existing file and heading.

use std::fs;
use std::path::{Path, PathBuf};

/// The pages in `folder`, and in `docs` below it.
fn pages(folder: &Path, pages: &mut Vec<PathBuf>) {
    let entries = fs::read_dir(folder).unwrap();
    for path in entries.map(|entry| entry.unwrap().path()) {
        if path.is_dir() {
            if path.ends_with("docs") || folder.ends_with("docs") || folder.ends_with("results") {
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
