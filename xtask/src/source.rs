//! `cargo xtask check-source`: no floating point and no `unsafe` in the text of
//! `core/src`, not even where no image uses it.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

/// Scans every file of `core/src`.
pub fn check(root: &Path) -> Result<()> {
    let folder = root.join("core").join("src");
    let mut files = rust_files(&folder)?;
    files.sort();
    ensure!(!files.is_empty(), "no Rust file in core/src");

    let mut findings = Vec::new();
    for path in &files {
        let text = fs::read_to_string(path).with_context(|| path.display().to_string())?;
        let code = code_of(&text);
        let name = path.strip_prefix(root).unwrap_or(path).display();
        for (line, word) in forbidden(&code) {
            findings.push(format!("{name}:{line}: `{word}`"));
        }
        let is_root = path == &folder.join("lib.rs");
        if is_root && !code.contains("#![forbid(unsafe_code)]") {
            findings.push(format!("{name}: `#![forbid(unsafe_code)]` is missing"));
        }
    }
    ensure!(
        findings.is_empty(),
        "dtof-core is integer-only and safe, but has\n  {}",
        findings.join("\n  ")
    );
    println!(
        "core/src: {} files without floating point and unsafe",
        files.len()
    );
    Ok(())
}

fn rust_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        if path.is_dir() {
            files.extend(rust_files(&path)?);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    Ok(files)
}

/// What must not stand in code, with its line, the first being 1.
fn forbidden(code: &str) -> Vec<(usize, &str)> {
    let mut findings = Vec::new();
    for (number, line) in (1..).zip(code.lines()) {
        for (start, word) in words(line) {
            let (before, after) = (&line[..start], &line[start + word.len()..]);
            if matches!(word, "unsafe" | "f16" | "f32" | "f64" | "f128")
                || is_float_literal(before, word, after)
            {
                findings.push((number, word));
            }
        }
    }
    findings
}

/// Whether `word` is the start of a floating-point number, which names the type
/// (`1f32`) or not (`0.5`, `1.`, `2e3`).
fn is_float_literal(before: &str, word: &str, after: &str) -> bool {
    if !word.starts_with(|first: char| first.is_ascii_digit()) || word.starts_with("0x") {
        return false;
    }
    let suffixed = word.ends_with("f32") || word.ends_with("f64");
    let exponent = word.contains(['e', 'E']) && !word.ends_with("size");
    // Not those of `pair.0.1`, `0..1` and `1.max(2)`.
    let fraction = !before.ends_with('.')
        && after.strip_prefix('.').is_some_and(|after| {
            let next = after.chars().next();
            next.is_none_or(|next| next.is_ascii_digit() || next != '.' && !is_word(next))
        });
    suffixed || exponent || fraction
}

fn is_word(character: char) -> bool {
    character.is_alphanumeric() || character == '_'
}

/// The identifiers, keywords and numbers of a line and where they start.
fn words(line: &str) -> impl Iterator<Item = (usize, &str)> {
    let start = line.as_ptr().addr();
    line.split(|character| !is_word(character))
        .filter(|word| !word.is_empty())
        .map(move |word| (word.as_ptr().addr() - start, word))
}

/// The text of a Rust file with comments and what stands in quotes left out.
/// Lines stay where they are.
fn code_of(text: &str) -> String {
    let mut code = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let length = match first {
            '/' if rest.starts_with("//") => rest.find('\n').unwrap_or(rest.len()),
            '/' if rest.starts_with("/*") => block_comment(rest),
            '"' => quoted(rest, '"'),
            '\'' => character(rest),
            _ if is_word(first) => {
                let word = rest.find(|next| !is_word(next)).unwrap_or(rest.len());
                let (word, after) = rest.split_at(word);
                code.push_str(word);
                rest = after;
                // r"...", br#"..."#, cr"...": no escapes in them.
                if matches!(word, "r" | "br" | "cr") {
                    raw_string(rest)
                } else {
                    0
                }
            }
            _ => {
                code.push(first);
                rest = &rest[first.len_utf8()..];
                continue;
            }
        };
        let (left_out, after) = rest.split_at(length);
        // What stood on both sides stays apart.
        if length > 0 {
            code.push(' ');
        }
        code.extend(left_out.chars().filter(|&character| character == '\n'));
        rest = after;
    }
    code
}

/// The length of the comment at the start; comments may be nested.
fn block_comment(text: &str) -> usize {
    let mut depth = 0;
    let mut at = 0;
    while let Some(next) = text[at..].chars().next() {
        if text[at..].starts_with("/*") {
            depth += 1;
            at += 2;
        } else if text[at..].starts_with("*/") {
            depth -= 1;
            at += 2;
            if depth == 0 {
                return at;
            }
        } else {
            at += next.len_utf8();
        }
    }
    at
}

