//! Finds the places where an image can panic. The linker names only the panic handler, so
//! `check-image` searches for them in an image with a panic.
//!
//! Every call of the panicking machinery passes the address of a
//! [`Location`](std::panic::Location) among the constants: address and length of the file's name,
//! line and column. The compiler may change that layout: then nothing is found here, but the image
//! is still refused.

use anyhow::Result;
use object::{Object, ObjectSection, SectionKind};

/// Every source location among the constants of a 32-bit little-endian image.
pub fn places(image: &[u8]) -> Result<Vec<String>> {
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
    let mut places: Vec<String> = constants
        .iter()
        .flat_map(|(_, data)| data.windows(16).step_by(4))
        .filter_map(|words| place(words, &constants))
        .collect();
    places.sort();
    places.dedup();
    Ok(places)
}

/// `file:line:column` if these four words are a location.
fn place(words: &[u8], constants: &[(u64, &[u8])]) -> Option<String> {
    let word = |index: usize| {
        let bytes = words.get(4 * index..4 * index + 4)?;
        Some(u32::from_le_bytes(bytes.try_into().ok()?))
    };
    let [address, length, line, column] = [word(0)?, word(1)?, word(2)?, word(3)?];
    let name = constants.iter().find_map(|(start, data)| {
        let from = usize::try_from(u64::from(address).checked_sub(*start)?).ok()?;
        data.get(from..from.checked_add(usize::try_from(length).ok()?)?)
    })?;
    let name = std::str::from_utf8(name).ok()?;
    name.ends_with(".rs")
        .then(|| format!("{name}:{line}:{column}"))
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
        assert_eq!(place(&words, &constants).unwrap(), "src/lib.rs:142:9");
        assert_eq!(place(&words, &[(0x2000, &name[..])]), None);
        assert_eq!(place(&words, &[(0x1000, &name[..5])]), None);
    }
}
