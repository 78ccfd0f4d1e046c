//! The published packages are complete without the workspace: README, licences, an example, and every
//! file that is compiled in.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::architecture::PACKAGES;

/// Most libraries of the host have an example in their README only.
fn is_of_host(package: &Value) -> bool {
    let is_of_more = ["dtof", "dtof-draw", "dtof-light"]
        .iter()
        .any(|name| package["name"] == *name);
    folder(package).parent().unwrap().ends_with("host") && !is_of_more
}

/// The most bytes of a package before compression.
const MOST_BYTES: u64 = 1_000_000;

fn root() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    root.canonicalize().unwrap()
}

fn cargo(arguments: &[&str]) -> Vec<u8> {
    let mut command = Command::new(env!("CARGO"));
    let output = command
        .current_dir(root())
        .args(arguments)
        .output()
        .unwrap();
    assert!(output.status.success(), "{arguments:?}: {output:?}");
    output.stdout
}

fn text<'a>(package: &'a Value, key: &str) -> &'a str {
    package[key].as_str().unwrap_or_default()
}

fn folder(package: &Value) -> PathBuf {
    let manifest = Path::new(text(package, "manifest_path"));
    manifest.parent().unwrap().to_owned()
}

/// `publish = false` is an empty list of registries.
fn is_published(package: &Value) -> bool {
    package["publish"].is_null()
}

fn words(text: &str) -> usize {
    text.split_whitespace().count()
}

/// The parts that a package lacks.
fn lacking(package: &Value) -> Vec<&'static str> {
    let count = |key: &str| package[key].as_array().map_or(0, Vec::len);
    let builds = |kind: &str| {
        let mut targets = package["targets"].as_array().unwrap().iter();
        targets.any(|target| target["kind"][0] == kind)
    };
    let docs = &package["metadata"]["docs"]["rs"];
    let readme = fs::read_to_string(folder(package).join(text(package, "readme")));
    let readme = readme.unwrap_or_default();
    let library = folder(package).join("src/lib.rs");
    let library = fs::read_to_string(library).unwrap_or_default();
    let badges = format!(
        "\nRust {} or newer. MIT or Apache-2.0.\n",
        text(package, "rust_version")
    );
    let without_std = library.contains("#![no_std]") || library.contains("no_std)]");
    let least = if is_of_host(package) { 100 } else { 150 };
    let required = [
        ("description", !text(package, "description").is_empty()),
        ("licence", text(package, "license") == "MIT OR Apache-2.0"),
        ("oldest Rust", !text(package, "rust_version").is_empty()),
        ("categories", (1..=5).contains(&count("categories"))),
        ("keywords", (1..=5).contains(&count("keywords"))),
        ("library", builds("lib")),
        ("example", is_of_host(package) || builds("example")),
        ("README of 150 words", words(&readme) >= least),
        (
            "README of 350 words beside its code",
            readme.split("```").step_by(2).map(words).sum::<usize>() <= 350,
        ),
        ("oldest Rust and licence in it", readme.ends_with(&badges)),
        (
            "`no_std` in it",
            !without_std || readme.contains("`no_std`"),
        ),
        ("compiled example in it", readme.contains("\n```rust\n")),
        ("README without ways out of it", !readme.contains("](")),
        (
            "README as its documentation",
            library.contains("#![doc = include_str!(\"../README.md\")]"),
        ),
        ("all features on docs.rs", docs["all-features"] == true),
        ("targets on docs.rs", docs["targets"].is_array()),
    ];
    let lacking = required.iter().filter(|(_, is_there)| !is_there);
    lacking.map(|(what, _)| *what).collect()
}

/// The files of a packed package.
fn packed(package: &Value) -> BTreeSet<PathBuf> {
    let list = [
        "package",
        "--list",
        "--allow-dirty",
        "--locked",
        "--offline",
    ];
    let list = [&list[..], &["--package", text(package, "name")]].concat();
    let list = String::from_utf8(cargo(&list)).unwrap();
    list.lines().map(PathBuf::from).collect()
}