/// The length of the literal at the start, up to the `quote` that no backslash
/// precedes.
fn quoted(text: &str, quote: char) -> usize {
    let mut characters = text.char_indices().skip(1);
    while let Some((at, character)) = characters.next() {
        if character == '\\' {
            characters.next();
        } else if character == quote {
            return at + quote.len_utf8();
        }
    }
    text.len()
}

/// The length of the character at the start, or 1 for the quote of a lifetime.
fn character(text: &str) -> usize {
    let mut characters = text.chars().skip(1);
    match (characters.next(), characters.next()) {
        (Some('\\'), _) | (Some(_), Some('\'')) => quoted(text, '\''),
        _ => 1,
    }
}

/// The length of the raw string at the start, from the first `#` or quote on; 0
/// if there is none.
fn raw_string(text: &str) -> usize {
    let hashes = text.len() - text.trim_start_matches('#').len();
    if !text[hashes..].starts_with('"') {
        return 0;
    }
    let end = format!("\"{}", "#".repeat(hashes));
    let start = hashes + 1;
    text[start..]
        .find(&end)
        .map_or(text.len(), |at| start + at + end.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn found(text: &str) -> Vec<(usize, String)> {
        let code = code_of(text);
        assert_eq!(code.lines().count(), text.lines().count(), "{code}");
        let findings = forbidden(&code).into_iter();
        findings.map(|(line, word)| (line, word.into())).collect()
    }

    #[track_caller]
    fn assert_clean(text: &str) {
        assert_eq!(found(text), [], "{text}");
    }

    #[test]
    fn finds_types_suffixes_and_literals() {
        for text in [
            "let x: f32 = y;",
            "y as f64",
            "f64::from(3)",
            "Vec::<f32>::new()",
            "let x = 1f32;",
            "let x = 1_f64;",
            "let x = 0.5;",
            "let x = 1.;",
            "let x = 2e3;",
            "(a.0, 0.1)",
        ] {
            assert_eq!(found(text).len(), 1, "{text}");
        }
    }

    #[test]
    fn finds_unsafe_in_every_place() {
        assert_eq!(found("unsafe { read() }"), [(1, "unsafe".into())]);
        assert_eq!(found("\n#[unsafe(no_mangle)]"), [(2, "unsafe".into())]);
        assert_eq!(found("fn f() {}unsafe fn g() {}").len(), 1);
        assert_eq!(found("a /* b */unsafe/* c */ {}").len(), 1);
    }

    #[test]
    fn passes_names_that_only_look_alike() {
        assert_clean("#![forbid(unsafe_code)]");
        assert_clean("let my_f32 = to_f64(f32x4); let f32_ = 1; // f32");
        assert_clean("pair.0.1 + (0..1).len() + 0..=9 + 1.max(2) + 0xf32 + 0x1e5 + 3usize");
        assert_clean("const { 1_000u64 } 7u32 1isize");
    }

    #[test]
    fn passes_comments() {
        assert_clean("// f32 unsafe\n/// `f64`\n//! \"unsafe\nx");
        assert_clean("/* f32 /* unsafe */ f64 \n */ x /* \" */ y");
        assert_eq!(found("/* /* */ f32 */ f64"), [(1, "f64".into())]);
        assert_eq!(found("x // f32\nf32"), [(2, "f32".into())]);
    }

    #[test]
    fn passes_what_stands_in_quotes() {
        assert_clean("\"f32 // \\\" unsafe\" y");
        assert_clean("b\"f32\" c\"f32\" r\"f32\\\" r#\"f32 \" unsafe\"# br##\"\"# f64\"## y");
        assert_clean("U8F8::lit(\"2.5\")");
        assert_eq!(found("\"a\nb\" f32"), [(2, "f32".into())]);
        assert_eq!(found("r\"\\\" f32 \"\""), [(1, "f32".into())]);
        assert_eq!(found("\"/*\" f32 \"*/\""), [(1, "f32".into())]);
    }

    #[test]
    fn tells_characters_from_lifetimes() {
        assert_eq!(found("'\"' f32 '\"'"), [(1, "f32".into())]);
        assert_eq!(found("'\\'' f32 '\\\\' b'\"' f64 '\"'").len(), 2);
        assert_eq!(
            found("fn f<'a>(x: &'a f32, y: &'a u8)"),
            [(1, "f32".into())]
        );
        assert_clean("'\\u{1f32}' '/' '/' x");
    }

    #[test]
    fn core_is_clean() {
        check(crate::root().unwrap()).unwrap();
    }
}
