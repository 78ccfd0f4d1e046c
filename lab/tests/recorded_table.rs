//! The errors on recorded photons in the README agree with the results file.

use std::fs;
use std::path::Path;

/// A file of the repository.
fn read(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path);
    fs::read_to_string(path).unwrap()
}

#[test]
fn the_readmes_errors_are_those_of_the_results() {
    let csv = read("docs/results/data/recorded_rules.csv");
    let results: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    let median = |rule: &str, minimum: &str, estimator: &str| {
        let is_this = |result: &&Vec<&str>| {
            [result[0], result[3], result[5]] == ["0", minimum, estimator]
                && result[1].contains(rule)
        };
        results.iter().find(is_this).unwrap()[8]
    };
    let readme = read("README.md");
    let readme: Vec<&str> = readme.split_whitespace().collect();
    let text = format!(
        "the median error is {} mm with the paper's rule and centroid of three bins. It is {} mm with the window rule and \
         a window that fits the pulse",
        median("paper's rule", "5", "centre of mass"),
        median("window of 3", "9", "skew window")
    );
    assert!(readme.join(" ").contains(&text), "{text}");
}
