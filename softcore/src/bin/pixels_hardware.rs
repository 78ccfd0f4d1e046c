//! The pixel processor; its events packed by the hardware.

#![no_std]
#![no_main]

/// The program, which does not end.
fn run() -> bool {
    dtof_softcore::pixels::run(dtof_softcore::pixels::Packer::Hardware)
}

dtof_softcore::program!(run);
