//! The dependencies between packages match the table in `ARCHITECTURE.md`, each on a row above its
//! own, and the modules of a package have no import cycles.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use serde_json::Value;

use crate::modules;

type Arrows = BTreeMap<String, BTreeSet<String>>;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The packages of the workspace from `cargo metadata`.
pub static PACKAGES: LazyLock<Vec<Value>> = LazyLock::new(|| {
    let output = Command::new(env!("CARGO"))
        .current_dir(root())
        .args(["metadata", "--no-deps", "--format-version", "1", "--locked"])
        .output()
        .unwrap();
    assert!(output.status.success(), "cargo metadata: {output:?}");
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    metadata["packages"].as_array().unwrap().clone()
});

/// The packages of the workspace that each package uses, and that its tests use.
fn arrows() -> (Arrows, Arrows) {
    let name = |value: &Value| value["name"].as_str().unwrap().to_owned();
    let ours: BTreeSet<String> = PACKAGES.iter().map(name).collect();
    let (mut built, mut tested) = (Arrows::new(), Arrows::new());
    for package in &*PACKAGES {
        let of_tests = |dependency: &&Value| dependency["kind"] == "dev";
        let used = package["dependencies"].as_array().unwrap();
        let (tests, code): (Vec<&Value>, Vec<&Value>) = used
            .iter()
            .filter(|dependency| ours.contains(&name(dependency)))
            .partition(of_tests);
        built.insert(name(package), code.into_iter().map(name).collect());
        tested.insert(name(package), tests.into_iter().map(name).collect());
    }
    (built, tested)
}

/// The rows of the table of packages: package, its dependencies, those of its tests.
fn documented() -> Vec<[String; 3]> {
    let page = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let (_, table) = page.split_once("| package |").expect("a table of packages");
    let rows = table
        .lines()
        .skip(2)
        .take_while(|line| line.starts_with('|'));
    rows.map(|row| {
        let mut cells = row
            .trim_matches('|')
            .split('|')
            .map(|cell| cell.trim().replace('`', ""));
        let [_, package, uses, tests] = [(); 4].map(|()| cells.next().unwrap());
        [package, uses, tests]
    })
    .collect()
}

fn names(cell: &str) -> BTreeSet<String> {
    let names = cell.split(", ").filter(|name| !name.is_empty());
    names.map(str::to_owned).collect()
}

/// Dependencies that differ from the table, or are not on a row above.
fn wrong(documented: &[[String; 3]], built: &Arrows, tested: &Arrows) -> Vec<String> {
    let mut wrong = Vec::new();
    let mut above = BTreeSet::new();
    for [package, uses, tests] in documented {
        let (Some(built), Some(tested)) = (built.get(package), tested.get(package)) else {
            wrong.push(format!("{package} is not in the workspace"));
            continue;
        };
        if *built != names(uses) {
            wrong.push(format!("{package} uses {built:?}, the table says {uses}"));
        }
        // Tests may use the dependencies of the code.
        let more: BTreeSet<String> = tested.difference(built).cloned().collect();
        if more != names(tests) {
            wrong.push(format!(
                "tests of {package} use {more:?}, the table says {tests}"
            ));
        }
        for used in built.union(tested).filter(|&used| !above.contains(used)) {
            wrong.push(format!("{package} uses {used}, which is not above it"));
        }
        above.insert(package.clone());
    }
    for package in built.keys().filter(|&package| !above.contains(package)) {
        wrong.push(format!("{package} is not in the table"));
    }
    wrong
}

#[test]
fn packages_use_what_the_table_says_and_only_what_is_above_them() {
    let (mut built, tested) = arrows();
    assert_eq!(wrong(&documented(), &built, &tested), [""; 0]);
    // An arrow that is turned round is found.
    built.get_mut("dtof-engine").unwrap().remove("dtof-core");
    built
        .get_mut("dtof-core")
        .unwrap()
        .insert("dtof-engine".to_owned());
    let expected = "dtof-core uses dtof-engine, which is not above it".to_owned();
    assert!(wrong(&documented(), &built, &tested).contains(&expected));
}

