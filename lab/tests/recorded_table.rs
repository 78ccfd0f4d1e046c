//! The table of recorded photons in the README is that of the results file.

use std::fs;
use std::path::Path;

/// A file of the repository.
fn read(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path);
    fs::read_to_string(path).unwrap()
}

#[test]
fn the_readmes_rows_are_those_of_the_results() {
    let csv = read("docs/results/data/recorded_rules.csv");
    let results: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    let readme = read("README.md");
    let (_, table) = readme.split_once("| minimum | photons an event |").unwrap();
    let (table, _) = table.split_once("\n\n").unwrap();
    let mut rows = 0;
    for row in table.lines().skip(2) {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        let [method, minimum, photons, median, within, beyond, as_good] = cells[..] else {
            panic!("{row}");
        };
        let (far, events) = beyond.split_once(" of ").unwrap();
        let events = events.replace(',', "");
        let (median, within) = (median.replace(" mm", ""), within.replace(" mm", ""));
        let is_this = |result: &&Vec<&str>| {
            let numbers = [
                result[3], result[6], result[7], result[8], result[9], result[10],
            ];
            numbers == [minimum, &events, photons, &median, &within, far]
        };
        let found = results.iter().find(is_this);
        let found = found.unwrap_or_else(|| panic!("not in the results: {row}"));
        let is_centred = method.contains("centred") || method == "the same";
        assert_eq!(is_centred, found[5] == "centred window", "{row}");
        if let Some((_, threshold)) = method.split_once("= ") {
            let threshold = threshold.split(',').next().unwrap();
            assert!(found[2] == threshold || method.contains("σ = 1"), "{row}");
        }
        let expected = if found[11] == "true" { "yes" } else { "no" };
        assert!(as_good.is_empty() || as_good == expected, "{row}");
        rows += 1;
    }
    assert!(rows >= 12, "{rows}");
}
