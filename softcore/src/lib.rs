//! The parts that bare programs on an RV32 soft-core need: the start, the trap handler, the
//! registers of the testbench or of QEMU's `virt`, and the programs' parts.
//!
//! The programs are in `src/bin`; `cargo softcore` builds and runs them, and
//! `docs/softcore.md` lists the parts to reuse in a design of your own.

#![no_std]

#[cfg(all(feature = "image", not(target_arch = "riscv32")))]
compile_error!("images are for soft-cores: cargo softcore");

#[cfg(test)]
extern crate std;

#[cfg(target_arch = "riscv32")]
#[allow(unsafe_code, reason = "caches are behind the language's back")]
pub mod cache;
pub mod golden;
#[cfg_attr(feature = "virt", path = "io_virt.rs")]
pub mod io;
pub mod pixels;
#[cfg(target_arch = "riscv32")]
#[allow(unsafe_code, reason = "nothing is there yet that could be safe")]
mod start;
pub mod stream;
pub mod word;

/// Makes a function without arguments, which returns whether it succeeded, what the
/// image runs.
#[macro_export]
macro_rules! program {
    ($run:path) => {
        #[allow(unsafe_code, reason = "the start calls it by this name")]
        #[unsafe(no_mangle)]
        extern "C" fn softcore_program() -> bool {
            $run()
        }
    };
}

/// Prints one line.
#[macro_export]
macro_rules! println {
    ($($part:tt)*) => {{
        // Printing cannot fail.
        let _ = ::core::fmt::Write::write_fmt(
            &mut $crate::io::Printer,
            ::core::format_args!("{}\n", ::core::format_args!($($part)*)),
        );
    }};
}