/// Each crate of others that a manifest names has a row that says why.
#[test]
fn each_dependency_has_a_reason() {
    let used: BTreeSet<&str> = PACKAGES
        .iter()
        .flat_map(|package| package["dependencies"].as_array().unwrap())
        .filter(|dependency| dependency["path"].is_null())
        .map(|dependency| dependency["name"].as_str().unwrap())
        .collect();
    let page = include_str!("../../../docs/dependencies.md");
    let rows = page.lines().filter_map(|line| line.strip_prefix("| `"));
    let rows = rows.filter_map(|row| row.split_once("` | "));
    let listed = rows.filter(|(_, reason)| !reason.trim_end_matches("|").trim().is_empty());
    let listed: Vec<&str> = listed.map(|(name, _)| name).collect();
    assert_eq!(listed.len(), used.len(), "a row twice, or none");
    assert_eq!(BTreeSet::from_iter(listed), used);
}

/// Crates of others that only these packages use. Libraries and Python must not have them: they read options by key and text.
const OF_FEW: [(&str, &[&str]); 7] = [
    ("clap", &["dtof", "dtof-lab"]),
    ("hyper", &["dtof-live"]),
    ("hyper-util", &["dtof-live"]),
    ("indicatif", &["dtof", "dtof-lab"]),
    ("serialport", &["dtof-device"]),
    ("tokio-tungstenite", &["dtof-live"]),
    ("tungstenite", &["dtof"]),
];

#[test]
fn what_only_the_program_and_its_page_need_is_used_by_them_alone() {
    for (name, users) in OF_FEW {
        let uses = |package: &&Value| {
            let mut used = package["dependencies"].as_array().unwrap().iter();
            used.any(|dependency| dependency["name"] == name)
        };
        let mut found: Vec<&str> = PACKAGES
            .iter()
            .filter(uses)
            .map(|package| package["name"].as_str().unwrap())
            .collect();
        found.sort_unstable();
        assert_eq!(found, users, "{name}");
    }
    // Not through others either.
    let output = Command::new(env!("CARGO"))
        .current_dir(root())
        .args(["tree", "--locked", "--edges", "normal", "--prefix", "none"])
        .args(["--format", "{p}", "--package", "dtof-python"])
        .args(["--package", "dtof-run", "--package", "dtof-calibrate"])
        .output()
        .unwrap();
    assert!(output.status.success(), "cargo tree: {output:?}");
    let tree = String::from_utf8(output.stdout).unwrap();
    let built: BTreeSet<&str> = tree
        .lines()
        .filter_map(|line| line.split(' ').next())
        .collect();
    assert!(built.contains("dtof-core"), "{built:?}");
    for name in ["clap", "hyper", "indicatif", "serialport", "tungstenite"] {
        assert!(!built.contains(name), "{name}");
    }
}

#[test]
fn no_files_or_folders_of_a_package_import_each_other_in_a_circle() {
    let mut files = 0;
    for package in &*PACKAGES {
        let manifest = Path::new(package["manifest_path"].as_str().unwrap());
        let graph = modules::imports(&manifest.parent().unwrap().join("src"));
        files += graph.len();
        assert_eq!(
            modules::circles(&graph),
            [[""; 0]; 0],
            "{}",
            package["name"]
        );
    }
    assert!(files > 100, "{files} files");
}

/// Of files, of folders whose files are not the same, and none: a folder may use its own files.
#[test]
fn a_circle_of_files_or_of_folders_is_found() {
    let path = |text: &str| text.split("::").map(str::to_owned).collect::<Vec<_>>();
    let circles = |arrows: &[(&str, &str)]| {
        let mut graph = modules::Imports::new();
        for (from, to) in arrows {
            graph.entry(path(from)).or_default().insert(path(to));
            graph.entry(path(to)).or_default();
        }
        modules::circles(&graph)
    };
    let of_files = circles(&[("a::x", "a::y"), ("a::y", "a::z"), ("a::z", "a::x")]);
    assert_eq!(of_files, [["a::x", "a::y", "a::z"]]);
    assert_eq!(circles(&[("a::x", "b::x"), ("b::y", "a::z")]), [["a", "b"]]);
    let none = [
        ("a::x", "b::x"),
        ("a::y", "b::y"),
        ("b::x", "c"),
        ("a", "a::x"),
    ];
    assert_eq!(circles(&none), [[""; 0]; 0]);
}
