//! How many instructions the operations of `dtof-core` take:
//! `cargo xtask bench`, and `docs/results/bench/README.md` for what is counted.
//!
//! The emulator counts instructions. On a board (feature `stm32f405`) the same
//! lines hold clock cycles; a debugger shows them. That has not been tried.

#![no_std]
#![no_main]

#[cfg(not(all(target_os = "none", feature = "board")))]
compile_error!("an image for a board: cargo xtask bench");

// What the board boots with, and its interrupts. Elsewhere the library is left out:
// optimised for size, the compiler would take generic functions from it and count them.
#[cfg(feature = "pico")]
use dtof_firmware as _;

mod arrays;
mod counter;
mod decisions;
mod further;
mod looks;
mod operations;
mod products;
mod report;
mod roots;
mod scene;
mod ways;
mod windows;

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, entry, exception};
use semihosting::println;
use semihosting::process::ExitCode;

use counter::Counter;
use scene::State;

#[entry]
fn main() -> ! {
    let Some(mut state) = State::new() else {
        println!("the configuration is refused");
        ExitCode::FAILURE.exit_process()
    };
    let Some(counter) = Counter::start(&mut state) else {
        println!("the counter does not count instructions: see `cargo xtask bench`");
        ExitCode::FAILURE.exit_process()
    };
    operations::run(&counter, &mut state);
    decisions::run(&counter, &mut state);
    windows::run(&counter, &mut state);
    products::run(&counter, &mut state);
    roots::run(&counter, &mut state);
    if !arrays::run(&counter, &mut state) {
        println!("arrays were not counted");
        ExitCode::FAILURE.exit_process()
    }
    if !looks::run(&counter, &mut state) {
        println!("tracking and echoes were not counted");
        ExitCode::FAILURE.exit_process()
    }
    ExitCode::SUCCESS.exit_process()
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    println!("{info}");
    ExitCode::FAILURE.exit_process()
}

#[allow(unsafe_code, reason = "the attribute asks for it")]
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    println!("hard fault at {:#010x}", frame.pc());
    ExitCode::FAILURE.exit_process()
}
