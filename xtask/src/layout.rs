//! Checks the stack of an image: an overflow must leave the RAM, and the handler of its fault must
//! reset the stack pointer.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use object::elf::SHF_ALLOC;
use object::read::elf::{ElfFile32, SectionHeader};
use object::{Endianness, Object, ObjectSection, ObjectSymbol, SectionKind};

/// The lowest address of the RAM of every board. An access below it is a fault.
pub const RAM: u64 = 0x2000_0000;

/// Fails unless the stack of an image is lowest in RAM, below all statics, and its hard fault
/// resets the stack pointer. An image that `drives_nothing` may have another hard fault.
pub fn check(image: &Path, drives_nothing: bool) -> Result<()> {
    let name = || image.display().to_string();
    let bytes = fs::read(image).with_context(name)?;
    let file = ElfFile32::<Endianness>::parse(&*bytes).with_context(name)?;
    stack_is_lowest(&file).with_context(name)?;
    if drives_nothing {
        return Ok(());
    }
    fault_resets_stack(&file).with_context(name)
}

fn stack_is_lowest(file: &ElfFile32<'_>) -> Result<()> {
    let [end, start] = [address(file, "_stack_end")?, address(file, "_stack_start")?];
    ensure!(
        end == RAM && end < start,
        "the stack reaches from {start:#x} down to {end:#x}, not to the end of the RAM at {RAM:#x}"
    );
    let endian = file.endian();
    for section in file.elf_section_table().iter() {
        let first: u64 = section.sh_addr(endian).into();
        let size: u64 = section.sh_size(endian).into();
        let is_used = section.sh_flags(endian) & SHF_ALLOC != 0 && size > 0;
        ensure!(
            !is_used || first + size <= end || first >= start,
            "a section at {first:#x} lies in the stack, which starts at {start:#x}"
        );
    }
    Ok(())
}

/// The code of `HardFault` ends with the constants it loads, which must include the start of the
/// stack.
fn fault_resets_stack(file: &ElfFile32<'_>) -> Result<()> {
    let start = u32::try_from(address(file, "_stack_start")?)?;
    let fault = file.symbol_by_name("HardFault").context("no HardFault")?;
    let first = fault.address() & !1;
    let mut code = file
        .sections()
        .filter(|section| section.kind() == SectionKind::Text);
    let code = code.find_map(|section| section.data_range(first, fault.size()).ok()?);
    let mut words = code.context("no code of HardFault")?.windows(4);
    ensure!(
        words.any(|word| word == start.to_le_bytes()),
        "HardFault does not load `_stack_start`: it would push onto a full stack"
    );
    Ok(())
}

/// The address of a symbol.
fn address(file: &ElfFile32<'_>, name: &str) -> Result<u64> {
    let symbol = file.symbol_by_name(name);
    Ok(symbol
        .with_context(|| format!("no symbol {name}"))?
        .address())
}

#[cfg(test)]
mod tests {
    use std::env;
    use std::process::Command;

    use super::*;
    use crate::succeed;

    /// A static, and a hard fault that loads what the first of the symbols names.
    const SOURCE: &str = r#"
        #![no_std]
        #![no_main]
        #[unsafe(no_mangle)]
        static mut STATIC: [u32; 64] = [0; 64];
        core::arch::global_asm!(
            ".section .text.fault, \"ax\"", ".global HardFault", ".type HardFault,%function", ".thumb_func",
            "HardFault: ldr r1, =LOADED", "mov sp, r1", "b .", ".pool",
            ".size HardFault, . - HardFault",
        );
        #[panic_handler]
        fn panic(_: &core::panic::PanicInfo<'_>) -> ! { loop {} }
    "#;
    const SECTIONS: &str = "
        ENTRY(HardFault)
        SECTIONS { .text : { KEEP(*(.text .text.*)) } > FLASH  .bss (NOLOAD) : { KEEP(*(.bss .bss.*)) } > RAM }
    ";
    const BELOW: &str = "
        MEMORY { FLASH : ORIGIN = 0, LENGTH = 1K  RAM : ORIGIN = 0x20000400, LENGTH = 1K }
        _stack_end = 0x20000000; _stack_start = 0x20000400;
    ";
    /// The default layout of cortex-m-rt.
    const ABOVE: &str = "
        MEMORY { FLASH : ORIGIN = 0, LENGTH = 1K  RAM : ORIGIN = 0x20000000, LENGTH = 2K }
        _stack_end = ADDR(.bss) + SIZEOF(.bss); _stack_start = 0x20000800;
    ";
    /// A static in a stack that is large enough.
    const WITHIN: &str = "
        MEMORY { FLASH : ORIGIN = 0, LENGTH = 1K  RAM : ORIGIN = 0x20000200, LENGTH = 1K }
        _stack_end = 0x20000000; _stack_start = 0x20000400;
    ";

    /// Links an image with the memory, whose hard fault loads the address. Returns its problem.
    fn linked(name: &str, memory: &str, loaded: &str) -> Result<()> {
        let folder = env::temp_dir().join(format!("dtof-layout-{}-{name}", std::process::id()));
        fs::create_dir_all(&folder)?;
        let [source, script, image] =
            ["image.rs", "script.x", "image"].map(|name| folder.join(name));
        fs::write(&source, SOURCE.replace("LOADED", loaded))?;
        fs::write(&script, format!("{memory}{SECTIONS}"))?;
        let mut rustc = Command::new("rustc");
        rustc.args([
            "--edition=2024",
            "--target=thumbv7em-none-eabihf",
            "-Cpanic=abort",
            "-Copt-level=1",
        ]);
        rustc.arg(format!("-Clink-arg=-T{}", script.display()));
        rustc.arg("-o").args([&image, &source]);
        succeed(&mut rustc)?;
        let checked = check(&image, false);
        fs::remove_dir_all(folder)?;
        checked
    }

    #[track_caller]
    fn refused(name: &str, memory: &str, loaded: &str, why: &str) {
        let error = format!("{:#}", linked(name, memory, loaded).unwrap_err());
        assert!(error.contains(why), "{error}");
    }

    #[test]
    fn a_stack_below_the_statics_passes() {
        linked("below", BELOW, "_stack_start").unwrap();
    }

    #[test]
    fn a_stack_above_the_statics_or_around_them_fails() {
        refused("above", ABOVE, "_stack_start", "not to the end of the RAM");
        refused("within", WITHIN, "_stack_start", "lies in the stack");
    }

    #[test]
    fn a_hard_fault_on_the_full_stack_fails() {
        refused("fault", BELOW, "_stack_end", "does not load");
    }
}
