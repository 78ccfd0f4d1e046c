//! The linker scripts. Here, as flags in a configuration file vanish when RUSTFLAGS is set.

fn main() {
    println!("cargo::rerun-if-changed=memory.x");
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
}
