//! A loop without end: the run must fail.

#![no_std]
#![no_main]

use dtof_softcore::{println, program};

fn run() -> bool {
    println!("an endless loop follows");
    #[allow(clippy::empty_loop, reason = "what this program is for")]
    loop {}
}

program!(run);
