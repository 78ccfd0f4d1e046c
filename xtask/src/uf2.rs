//! Converts an image to UF2, the format in which a Pico takes files: <https://github.com/microsoft/uf2>.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Endianness, elf};

/// Bytes of flash per block: a flash page.
const PAGE: u32 = 256;
/// The family ID of the RP2040, and of programs for the Arm processors of the RP2350 in secure state.
pub const RP2040: u32 = 0xe48b_ff56;
pub const RP2350_ARM_S: u32 = 0xe48b_ff59;
/// Flag: the field after the sizes is the family ID.
const HAS_FAMILY: u32 = 0x2000;
const FLASH: std::ops::Range<u32> = 0x1000_0000..0x1100_0000;

/// Writes `IMAGE.uf2` beside an image, for a family of chips. Returns its path.
pub fn write(image: &Path, family: u32) -> Result<PathBuf> {
    let name = || image.display().to_string();
    let bytes = fs::read(image).with_context(name)?;
    let file = ElfFile32::<Endianness>::parse(&*bytes).with_context(name)?;
    let mut pages = BTreeMap::new();
    for header in file.elf_program_headers() {
        let endian = file.endian();
        let data = header.data(endian, &*bytes).ok().with_context(name)?;
        if header.p_type(endian) == elf::PT_LOAD {
            add(&mut pages, header.p_paddr(endian), data).with_context(name)?;
        }
    }
    let path = image.with_added_extension("uf2");
    fs::write(&path, blocks(&pages, family)?).with_context(|| path.display().to_string())?;
    Ok(path)
}

/// Copies bytes for an address of the flash into its pages.
fn add(pages: &mut BTreeMap<u32, [u8; PAGE as usize]>, address: u32, bytes: &[u8]) -> Result<()> {
    for (address, &byte) in (address..).zip(bytes) {
        ensure!(FLASH.contains(&address), "{address:#x} is not in the flash");
        let page = pages.entry(address / PAGE * PAGE).or_insert([0; _]);
        page[(address % PAGE) as usize] = byte;
    }
    Ok(())
}

/// A block of 512 bytes for each page.
fn blocks(pages: &BTreeMap<u32, [u8; PAGE as usize]>, family: u32) -> Result<Vec<u8>> {
    let count = u32::try_from(pages.len())?;
    let mut blocks = Vec::new();
    for (number, (&address, page)) in (0u32..).zip(pages) {
        let head = [
            0x0a32_4655,
            0x9e5d_5157,
            HAS_FAMILY,
            address,
            PAGE,
            number,
            count,
            family,
        ];
        blocks.extend(head.iter().flat_map(|word| word.to_le_bytes()));
        blocks.extend(page);
        blocks.resize(blocks.len().next_multiple_of(512) - 4, 0);
        blocks.extend(0x0ab1_6f30_u32.to_le_bytes());
    }
    Ok(blocks)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_lie_where_the_chip_looks_for_them() {
        let mut pages = BTreeMap::new();
        add(&mut pages, 0x1000_0000, &[1; 256]).unwrap();
        add(&mut pages, 0x1000_01fe, &[2, 3, 4]).unwrap();
        for family in [RP2040, RP2350_ARM_S] {
            let blocks = blocks(&pages, family).unwrap();
            assert_eq!(blocks[28..32], family.to_le_bytes());
        }
        let blocks = blocks(&pages, 0xe48b_ff59).unwrap();
        assert_eq!(blocks.len(), 3 * 512);
        let word = |at: usize| u32::from_le_bytes(blocks[at..at + 4].try_into().unwrap());
        for (number, block) in (0..3).zip((0..).step_by(512)) {
            let head = [0, 8, 12, 16, 20, 24, 28].map(|at| word(block + at));
            let address = 0x1000_0000 + 256 * number;
            let expected = [0x0a32_4655, 0x2000, address, 256, number, 3, 0xe48b_ff59];
            assert_eq!(head, expected);
            assert_eq!(word(block + 508), 0x0ab1_6f30);
        }
        assert_eq!(blocks[32..288], [1; 256]);
        assert_eq!(blocks[512 + 32 + 0xfd..512 + 32 + 0x101], [0, 2, 3, 0]);
        assert_eq!(blocks[1024 + 32..1024 + 34], [4, 0]);
    }

    #[test]
    fn what_is_not_in_flash_is_refused() {
        assert!(add(&mut BTreeMap::new(), 0x2000_0000, &[1]).is_err());
        assert!(add(&mut BTreeMap::new(), 0x10ff_ffff, &[1, 2]).is_err());
    }
}
