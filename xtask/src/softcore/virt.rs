//! QEMU's machine `virt`, with as much of the instruction set as an image is for.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use anyhow::Result;

use super::program::{self, Ran};
use crate::tools::QEMU_RISCV;

/// Whatever ends, ends in a fraction of this.
pub const PATIENCE: Duration = Duration::from_secs(60);
/// Time enough to print a line.
pub const A_MOMENT: Duration = Duration::from_secs(5);

/// Runs an image, for so long. What the instruction set has not is an illegal instruction.
pub fn run(image: &Path, isa: &str, limit: Duration) -> Result<Ran> {
    QEMU_RISCV.require()?;
    let letters = isa.trim_start_matches("rv32");
    let mut processor = "rv32,a=false,f=false,d=false".to_owned();
    for letter in ["m", "c"] {
        if !letters.contains(letter) {
            processor.push_str(&format!(",{letter}=false"));
        }
    }
    let mut qemu = Command::new(QEMU_RISCV.program);
    qemu.args(["-machine", "virt", "-cpu", &processor, "-bios", "none"]);
    qemu.args(["-display", "none", "-monitor", "none", "-serial", "stdio"]);
    qemu.arg("-kernel").arg(image);
    program::run(&mut qemu, limit)
}
