//! The dependencies between packages match the table in `ARCHITECTURE.md`, each on a row above its
//! own, and the modules of a package have no import cycles.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use serde_json::Value;

type Arrows = BTreeMap<String, BTreeSet<String>>;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The packages of the workspace from `cargo metadata`.
fn metadata() -> Value {
    let output = Command::new(env!("CARGO"))
        .current_dir(root())
        .args(["metadata", "--no-deps", "--format-version", "1", "--locked"])
        .output()
        .unwrap();
    assert!(output.status.success(), "cargo metadata: {output:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The packages of the workspace that each package uses, and that its tests use.
fn arrows(metadata: &Value) -> (Arrows, Arrows) {
    let packages = metadata["packages"].as_array().unwrap();
    let name = |value: &Value| value["name"].as_str().unwrap().to_owned();
    let ours: BTreeSet<String> = packages.iter().map(name).collect();
    let (mut built, mut tested) = (Arrows::new(), Arrows::new());
    for package in packages {
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
    let (built, tested) = arrows(&metadata());
    assert_eq!(wrong(&documented(), &built, &tested), [""; 0]);
}

/// Each crate of others that a manifest names has a row that says why.
#[test]
fn each_dependency_has_a_reason() {
    let metadata = metadata();
    let packages = metadata["packages"].as_array().unwrap();
    let used: BTreeSet<&str> = packages
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

#[test]
fn an_arrow_that_is_turned_round_is_found() {
    let (built, tested) = arrows(&metadata());
    let arrows = built
        .iter()
        .flat_map(|(from, to)| to.iter().map(move |to| (from, to)));
    let mut turned = 0;
    for (from, to) in arrows {
        let mut built = built.clone();
        built.get_mut(from).unwrap().remove(to);
        built.get_mut(to).unwrap().insert(from.clone());
        let wrong = wrong(&documented(), &built, &tested);
        let expected = format!("{to} uses {from}, which is not above it");
        assert!(wrong.contains(&expected), "{wrong:?}");
        turned += 1;
    }
    assert!(turned >= 15, "{turned} arrows");
}

/// Each package with the imports of its files. Tests share them: to parse all files takes longest.
static GRAPHS: LazyLock<Vec<(String, crate::modules::Imports)>> = LazyLock::new(|| {
    let metadata = metadata();
    let of = |package: &Value| {
        let manifest = Path::new(package["manifest_path"].as_str().unwrap());
        let graph = crate::modules::imports(&manifest.parent().unwrap().join("src"));
        (package["name"].as_str().unwrap().to_owned(), graph)
    };
    let packages = metadata["packages"].as_array().unwrap();
    packages.iter().map(of).collect()
});

#[test]
fn no_files_or_folders_of_a_package_import_each_other_in_a_circle() {
    let files: usize = GRAPHS.iter().map(|(_, graph)| graph.len()).sum();
    assert!(files > 100, "{files} files");
    for (package, graph) in &*GRAPHS {
        assert_eq!(crate::modules::circles(graph), [[""; 0]; 0], "{package}");
    }
}

/// Adds the reverse of each import: between the same two files, and between two others of the same
/// folders. Each must be found as a cycle.
#[test]
fn a_planted_circle_of_files_or_of_folders_is_found() {
    let (mut of_files, mut of_folders) = (0, 0);
    for (_, graph) in &*GRAPHS {
        for (from, to) in graph
            .iter()
            .flat_map(|(from, to)| to.iter().map(move |to| (from, to)))
        {
            let depth = from
                .iter()
                .zip(to)
                .take_while(|(one, other)| one == other)
                .count();
            // A folder may use its own files.
            let (Some(one), Some(other)) = (from.get(..=depth), to.get(..=depth)) else {
                continue;
            };
            let planted = |start: &[String], end: &[String]| {
                let mut graph = graph.clone();
                graph.get_mut(start).unwrap().insert(end.to_owned());
                let circles = crate::modules::circles(&graph);
                let [one, other] = [one, other].map(|place| place.join("::"));
                let is_there =
                    |circle: &Vec<String>| circle.contains(&one) && circle.contains(&other);
                assert!(
                    circles.iter().any(is_there),
                    "{start:?} to {end:?}: {circles:?}"
                );
            };
            planted(to, from);
            of_files += 1;
            let beside = |folder: &[String], file| {
                graph
                    .keys()
                    .find(|&module| module.starts_with(folder) && module != file)
            };
            if let (Some(start), Some(end)) = (beside(other, to), beside(one, from)) {
                planted(start, end);
                of_folders += 1;
            }
        }
    }
    assert!(
        of_files > 500 && of_folders > 100,
        "{of_files}, {of_folders}"
    );
}

/// `package` and all packages that it is built with on this computer.
fn built_with(package: &str) -> BTreeSet<String> {
    let output = Command::new(env!("CARGO"))
        .current_dir(root())
        .args(["tree", "--locked", "--edges", "normal", "--prefix", "none"])
        .args(["--format", "{p}", "--package", package])
        .output()
        .unwrap();
    assert!(output.status.success(), "cargo tree: {output:?}");
    let lines = String::from_utf8(output.stdout).unwrap();
    let names = lines.lines().filter_map(|line| line.split(' ').next());
    names.map(str::to_owned).collect()
}

/// Dependencies of the program or the live page. Libraries and Python must not have them: they read
/// options by key and text.
const OF_THE_PROGRAM: [&str; 5] = ["clap", "hyper", "indicatif", "serialport", "tungstenite"];

#[test]
fn libraries_and_python_do_without_what_only_the_program_needs() {
    let of_program = OF_THE_PROGRAM.map(str::to_owned);
    let used = |package| {
        let all = built_with(package);
        let used = of_program.iter().filter(|name| all.contains(*name));
        used.cloned().collect::<Vec<_>>()
    };
    for package in ["dtof-python", "dtof-run", "dtof-calibrate"] {
        assert_eq!(used(package), [""; 0], "{package}");
    }
    assert_eq!(used("dtof-device"), ["serialport"]);
    assert_eq!(used("dtof-live"), ["hyper", "serialport"]);
    let mut with_foxglove = used("dtof");
    with_foxglove.retain(|name| name != "tungstenite");
    assert_eq!(with_foxglove, ["clap", "hyper", "indicatif", "serialport"]);
}
