//! The linker scripts. Here, as flags in a configuration file vanish when RUSTFLAGS is set.

use std::path::Path;
use std::{env, fs};

fn main() {
    println!("cargo::rerun-if-changed=memory");
    let is_rp2040 = env::var_os("CARGO_FEATURE_RP2040").is_some();
    let memory = if is_rp2040 {
        "memory/rp2040.x"
    } else {
        "memory/an386.x"
    };
    let out = env::var("OUT_DIR").expect("cargo sets OUT_DIR");
    fs::copy(memory, Path::new(&out).join("memory.x")).expect("a file can be copied");
    println!("cargo::rustc-link-search={out}");
    for argument in ["--nmagic", "-Tlink.x"] {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
}
