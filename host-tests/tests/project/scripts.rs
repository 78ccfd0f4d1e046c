//! The scripts of the report and of the live page are modules that name what they need.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use dtof_run::report::shared::{Module, bundle};

/// The names of JavaScript and of browsers that the scripts use.
const NAMES_OF_BROWSERS: &str = "Array BigInt Float32Array Float64Array Infinity JSON Map Math NaN Number Object Set \
    String Uint16Array Uint32Array Uint8Array DataView atob parseInt undefined \
    EventSource Option ResizeObserver clearInterval clearTimeout document fetch getComputedStyle matchMedia \
    performance requestAnimationFrame setInterval setTimeout devicePixelRatio";
const KEYWORDS: &str = "async await break catch const continue delete else export false for from function if import in \
    let new null of return true try void while";

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

#[test]
fn a_page_leaves_no_name_but_those_of_its_modules() {
    for page in pages(&scripts()) {
        let names: Vec<&str> = page
            .lines()
            .filter_map(|line| line.strip_suffix(" = (() => {"))
            .collect();
        assert!(
            names.len() > 20 && names.iter().all(|name| name.starts_with("const $")),
            "{names:?}"
        );
        // Everything stands within the function of a module.
        let rest: Vec<&str> = page
            .split("\n})();\n")
            .filter(|module| !module.starts_with("const $"))
            .collect();
        assert_eq!(rest, [""]);
    }
}

#[test]
fn scripts_name_what_they_need() {
    // Neither `window` nor `globalThis` is among the names that are known, so nothing is left there.
    let unknown = scripts()
        .into_iter()
        .map(|(path, text)| (path, unknown(&text)));
    let unknown: Vec<_> = unknown.filter(|(_, names)| !names.is_empty()).collect();
    assert!(unknown.is_empty(), "{unknown:?}");
}

#[test]
fn an_import_that_is_missing_or_unused_is_found() {
    let mut removed = 0;
    for (path, text) in scripts() {
        for line in text.lines().filter(|line| line.starts_with("import ")) {
            let (_, names) = line.split_once("{ ").unwrap();
            let (names, _) = names.split_once(" }").unwrap();
            let rest = text.replacen(&format!("{line}\n"), "", 1);
            let found = unknown(&rest);
            for name in names.split(", ") {
                assert!(
                    found.contains(name),
                    "{path} does not use {name}, or the test does not see it"
                );
                removed += 1;
            }
        }
    }
    assert!(removed > 100, "{removed}");
    let text = "const a = (b, { c, d: e }) => b + c + e + f.g(`h ${i(\"j\")} k`, /l/g) + m;\nfunction n(o) { o.p = q; }\n";
    assert_eq!(
        unknown(text),
        ["f", "i", "m", "q"].map(str::to_owned).into()
    );
}

/// The names that a script uses and neither defines nor imports. Scopes are not told apart.
fn unknown(text: &str) -> BTreeSet<String> {
    let tokens = tokens(text);
    let known = defined(&tokens);
    let words = [NAMES_OF_BROWSERS, KEYWORDS].map(str::split_whitespace);
    let words: BTreeSet<&str> = words.into_iter().flatten().collect();
    let is_used = |at: usize| {
        let before = if at > 0 { &tokens[at - 1][..] } else { "" };
        let after = tokens.get(at + 1).map_or("", String::as_str);
        let is_spread = at > 2 && tokens[at - 3..at].iter().all(|token| token == ".");
        // `a.b`, and the key of `{ b: c }`.
        let is_key = after == ":" && ["{", ","].contains(&before);
        (before != "." || is_spread) && !is_key
    };
    (0..tokens.len())
        .filter(|&at| is_name(&tokens[at]) && is_used(at))
        .map(|at| tokens[at].clone())
        .filter(|name| !known.contains(name) && !words.contains(&name[..]))
        .collect()
}

fn is_name(token: &str) -> bool {
    token.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
}