/// Files that the sources among `files` compile in, without those that are among `files`.
fn compiled_from_elsewhere(folder: &Path, files: &BTreeSet<PathBuf>) -> Vec<String> {
    let is_source = |file: &&PathBuf| file.extension() == Some("rs".as_ref());
    let mut elsewhere = Vec::new();
    for file in files.iter().filter(is_source) {
        let source = fs::read_to_string(folder.join(file)).unwrap();
        let names = ["include_str!(\"", "include_bytes!(\"", "#[path = \""]
            .into_iter()
            .flat_map(|start| source.split(start).skip(1))
            .filter_map(|rest| rest.split_once('"'));
        for (name, _) in names {
            let mut path = file.parent().unwrap().to_owned();
            let inside = Path::new(name).iter().all(|part| {
                if part == ".." {
                    return path.pop();
                }
                path.push(part);
                true
            });
            if !inside || !files.contains(&path) {
                elsewhere.push(format!("{}: {name}", file.display()));
            }
        }
    }
    elsewhere
}

/// A manifest says whether its package is published.
#[test]
fn what_a_published_package_uses_is_published() {
    let packages = &*PACKAGES;
    let published: Vec<&Value> = packages
        .iter()
        .filter(|package| is_published(package))
        .collect();
    let names: BTreeSet<&str> = published
        .iter()
        .map(|package| text(package, "name"))
        .collect();
    assert!(
        names.contains("dtof-core") && names.contains("dtof"),
        "{names:?}"
    );
    for used in published
        .iter()
        .flat_map(|package| package["dependencies"].as_array().unwrap())
    {
        // Cargo does not pack a dependency without a version, which only tests may have.
        let is_packed = !used["path"].is_null() && used["req"] != "*";
        assert!(!is_packed || names.contains(text(used, "name")), "{used}");
    }
}

#[test]
fn the_version_is_the_newest_of_the_changelog() {
    let changelog = fs::read_to_string(root().join("CHANGELOG.md")).unwrap();
    let headings = changelog
        .lines()
        .filter_map(|line| line.strip_prefix("## ["));
    let newest = headings.filter_map(|line| line.split_once(']'));
    let newest = newest
        .map(|(version, _)| version)
        .find(|name| *name != "Unreleased");
    for package in &*PACKAGES {
        assert_eq!(
            Some(text(package, "version")),
            newest,
            "{}",
            package["name"]
        );
    }
}

#[test]
fn a_published_package_has_all_that_its_page_and_its_users_need() {
    let packages = &*PACKAGES;
    for package in packages.iter().filter(|package| is_published(package)) {
        assert_eq!(lacking(package), [""; 0], "{}", package["name"]);
    }
    // An unpublished package lacks most parts, which proves that they are checked.
    let other = packages
        .iter()
        .find(|package| package["name"] == "dtof-lab");
    assert!(lacking(other.unwrap()).len() > 5);
}

#[test]
fn a_package_is_small_and_compiles_in_what_is_packed_only() {
    for package in PACKAGES.iter().filter(|package| is_published(package)) {
        let (folder, files) = (folder(package), packed(package));
        for file in ["LICENSE-APACHE", "LICENSE-MIT", "README.md", "src/lib.rs"] {
            assert!(
                files.contains(Path::new(file)),
                "{file} of {}",
                package["name"]
            );
        }
        let has_example = files.iter().any(|file| file.starts_with("examples"));
        assert!(has_example || is_of_host(package), "{}", package["name"]);
        // Cargo generates some files.
        let there = files
            .iter()
            .filter_map(|file| fs::metadata(folder.join(file)).ok());
        let bytes: u64 = there.map(|file| file.len()).sum();
        println!("{}: {} files, {bytes} bytes", package["name"], files.len());
        assert!(bytes < MOST_BYTES, "{}: {bytes} bytes", package["name"]);

        let sources: BTreeSet<PathBuf> = files
            .into_iter()
            .filter(|file| folder.join(file).exists())
            .collect();
        assert_eq!(compiled_from_elsewhere(&folder, &sources), [""; 0]);
        // The check finds a missing file.
        let without: BTreeSet<PathBuf> = sources
            .into_iter()
            .filter(|file| file != Path::new("README.md"))
            .collect();
        let found = compiled_from_elsewhere(&folder, &without);
        assert_eq!(found, ["src/lib.rs: ../README.md"]);
    }
}
