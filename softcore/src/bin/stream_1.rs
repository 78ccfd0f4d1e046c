//! 1 macropixel, photons from the FIFO, events to the link.

#![no_std]
#![no_main]

#[cfg(not(target_arch = "riscv32"))]
compile_error!("an image for a soft-core: cargo softcore");

dtof_softcore::stream_program!(1);
