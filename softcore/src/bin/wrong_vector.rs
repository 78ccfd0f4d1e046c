//! The golden vectors with one wrong bit among them: the run must fail.

#![no_std]
#![no_main]

use dtof_softcore::{golden, io::Printer, program};

/// A digit of the first word of the first stream is wrong.
const WRONG: [u8; golden::EXPECTED.len()] = {
    let mut wrong = [0; golden::EXPECTED.len()];
    wrong.copy_from_slice(golden::EXPECTED);
    wrong[195] ^= 1;
    wrong
};

fn run() -> bool {
    golden::run(&WRONG, &mut Printer) == Ok(true)
}

program!(run);
