//! The golden vectors: `cargo softcore`.

#![no_std]
#![no_main]

#[cfg(not(target_arch = "riscv32"))]
compile_error!("an image for a soft-core: cargo softcore");

use dtof_softcore::{golden, io::Printer, program};

fn run() -> bool {
    golden::run(golden::EXPECTED, &mut Printer) == Ok(true)
}

program!(run);
