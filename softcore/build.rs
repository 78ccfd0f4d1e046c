//! Where the images go. It is said here and not in `.cargo/config.toml`, whose
//! rustflags vanish as soon as `RUSTFLAGS` is set.

use std::env;
use std::error::Error;
use std::fs;
use std::path::Path;

/// 64 KiB from address 0 on.
const SYSTEM_RAM: u32 = 64 << 10;

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=image.x");
    println!("cargo::rerun-if-changed=memory");

    if env::var("CARGO_CFG_TARGET_ARCH")? != "riscv32" {
        return Ok(());
    }
    let here = env::var("CARGO_MANIFEST_DIR")?;
    let virt = env::var_os("CARGO_FEATURE_VIRT").is_some();
    let memory = if virt { "virt.x" } else { "testbench.x" };
    // The linker looks for `memory.x` in the folder it is started in before all
    // others, and there it finds that of a board.
    let map = fs::read_to_string(Path::new(&here).join("memory").join(memory))?;
    let layout = fs::read_to_string(Path::new(&here).join("image.x"))?;
    let script = Path::new(&env::var("OUT_DIR")?).join("image.x");
    fs::write(&script, layout.replace("INCLUDE memory.x", &map))?;
    println!("cargo::rustc-link-arg-bins=-T{}", script.display());
    // Sections start where the one before ends, not at the next page.
    println!("cargo::rustc-link-arg-bins=--nmagic");
    // `rtl/system.v` has less RAM than the testbench.
    for bin in ["pixels-hardware", "pixels-program"]
        .iter()
        .filter(|_| !virt)
    {
        println!("cargo::rustc-link-arg-bin={bin}=--defsym=_ram_end={SYSTEM_RAM:#x}");
    }
    Ok(())
}
