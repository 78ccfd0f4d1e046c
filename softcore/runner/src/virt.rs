//! QEMU's machine `virt`, with as much of the instruction set as an image is for.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use anyhow::Result;

use crate::program::{self, ProgramRun};

/// Long enough to see that a loop has no end.
const A_MOMENT: Duration = Duration::from_secs(1);

/// Runs an image until it ends, or a moment longer than it takes to print a line, after which
/// no end is expected. What the instruction set has not is an illegal instruction.
pub fn run(image: &Path, isa: &str, last_line: Option<&str>) -> Result<ProgramRun> {
    let letters = isa.trim_start_matches("rv32");
    let mut processor =
        "rv32,a=false,f=false,d=false,zba=false,zbb=false,zbc=false,zbs=false".to_owned();
    for letter in ["m", "c"] {
        if !letters.contains(letter) {
            processor.push_str(&format!(",{letter}=false"));
        }
    }
    let mut qemu = Command::new("qemu-system-riscv32");
    qemu.args(["-machine", "virt", "-cpu", &processor, "-bios", "none"]);
    qemu.args(["-display", "none", "-monitor", "none", "-serial", "stdio"]);
    qemu.arg("-kernel").arg(image);
    program::run(&mut qemu, last_line.map(|line| (line, A_MOMENT)))
}
