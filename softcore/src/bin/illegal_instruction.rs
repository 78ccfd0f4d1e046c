//! An illegal instruction: the run must fail.

#![no_std]
#![no_main]

use core::arch::asm;

use dtof_softcore::{println, program};

#[allow(unsafe_code, reason = "no function is an illegal instruction")]
fn run() -> bool {
    println!("an illegal instruction follows");
    // SAFETY: the trap handler does not come back.
    unsafe {
        // All bits zero is illegal with and without compressed instructions.
        asm!(".balign 4", ".word 0");
    }
    // A processor that does not know its instructions apart comes here.
    println!("the illegal instruction was carried out");
    false
}

program!(run);
