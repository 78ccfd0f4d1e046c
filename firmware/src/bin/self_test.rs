//! Writes what `dtof-core` works out on this board, to be compared with
//! `firmware/self-test.out`: `cargo xtask self-test`.
//!
//! It writes plain text through semihosting, which the emulator prints and a
//! debugger can show as well, and needs nothing of the board but its memory (and what
//! a Pico boots with).

#![no_std]
#![no_main]

#[cfg(not(all(target_os = "none", feature = "board")))]
compile_error!("an image for a board: cargo xtask self-test");

use core::fmt;
use core::panic::PanicInfo;

use cortex_m_rt::entry;
use dtof_firmware::self_test;
use semihosting::process::ExitCode;
use semihosting::{io, println};

#[entry]
fn main() -> ! {
    let code = match io::stdout().map(|out| self_test::run(&mut Lines(out))) {
        Ok(Ok(())) => ExitCode::SUCCESS,
        _ => ExitCode::FAILURE,
    };
    code.exit_process()
}

/// The debugger's or emulator's standard output.
struct Lines(io::Stdout);

impl fmt::Write for Lines {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        io::Write::write_all(&mut self.0, text.as_bytes()).map_err(|_| fmt::Error)
    }
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    println!("{info}");
    ExitCode::FAILURE.exit_process()
}
