//! `cargo xtask sizes`: flash, RAM and stack of each image.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use object::elf::{SHF_ALLOC, SHT_NOBITS};
use object::read::elf::{ElfFile32, SectionHeader};
use object::{Object, ObjectSymbol};

use crate::firmware::{Board, Build};
use crate::layout;

/// The macropixels and blocks that the sidecar has room for.
const MOST_PIXELS: u64 = 256;
const MOST_BLOCKS: u64 = 42;
/// Macropixels, and blocks: none, those of 8 x 8 and of 16 x 8 in two levels, all.
const ARRAYS: [(u64, u64); 7] = [
    (64, 0),
    (64, 20),
    (64, MOST_BLOCKS),
    (128, 0),
    (128, 40),
    (128, MOST_BLOCKS),
    (MOST_PIXELS, MOST_BLOCKS),
];
/// Bytes of RAM that each linker script reserves for the stack.
const STACK_RESERVE: u64 = 19 * 1024;
/// Bytes of the reserve that an image may need; the rest is for the report of a panic.
const MOST_STACK: u64 = 12 * 1024;

/// Builds and measures every image. The vendor's program of a TMF8820/21/28 is not included.
pub fn print(root: &Path) -> Result<()> {
    println!("{:<24} {:>8} {:>8} {:>8}", "image", "flash", "RAM", "stack");
    let mut of_pixels = None;
    for board in Board::ALL {
        let mut sidecars = vec![(format!("sidecar {}", board.name()), Build::Sidecar)];
        for &sensor in board.row().sensors {
            sidecars.push((format!("  with {}", sensor.name()), Build::With(sensor)));
        }
        for (name, what) in sidecars {
            let path = board.build_bare(root, what)?;
            let Sizes { flash, ram } = Sizes::read(&path)?;
            let stack = xtask::stack_bound::of_image(&path)?;
            println!("{name:<24} {flash:>8} {ram:>8} {stack:>8}");
            ensure!(
                stack <= MOST_STACK,
                "more than {MOST_STACK} bytes of stack needed"
            );
            let left =
                address(&path, "_stack_start")?.saturating_sub(address(&path, "_stack_end")?);
            ensure!(
                left == STACK_RESERVE,
                "its linker script gives the stack {left} bytes, not {STACK_RESERVE}"
            );
            if let Some(most) = board.row().most_ram.map(|all| all - STACK_RESERVE) {
                ensure!(ram <= most, "more than {most} bytes of RAM");
            }
            if let Some(most) = board.row().most_flash {
                let most = most[usize::from(what != Build::Sidecar)];
                ensure!(flash <= most, "more than {most} bytes of flash");
            }
            if (board, what) == (Board::Stm32F405, Build::Sidecar) {
                of_pixels = Some((ram, memory(&path, "PIXELS")?, memory(&path, "BLOCKS")?));
            }
        }
        let name = format!("self-test {}", board.name());
        let Sizes { flash, ram } = Sizes::read(&board.build_bare(root, Build::SelfTest)?)?;
        // It calls through function pointers, so its stack has no known bound.
        println!("{name:<24} {flash:>8} {ram:>8} {:>8}", "-");
    }
    println!(
        "bytes; RAM without the stack, which has {STACK_RESERVE}; of it the most that the machine"
    );
    println!("code can need, interrupts included, up to a panic");
    let (ram, pixels, blocks) = of_pixels.context("no image of the real board")?;
    let [pixel, block] = [pixels / MOST_PIXELS, blocks / MOST_BLOCKS];
    let others = ram - MOST_PIXELS * pixel - MOST_BLOCKS * block;
    println!("sidecar stm32f405: a macropixel of 128 bins {pixel} bytes, a block of them {block},");
    println!("whether they track or have several echoes or not");
    for (pixels, blocks) in ARRAYS {
        let ram = others + pixels * pixel + blocks * block;
        println!("{pixels:>4} macropixels, {blocks:>2} blocks {ram:>8} bytes of RAM");
    }
    Ok(())
}

/// The address of a symbol of an image.
fn address(path: &Path, name: &str) -> Result<u64> {
    let bytes = fs::read(path).with_context(|| path.display().to_string())?;
    let file = object::File::parse(&*bytes)?;
    let symbol = file.symbol_by_name(name);
    let symbol = symbol.with_context(|| format!("no symbol {name} in the image"))?;
    Ok(symbol.address())
}

/// The bytes of the sidecar's memory called `name`.
fn memory(path: &Path, name: &str) -> Result<u64> {
    let bytes = fs::read(path).with_context(|| path.display().to_string())?;
    let file = object::File::parse(&*bytes)?;
    // A table of the simulated scene has the same name.
    let named = file
        .symbols()
        .filter(|symbol| symbol.name().is_ok_and(|found| found.contains(name)));
    let sizes = named.map(|symbol| symbol.size());
    sizes
        .max()
        .with_context(|| format!("no memory {name} in the image"))
}

/// The sizes of an image in bytes.
#[derive(Default)]
pub struct Sizes {
    pub flash: u64,
    pub ram: u64,
}

impl Sizes {
    /// Reads an image.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = fs::read(path).with_context(|| path.display().to_string())?;
        let file = ElfFile32::<object::Endianness>::parse(&*bytes)
            .with_context(|| path.display().to_string())?;
        let endian = file.endian();
        let mut sizes = Self::default();
        for section in file.elf_section_table().iter() {
            if section.sh_flags(endian) & SHF_ALLOC != 0 {
                sizes.add(
                    section.sh_addr(endian).into(),
                    section.sh_size(endian).into(),
                    section.sh_type(endian) != SHT_NOBITS,
                );
            }
        }
        Ok(sizes)
    }

    /// A section at `address` when the image runs, which does or does not have
    /// content.
    fn add(&mut self, address: u64, size: u64, has_content: bool) {
        // No image uses other memory.
        let in_ram = address >= layout::RAM;
        if in_ram {
            self.ram += size;
        }
        if has_content {
            self.flash += size;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_takes_both_and_bss_only_ram() {
        let mut sizes = Sizes::default();
        sizes.add(0x0800_0000, 1, true); // .text
        sizes.add(0x2000_0000, 10, true); // .data, copied from flash
        sizes.add(0x2000_000a, 100, false); // .bss
        sizes.add(0x1000_0100, 1000, true); // .text of another board
        assert_eq!((sizes.flash, sizes.ram), (1011, 110));
    }
}
