//! Finds the places where an image can panic. The linker names only the panic handler, so
//! `check-image` searches for them in an image with a panic.
//!
//! Every call of the panicking machinery passes the address of a
//! [`Location`](std::panic::Location) among the constants: address and length of the file's name,
//! line and column. The compiler may change that layout: then nothing is found here, but the image
//! is still refused.

use std::fs;
use std::path::Path;

use anyhow::Result;
use object::{Object, ObjectSection, SectionKind};

/// A place in a source file; line and column count from 1.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Place<'a> {
    file: &'a str,
    line: usize,
    column: usize,
}

/// Every source location among the constants of a 32-bit little-endian image, but for those of the panic that
/// the compiler adds to each `async fn`. Their place is the body.
pub fn places(root: &Path, image: &[u8]) -> Result<Vec<String>> {
    let file = object::File::parse(image)?;
    let mut constants = Vec::new();
    for section in file.sections() {
        if matches!(
            section.kind(),
            SectionKind::ReadOnlyData | SectionKind::ReadOnlyString | SectionKind::Data
        ) {
            constants.push((section.address(), section.data()?));
        }
    }
    let mut places: Vec<Place> = constants
        .iter()
        .flat_map(|(_, data)| data.windows(16).step_by(4))
        .filter_map(|words| place(words, &constants))
        .filter(|place| {
            let source = fs::read_to_string(root.join(place.file));
            !source.is_ok_and(|source| is_block(&source, place))
        })
        .collect();
    places.sort();
    places.dedup();
    let text = |Place { file, line, column }| format!("{file}:{line}:{column}");
    Ok(places.into_iter().map(text).collect())
}

/// Whether a block begins there, which by itself never panics.
fn is_block(source: &str, place: &Place) -> bool {
    let line = source.lines().nth(place.line.wrapping_sub(1));
    line.and_then(|line| line.chars().nth(place.column.wrapping_sub(1))) == Some('{')
}

/// The place if these four words are a location.
fn place<'a>(words: &[u8], constants: &[(u64, &'a [u8])]) -> Option<Place<'a>> {
    let word = |index: usize| {
        let bytes = words.get(4 * index..4 * index + 4)?;
        usize::try_from(u32::from_le_bytes(bytes.try_into().ok()?)).ok()
    };
    let [address, length, line, column] = [word(0)?, word(1)?, word(2)?, word(3)?];
    let name = constants.iter().find_map(|(start, data)| {
        let from = address.checked_sub(usize::try_from(*start).ok()?)?;
        data.get(from..from.checked_add(length)?)
    })?;
    let file = std::str::from_utf8(name).ok()?;
    file.ends_with(".rs")
        .then_some(Place { file, line, column })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_a_location() {
        let name = b"..src/lib.rs";
        let words: Vec<u8> = [0x1002u32, 10, 142, 9]
            .iter()
            .flat_map(|word| word.to_le_bytes())
            .collect();
        let constants = [(0x1000, &name[..])];
        let found = Place {
            file: "src/lib.rs",
            line: 142,
            column: 9,
        };
        assert_eq!(place(&words, &constants), Some(found));
        assert_eq!(place(&words, &[(0x2000, &name[..])]), None);
        assert_eq!(place(&words, &[(0x1000, &name[..5])]), None);
    }

    #[test]
    fn leaves_out_the_body_of_an_async_fn() {
        let source = "\nasync fn one(a: &[u8]) {\n    a[1];\n}";
        let is_left_out = |line, column| {
            let file = "";
            is_block(source, &Place { file, line, column })
        };
        assert!(is_left_out(2, 24));
        assert!(!is_left_out(3, 5) && !is_left_out(2, 25) && !is_left_out(0, 0));
    }
}
