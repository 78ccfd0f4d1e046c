//! The table of recorded photons in the README agrees with the results file.

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
    let (_, table) = readme.split_once("| method | fewest photons").unwrap();
    let (table, _) = table.split_once("\n\n").unwrap();
    let mut rows = 0;
    for row in table.lines().skip(2) {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        let [method, minimum, photons, median, within, beyond] = cells[..] else {
            panic!("{row}");
        };
        let (far, events) = beyond.split_once(" of ").unwrap();
        let events = events.replace(',', "");
        let (median, within) = (median.replace(" mm", ""), within.replace(" mm", ""));
        let (rule, estimator) = method.split_once(", ").unwrap();
        let estimator = estimator.replace("centroid", "centre of mass");
        let is_this = |result: &&Vec<&str>| {
            let numbers = [
                result[3], result[6], result[7], result[8], result[9], result[10],
            ];
            numbers == [minimum, &events, photons, &median, &within, far]
                && result[0] == "0"
                && result[1].contains(rule)
                && result[5] == estimator
        };
        let found = results.iter().find(is_this);
        assert!(found.is_some(), "not in the results: {row}");
        rows += 1;
    }
    assert_eq!(rows, 3);
}
