//! Lines of code of each package against the table in `ARCHITECTURE.md`, so that growth is seen.

use std::collections::BTreeMap;
use std::path::Path;
use std::{env, fs};

use crate::doors::{files, root};

/// What is code, by the ending of a file.
const ENDS: [&str; 9] = ["rs", "py", "js", "v", "sv", "c", "h", "cpp", "sh"];
/// How many percent of its row a package may grow or shrink, and at least so many lines.
const MOST_GROWTH: usize = 3;
const LEAST_GROWTH: usize = 20;

fn is_test(path: &str) -> bool {
    let is_folder =
        |part: &str| matches!(part, "tests" | "test" | "benches" | "host-tests" | "fuzz");
    let is_file = ["tests.rs", ".test.js", "testbench.rs"]
        .iter()
        .any(|end| path.ends_with(end));
    is_file || path.split('/').any(is_folder)
}

/// Lines that are no comment and not blank, up to the tests of the file.
fn code(path: &str, text: &str) -> usize {
    let marks: &[&str] = match path.rsplit_once('.') {
        Some((_, "py" | "sh")) => &["#"],
        _ if path.starts_with(".ci/") => &["#"],
        _ => &["//", "/*", "*", "#!"],
    };
    let lines = text.lines().map(str::trim);
    let lines = lines.take_while(|line| *line != "#[cfg(test)]");
    let is_code =
        |line: &&str| !line.is_empty() && !marks.iter().any(|mark| line.starts_with(mark));
    lines.filter(is_code).count()
}

/// The code lines of each folder with a manifest, and of the others.
fn counted() -> BTreeMap<String, usize> {
    let mut found = Vec::new();
    files(&root(), &ENDS, &mut found);
    let mut counted = BTreeMap::new();
    for (path, text) in &found {
        let has_manifest = |folder: &&Path| {
            let is_there = |name| root().join(folder).join(name).exists();
            is_there("Cargo.toml") || is_there("package.json")
        };
        let mut above = Path::new(path)
            .ancestors()
            .skip(1)
            .filter(|folder| *folder != Path::new(""));
        let package = above.find(has_manifest);
        let folder = package.unwrap_or_else(|| Path::new(path).parent().unwrap());
        if !is_test(path) {
            *counted.entry(format!("{}/", folder.display())).or_default() += code(path, text);
        }
    }
    counted
}

/// Made with `DTOF_BLESS=1 cargo test -p dtof-host-tests --test project lines`.
#[test]
fn no_package_has_grown_unseen() {
    let counted = counted();
    assert!(counted.len() > 20 && counted["core/"] > 5000, "{counted:?}");
    let path = root().join("ARCHITECTURE.md");
    let page = fs::read_to_string(&path).unwrap();
    let head = "| package | code lines |\n|---|---:|\n";
    let (before, table) = page.split_once(head).expect("a table of code lines");
    let (table, after) = table.split_once("\n\n").unwrap();
    let mut rows = BTreeMap::new();
    for row in table.lines() {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let lines: usize = cells[2].replace(',', "").parse().unwrap();
        rows.insert(cells[1].replace('`', ""), lines);
    }
    if env::var_os("DTOF_BLESS").is_some() {
        let row = |(folder, lines): (&String, &usize)| format!("| `{folder}` | {lines} |");
        let all: usize = counted.values().sum();
        let mut made: Vec<String> = counted.iter().map(row).collect();
        made.push(format!("| all | {all} |"));
        let made = made.join("\n");
        fs::write(path, format!("{before}{head}{made}\n\n{after}")).unwrap();
        return;
    }
    let mut all = 0;
    for (folder, lines) in &counted {
        let row = *rows
            .get(folder)
            .unwrap_or_else(|| panic!("{folder} has no row"));
        all += row;
        let growth = (row * MOST_GROWTH / 100).max(LEAST_GROWTH);
        let most = row + growth;
        assert!(
            *lines <= most,
            "{folder} has {lines} lines, {most} at most: raise its row in ARCHITECTURE.md, and say in the commit what it bought"
        );
        assert!(
            lines + growth >= row,
            "{folder} has {lines} lines: lower its row of {row}"
        );
    }
    assert_eq!(rows["all"], all);
    assert_eq!(rows.len(), counted.len() + 1, "a row of no package");
}
