//! The images of `softcore/`: built, and made what a testbench loads.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use object::elf::{SHF_ALLOC, SHF_WRITE, SHT_NOBITS};
use object::read::elf::{ElfFile32, SectionHeader};
use object::{Object, ObjectSegment};

use crate::{cargo, folder, target_folder};

const PROFILE: &str = "firmware";

/// Every program.
const PROGRAMS: [&str; 10] = [
    "self-test",
    "bench",
    "stream-1",
    "stream-4",
    "stream-64",
    "pixels-hardware",
    "pixels-program",
    "wrong-vector",
    "illegal-instruction",
    "endless-loop",
];

/// The images of one instruction set.
pub struct Images {
    folder: PathBuf,
}

impl Images {
    /// Builds them for `isa` (`rv32i`, say), for QEMU's `virt` or for the testbench.
    pub fn build(isa: &str, virt: bool) -> Result<Self> {
        let letters = isa.strip_prefix("rv").context("no RISC-V")?;
        let target = format!("riscv{letters}-unknown-none-elf");
        let target_folder = target_folder();
        let mut cargo = cargo();
        cargo.args(["build", "--locked", "--quiet", "--package", "dtof-softcore"]);
        cargo.args(["--bins", "--target", &target, "--profile", PROFILE]);
        cargo.args(["--features", if virt { "image,virt" } else { "image" }]);
        cargo.arg("--target-dir").arg(&target_folder);
        let status = cargo.status().context("cargo does not start")?;
        ensure!(status.success(), "the images do not build, see above");

        // The other machine's images would take their place.
        let machine = if virt { "virt" } else { "testbench" };
        let folder = folder(&format!("images/{machine}/{isa}"))?;
        for program in PROGRAMS {
            let built = target_folder.join(&target).join(PROFILE).join(program);
            let bytes = fs::read(&built).with_context(|| built.display().to_string())?;
            fs::write(folder.join(program), &bytes)?;
            if !virt {
                let flat = flat(&bytes).with_context(|| built.display().to_string())?;
                fs::write(folder.join(format!("{program}.hex")), hexadecimal(&flat))?;
                fs::write(folder.join(format!("{program}.bin")), flat)?;
            }
        }
        Ok(Self { folder })
    }

    /// The ELF file of a program.
    pub fn elf(&self, program: &str) -> PathBuf {
        self.folder.join(program)
    }

    /// The memory from address 0 on that a program is.
    pub fn flat(&self, program: &str) -> PathBuf {
        self.folder.join(format!("{program}.bin"))
    }

    /// The same as words, a line each, for the RAM of an FPGA.
    pub fn words(&self, program: &str) -> PathBuf {
        self.folder.join(format!("{program}.hex"))
    }

    /// Bytes a program takes.
    pub fn sizes(&self, program: &str) -> Result<Sizes> {
        let path = self.elf(program);
        Sizes::of(&fs::read(&path)?).with_context(|| path.display().to_string())
    }
}

/// Memory from address 0 on, as long as there is content.
fn flat(elf: &[u8]) -> Result<Vec<u8>> {
    let file = object::File::parse(elf)?;
    let mut memory = Vec::new();
    for segment in file.segments() {
        let content = segment.data()?;
        let start = usize::try_from(segment.address())?;
        ensure!(start <= 1 << 20, "content at {start:#x}");
        let end = start + content.len();
        if memory.len() < end {
            memory.resize(end, 0);
        }
        memory[start..end].copy_from_slice(content);
    }
    ensure!(!memory.is_empty(), "an empty image");
    Ok(memory)
}

/// A line a word, as `$readmemh` reads it.
fn hexadecimal(bytes: &[u8]) -> String {
    let words = bytes.chunks(4).map(|bytes| {
        let mut word = [0; 4];
        word[..bytes.len()].copy_from_slice(bytes);
        format!("{:08x}\n", u32::from_le_bytes(word))
    });
    words.collect()
}

/// Bytes of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Instructions and constants.
    pub code: u64,
    /// Variables, without the stack.
    pub data: u64,
}

impl Sizes {
    fn of(elf: &[u8]) -> Result<Self> {
        let file = ElfFile32::<object::Endianness>::parse(elf)?;
        let endian = file.endian();
        let mut sizes = Self::default();
        for section in file.elf_section_table().iter() {
            let flags = section.sh_flags(endian);
            let size = u64::from(section.sh_size(endian));
            if flags & SHF_ALLOC == 0 {
                continue;
            }
            if flags & SHF_WRITE != 0 || section.sh_type(endian) == SHT_NOBITS {
                sizes.data += size;
            } else {
                sizes.code += size;
            }
        }
        Ok(sizes)
    }
}
