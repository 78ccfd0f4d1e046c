//! The golden vectors: `cargo softcore`.

#![no_std]
#![no_main]

use dtof_softcore::{golden, io::Printer, program};

fn run() -> bool {
    golden::run(golden::EXPECTED, &mut Printer) == Ok(true)
}

program!(run);
