//! Joins the JavaScript modules of a page into one script, so that a page is one file.
//!
//! Each module becomes a function that is called once and returns its exports. So it sees only
//! its own names and those that it imports. Modules use the part of the syntax that [`Error`] describes.
//! Comments that fill a line and empty lines are left out.

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Display, Formatter};

/// A module: its path, which its imports are relative to, and its text.
pub type Module<'a> = (&'a str, &'a str);

/// Why modules cannot be joined.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Error {
    /// A line that is not understood. Imports are `import { a, b } from "./x.js";` in one line, exports
    /// `export function`, `export async function` or `export const` before a name. No text spans lines.
    Line {
        /// The path of the module.
        module: String,
        /// The line.
        line: String,
    },
    /// An import from a module that is not there.
    NoModule {
        /// The path of the module that imports it.
        module: String,
        /// Its path.
        from: String,
    },
    /// An import of a name that the other module does not export.
    NoName {
        /// The path of the module that imports it.
        module: String,
        /// The path of the other module.
        from: String,
        /// The name.
        name: String,
    },
    /// Modules that import each other: the path of each, the first one again at the end.
    Circle(Vec<String>),
    /// Two modules whose files have the same name.
    SameFile(String),
}

impl Display for Error {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line { module, line } => write!(f, "{module}: not understood: {line}"),
            Self::NoModule { module, from } => write!(f, "{module}: there is no {from}"),
            Self::NoName { module, from, name } => {
                write!(f, "{module}: {from} does not export {name}")
            }
            Self::Circle(modules) => write!(f, "a circle of imports: {}", modules.join(" → ")),
            Self::SameFile(name) => write!(f, "two modules are called {name}"),
        }
    }
}

impl core::error::Error for Error {}

/// The script of a page: the module `main` and all that it imports, each after those that it imports itself.
///
/// # Errors
/// Fails if the modules do not fit together.
pub fn bundle(main: &str, modules: &[Module]) -> Result<String, Error> {
    let mut joined = Joined {
        texts: modules.iter().copied().collect(),
        done: BTreeMap::new(),
        names: BTreeSet::new(),
        script: String::new(),
    };
    joined.add(main, &mut Vec::new())?;
    Ok(joined.script)
}

struct Joined<'a> {
    texts: BTreeMap<&'a str, &'a str>,
    /// The exports of the modules that are in the script, by path.
    done: BTreeMap<String, BTreeSet<String>>,
    /// Their names in the script.
    names: BTreeSet<String>,
    script: String,
}

impl Joined<'_> {
    /// Adds a module, after those that it imports. `importing` has the modules that lead to it.
    fn add(&mut self, path: &str, importing: &mut Vec<String>) -> Result<(), Error> {
        if self.done.contains_key(path) {
            return Ok(());
        }
        if let Some(first) = importing.iter().position(|other| other == path) {
            let circle = importing[first..].iter().map(String::as_str);
            return Err(Error::Circle(
                circle.chain([path]).map(str::to_owned).collect(),
            ));
        }
        let text = self.texts.get(path).ok_or_else(|| Error::NoModule {
            module: importing.last().cloned().unwrap_or_default(),
            from: path.to_owned(),
        })?;
        let parsed = parse(path, text)?;
        importing.push(path.to_owned());
        let mut head = String::new();
        for (names, relative) in &parsed.imports {
            let from = resolve(path, relative);
            self.add(&from, importing)?;
            if let Some(name) = names.iter().find(|name| !self.done[&from].contains(**name)) {
                return Err(Error::NoName {
                    module: path.to_owned(),
                    from,
                    name: (*name).to_owned(),
                });
            }
            head += &format!("const {{ {} }} = {};\n", names.join(", "), name_of(&from));
        }
        importing.pop();
        let name = name_of(path);
        if !self.names.insert(name.clone()) {
            return Err(Error::SameFile(path.to_owned()));
        }
        let exports: Vec<&str> = parsed.exports.iter().map(String::as_str).collect();
        self.script += &format!(
            "const {name} = (() => {{\n{head}{}return {{ {} }};\n}})();\n",
            parsed.code,
            exports.join(", ")
        );
        self.done.insert(path.to_owned(), parsed.exports);
        Ok(())
    }
}

/// The name of a module in the script: that of its file.
fn name_of(path: &str) -> String {
    let file = path.rsplit('/').next().unwrap_or(path);
    format!("${}", file.trim_end_matches(".js").replace('-', "_"))
}

/// The path of an import of the module at `path`.
fn resolve(path: &str, relative: &str) -> String {
    let mut parts: Vec<&str> = path.split('/').collect();
    parts.pop();
    for part in relative.split('/') {
        match part {
            "." => {}
            ".." => {
                parts.pop();
            }
            part => parts.push(part),
        }
    }
    parts.join("/")
}

struct Parsed<'a> {
    /// Names, and the module that has them.
    imports: Vec<(Vec<&'a str>, &'a str)>,
    exports: BTreeSet<String>,
    /// The text without imports, the word `export`, comments and empty lines.
    code: String,
}

fn parse<'a>(path: &str, text: &'a str) -> Result<Parsed<'a>, Error> {
    let mut parsed = Parsed {
        imports: Vec::new(),
        exports: BTreeSet::new(),
        code: String::new(),
    };
    let mut is_comment = false;
    for line in text.lines() {
        let not_understood = || Error::Line {
            module: path.to_owned(),
            line: line.to_owned(),
        };
        let start = line.trim_start();
        is_comment |= start.starts_with("/*");
        if is_comment {
            is_comment = !line.contains("*/");
            // Code after a comment would be lost.
            if !is_comment && !line.trim_end().ends_with("*/") {
                return Err(not_understood());
            }
            continue;
        }
        if start.is_empty() || start.starts_with("//") {
            continue;
        }
        if line.matches('`').count() % 2 == 1
            || line.contains("import(")
            || line.contains("import.meta")
        {
            return Err(not_understood());
        }
        if start.starts_with("import") {
            parsed
                .imports
                .push(import(line).ok_or_else(not_understood)?);
        } else if start.starts_with("export") {
            let (code, name) = export(line).ok_or_else(not_understood)?;
            parsed.exports.insert(name.to_owned());
            parsed.code += code;
            parsed.code.push('\n');
        } else {
            parsed.code += line;
            parsed.code.push('\n');
        }
    }
    Ok(parsed)
}

/// The names and the path of an import.
fn import(line: &str) -> Option<(Vec<&str>, &str)> {
    let rest = line.strip_prefix("import { ")?;
    let (names, rest) = rest.split_once(" } from \"")?;
    let path = rest.strip_suffix("\";")?;
    let names: Vec<&str> = names.split(", ").collect();
    let is_relative = path.starts_with("./") || path.starts_with("../");
    (is_relative && path.ends_with(".js") && names.iter().all(|name| is_name(name)))
        .then_some((names, path))
}

/// The line without the word `export`, and the name that it defines.
fn export(line: &str) -> Option<(&str, &str)> {
    let code = line.strip_prefix("export ")?;
    let kinds = ["function ", "async function ", "const "];
    let rest = kinds.iter().find_map(|kind| code.strip_prefix(kind))?;
    let end = rest.find([' ', '(']).unwrap_or(rest.len());
    let name = &rest[..end];
    is_name(name).then_some((code, name))
}

fn is_name(text: &str) -> bool {
    let is_letter = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
    !text.is_empty()
        && text.chars().all(is_letter)
        && !text.starts_with(|c: char| c.is_ascii_digit())
}
