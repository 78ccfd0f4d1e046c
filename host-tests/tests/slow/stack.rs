//! Measures how much of its stack an image has used.
//!
//! Before `main`, cortex-m-rt paints the stack. The stack is lowest in RAM and grows downwards:
//! everything above the lowest word that has lost its paint counts as used. Words that a function
//! reserves but never writes keep their paint. So the tests compare the used bytes with the bound
//! from the machine code (`xtask::stack_bound`).

use std::collections::BTreeMap;
use std::fs;
use std::ops::Range;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use object::{Object, ObjectSection, ObjectSymbol, SectionKind};

/// cortex-m-rt's `STACK_PAINT_VALUE`.
const PAINT: [u8; 4] = 0xcccc_cccc_u32.to_le_bytes();
/// `bkpt #0xab`: a semihosting call.
const SEMIHOSTING: [u8; 2] = 0xbeab_u16.to_le_bytes();

/// The most bytes of stack for a run that ends with the report of a panic, or for an image without a
/// bound in `cargo xtask sizes`. An image has 19 KiB of stack and may need 12.
pub const MOST: u64 = 7 * 1024;

/// The stack of an image, from its symbols.
pub struct Image {
    /// From its lowest address to its start.
    pub stack: Range<u64>,
    /// The statics, which lie above.
    pub statics: Range<u64>,
    symbols: BTreeMap<String, u64>,
    /// The addresses of semihosting calls.
    pub semihosting: Vec<u64>,
}

impl Image {
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = fs::read(path).with_context(|| path.display().to_string())?;
        let file = object::File::parse(&*bytes)?;
        let symbols = file.symbols();
        let symbols = symbols.filter_map(|symbol| Some((symbol.name().ok()?, symbol.address())));
        let symbols = symbols.map(|(name, address)| (name.to_owned(), address));
        let mut image = Self {
            stack: 0..0,
            statics: 0..0,
            symbols: symbols.collect(),
            semihosting: Vec::new(),
        };
        let [end, start] = [image.address("_stack_end")?, image.address("_stack_start")?];
        image.stack = end..start;
        image.statics = start..image.address("__sheap")?;
        for section in file.sections() {
            if section.kind() == SectionKind::Text {
                let pairs = section.data()?.chunks(2);
                let addresses = (section.address()..).step_by(2);
                let found = addresses
                    .zip(pairs)
                    .filter(|(_, pair)| *pair == SEMIHOSTING);
                image.semihosting.extend(found.map(|(address, _)| address));
            }
        }
        Ok(image)
    }

    /// The address of the function or static with such a part in its name.
    pub fn function(&self, part: &str) -> Result<u64> {
        let mut found = self.symbols.iter().filter(|(name, _)| name.contains(part));
        let (_, address) = found
            .next()
            .with_context(|| format!("no {part} in the image"))?;
        ensure!(found.next().is_none(), "more than one {part} in the image");
        Ok(address & !1)
    }

    /// The address of a symbol.
    pub fn address(&self, name: &str) -> Result<u64> {
        let address = self.symbols.get(name);
        let address = address.with_context(|| format!("no symbol {name} in the image"))?;
        Ok(*address)
    }
}

/// Compares the stack that runs of an image have used with the bound from its machine code.
pub fn check(path: &Path, used: &[u64]) -> Result<()> {
    let used = used.iter().max().copied().unwrap_or_default();
    let needed = xtask::stack_bound::of_image(path)?;
    println!("{used} bytes of stack used at most, {needed} needed at most");
    ensure!(
        used <= needed,
        "{used} bytes of stack are used, more than the bound of {needed}"
    );
    Ok(())
}

/// The used bytes of the stack: all from the lowest word that has lost its paint. `memory` is the
/// whole stack, lowest address first.
pub fn high_water(memory: &[u8]) -> u64 {
    let painted = memory.chunks(4).take_while(|word| *word == PAINT);
    (memory.len() - 4 * painted.count()) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A stack of these words, the lowest first.
    fn stack(words: &[u32]) -> Vec<u8> {
        words.iter().flat_map(|word| word.to_le_bytes()).collect()
    }

    const P: u32 = 0xcccc_cccc;

    #[test]
    fn finds_the_lowest_word_without_paint() {
        assert_eq!(high_water(&stack(&[P, P, 7, 8])), 8);
        assert_eq!(high_water(&stack(&[P, P, P, 0xcccc_cccd])), 4);
        assert_eq!(high_water(&stack(&[P, 0x00cc_cccc, P, P])), 12);
    }

    #[test]
    fn all_paint_is_nothing_used_and_no_paint_all_of_it() {
        assert_eq!(high_water(&stack(&[P; 4])), 0);
        assert_eq!(high_water(&stack(&[0; 4])), 16);
        assert_eq!(high_water(&[]), 0);
    }

    #[test]
    fn paint_above_used_words_counts_as_used() {
        assert_eq!(high_water(&stack(&[P, 1, P, P, 2])), 16);
    }
}
