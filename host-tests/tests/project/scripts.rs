//! The scripts of the report and of the live page are modules that some page imports. `.ci/run` has `oxlint` look for
//! names that are not defined or not used, and for imports in a circle.

use std::fs;
use std::path::{Path, PathBuf};

use dtof_run::report::shared::{Module, bundle};

fn host() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../host")
}

/// Paths, below `host`, and texts of all scripts of both pages.
fn scripts() -> Vec<(String, String)> {
    let mut scripts = Vec::new();
    let mut folders = vec![host().join("run/src/report"), host().join("live/src")];
    while let Some(folder) = folders.pop() {
        for path in fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
        {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "js") {
                let name = path.strip_prefix(host()).unwrap().to_str().unwrap();
                scripts.push((name.to_owned(), fs::read_to_string(&path).unwrap()));
            }
        }
    }
    scripts.sort();
    scripts
}

/// The scripts of both pages, joined.
fn pages(scripts: &[(String, String)]) -> Vec<String> {
    let modules: Vec<Module> = scripts
        .iter()
        .map(|(path, text)| (&path[..], &text[..]))
        .collect();
    ["run/src/report/page/main.js", "live/src/page/main.js"]
        .map(|main| bundle(main, &modules).unwrap_or_else(|error| panic!("{error}")))
        .into()
}

/// The paths that a script imports.
fn imports(text: &str) -> impl Iterator<Item = &str> {
    text.lines()
        .filter(|line| line.starts_with("import "))
        .filter_map(|line| line.split('"').nth(1))
}

#[test]
fn every_script_is_a_module_and_imports_go_one_way() {
    let scripts = scripts();
    assert!(scripts.len() > 30, "{}", scripts.len());
    let pages = pages(&scripts);
    for (path, text) in &scripts {
        let file = path.rsplit('/').next().unwrap().trim_end_matches(".js");
        let name = format!("const ${} = (", file.replace('-', "_"));
        assert!(
            pages.iter().any(|page| page.contains(&name)),
            "no page imports {path}"
        );
        for import in imports(text) {
            let is_allowed = match path.split('/').collect::<Vec<_>>()[..] {
                ["run", "src", "report", "shared", _] => import.starts_with("./"),
                ["run", "src", "report", "page", _] => {
                    import.starts_with("./") || import.starts_with("../shared/")
                }
                ["live", "src", "page", _] => {
                    import.starts_with("./")
                        || import.starts_with("../../../run/src/report/shared/")
                }
                _ => false,
            };
            assert!(is_allowed, "{path} imports {import}");
        }
    }
}
