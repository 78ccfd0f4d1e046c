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
use dtof_firmware::board::LaserOff;
use dtof_firmware::self_test;
use heapless::Vec;
use semihosting::process::ExitCode;
use semihosting::{io, println};

#[entry]
fn main() -> ! {
    let lines = |out| {
        let line = Vec::new();
        self_test::run(&mut Lines { out, line })
    };
    let code = match io::stdout().map(lines) {
        Ok(Ok(())) => ExitCode::SUCCESS,
        _ => ExitCode::FAILURE,
    };
    code.exit_process()
}

/// The debugger's or emulator's standard output, a line at a time: each write halts the processor. Text after the last
/// end of a line is not written.
struct Lines {
    out: io::Stdout,
    /// The line so far.
    line: Vec<u8, 256>,
}

impl fmt::Write for Lines {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for byte in text.bytes() {
            // It is written when full.
            let _ = self.line.push(byte);
            if byte == b'\n' || self.line.is_full() {
                io::Write::write_all(&mut self.out, &self.line).map_err(|_| fmt::Error)?;
                self.line.clear();
            }
        }
        Ok(())
    }
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    println!("{info}");
    ExitCode::FAILURE.exit_process()
}

/// It has no laser. After a reset it would begin again.
struct Ends;

impl LaserOff for Ends {
    fn laser_off() {}

    fn end() -> ! {
        println!("hard fault");
        ExitCode::FAILURE.exit_process()
    }
}

dtof_firmware::hard_fault!(Ends);