/// The names that are imported, declared, or parameters.
fn defined(tokens: &[String]) -> BTreeSet<String> {
    let mut defined = BTreeSet::new();
    let mut define =
        |tokens: &[String]| defined.extend(tokens.iter().filter(|token| is_name(token)).cloned());
    for (at, token) in tokens.iter().enumerate() {
        match &token[..] {
            "const" | "let" | "import" => {
                // A name or a pattern; the value after it may use other names.
                let end = if is_name(&tokens[at + 1]) {
                    at + 2
                } else {
                    closing(tokens, at + 1)
                };
                define(&tokens[at + 1..end]);
            }
            "function" => {
                define(&tokens[at + 1..=at + 1]);
                define(&parameters(&tokens[at + 2..closing(tokens, at + 2)]));
            }
            "=" if tokens.get(at + 1).is_some_and(|next| next == ">") => {
                match &tokens[at - 1][..] {
                    ")" => define(&parameters(&tokens[opening(tokens, at - 1)..at])),
                    _ => define(&tokens[at - 1..at]),
                }
            }
            _ => {}
        }
    }
    defined
}

/// Parameters without the values that they have by default.
fn parameters(tokens: &[String]) -> Vec<String> {
    let mut rest = Vec::new();
    let mut is_value = false;
    for token in tokens {
        is_value = (is_value || token == "=") && token != ",";
        if !is_value {
            rest.push(token.clone());
        }
    }
    rest
}

/// The place after the bracket that closes the one at `open`.
fn closing(tokens: &[String], open: usize) -> usize {
    let mut depth = 0;
    for (at, token) in tokens.iter().enumerate().skip(open) {
        match &token[..] {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return at + 1;
        }
    }
    tokens.len()
}

/// The place of the bracket that the one at `close` closes.
fn opening(tokens: &[String], close: usize) -> usize {
    (0..close)
        .rev()
        .find(|&open| closing(tokens, open) == close + 1 && !is_name(&tokens[open]))
        .unwrap()
}

/// Names and signs without comments, texts and numbers. What `${}` has in a text remains.
fn tokens(text: &str) -> Vec<String> {
    let mut tokens: Vec<String> = Vec::new();
    let mut rest = text;
    // For each open `${` the number of braces that are open within.
    let mut braces: Vec<usize> = Vec::new();
    while let Some(first) = rest.chars().next() {
        let is_value = tokens
            .last()
            .is_some_and(|last| is_name(last) || [")", "]", "0"].contains(&&last[..]));
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            rest.find("*/").unwrap() + 2
        } else if first == '"' || first == '/' && !is_value {
            tokens.push("0".to_owned());
            let end = text_length(rest, first);
            // The flags of a pattern.
            end + usize::from(rest[end..].starts_with('g'))
        } else if first == '`' || first == '}' && braces.last() == Some(&0) {
            if first == '}' {
                braces.pop();
                tokens.push(")".to_owned());
            } else {
                tokens.push("0".to_owned());
            }
            let end = text_length(rest, '`');
            match rest[1..end].find("${") {
                Some(at) => {
                    braces.push(0);
                    tokens.push("(".to_owned());
                    at + 3
                }
                None => end,
            }
        } else if first.is_ascii_alphabetic() || first == '_' {
            let end = rest
                .find(|c: char| !c.is_ascii_alphanumeric() && c != '_')
                .unwrap_or(rest.len());
            tokens.push(rest[..end].to_owned());
            end
        } else if first.is_ascii_digit() {
            tokens.push("0".to_owned());
            rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_')
                .unwrap_or(rest.len())
        } else {
            if let Some(open) = braces.last_mut() {
                *open = (*open + usize::from(first == '{')) - usize::from(first == '}');
            }
            if !first.is_whitespace() {
                tokens.push(first.to_string());
            }
            first.len_utf8()
        };
        rest = &rest[length..];
    }
    tokens
}

/// The length of a text that ends with `end`.
fn text_length(text: &str, end: char) -> usize {
    let mut is_escaped = false;
    for (at, letter) in text.char_indices().skip(1) {
        if letter == end && !is_escaped {
            return at + 1;
        }
        is_escaped = letter == '\\' && !is_escaped;
    }
    text.len()
}
