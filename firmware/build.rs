//! What the linker needs for each image. It is said here and not in
//! `.cargo/config.toml`, whose rustflags vanish as soon as `RUSTFLAGS` is set.

use std::env;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=core-image.x");
    println!("cargo::rerun-if-changed=../memory.x");

    // The one target of a real board; elsewhere the linker's own layout does.
    if env::var("TARGET")? == "thumbv7em-none-eabihf" {
        let here = env::var("CARGO_MANIFEST_DIR")?;
        println!("cargo::rustc-link-arg-bin=core-image=-L{here}/..");
        println!("cargo::rustc-link-arg-bin=core-image=-T{here}/core-image.x");
    }
    Ok(())
}
