//! What the simulation of the pixel processor is told, and what it tells: `sim/pixels.cpp`.

use std::io::{Read, Write};

use anyhow::{Context, Result, bail};
use dtof_core::pixel_processor::ProcessorSettings;
use dtof_core::{AerWord, PixelConfig};

/// What a clock brings to the pixel processor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Command {
    pub photon: Option<(u8, u16)>,
    pub cycle_ends: bool,
    /// The link takes a word, if one waits.
    pub link_takes: bool,
    pub reset: bool,
    /// An access to the registers, which begins once those before it have ended.
    pub access: Option<Access>,
}

/// An access to a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    Read(u32),
    Write(u32, u32),
}

impl Command {
    pub fn write(&self, to: &mut impl Write) -> std::io::Result<()> {
        let (pixel, code) = self.photon.unwrap_or_default();
        let bits = [
            self.photon.is_some(),
            self.cycle_ends,
            self.link_takes,
            self.access.is_some(),
            self.reset,
        ];
        let mut word = u32::from(code) | u32::from(pixel) << 16;
        for (place, bit) in (24..).zip(bits) {
            word |= u32::from(bit) << place;
        }
        to.write_all(&word.to_le_bytes())?;
        if let Some(access) = self.access {
            let (address, data) = match access {
                Access::Read(address) => (address, 0),
                Access::Write(address, data) => (address | 1 << 31, data),
            };
            to.write_all(&address.to_le_bytes())?;
            to.write_all(&data.to_le_bytes())?;
        }
        Ok(())
    }
}

/// What the simulation reports; each report comes with its clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Report {
    /// A look began.
    Look,
    /// The event of a macropixel left it.
    Leaves(u8),
    /// The link took a word.
    Word(AerWord),
    /// A register was read.
    Read(u32, u32),
    /// Nothing comes any more; whether a word waits.
    End(bool),
}

impl Report {
    /// Reads the next report and its clock.
    pub fn read(from: &mut impl Read) -> Result<(u64, Self)> {
        let mut bytes = [0; 24];
        let ended = "the simulation ends too soon";
        from.read_exact(&mut bytes).context(ended)?;
        let (words, _) = bytes.as_chunks::<4>();
        let mut parts = [0; 6];
        for (part, word) in parts.iter_mut().zip(words) {
            *part = u32::from_le_bytes(*word);
        }
        let [what, clock, one, other, ..] = parts;
        let report = match what {
            0 => Self::Look,
            1 => Self::Leaves(u8::try_from(one)?),
            2 => {
                let (_, word) = bytes.split_last_chunk().context("no word")?;
                Self::Word(AerWord::from_le_bytes(*word))
            }
            3 => Self::Read(one, other),
            4 => Self::End(one != 0),
            _ => bail!("the simulation tells {what}"),
        };
        Ok((clock.into(), report))
    }
}

/// The addresses of the registers.
pub mod register {
    pub const CONTROL: u32 = 0x00;
    pub const SIZE: u32 = 0x06;
    pub const WAITING: u32 = 0x08;
    pub const HISTOGRAM: u32 = 0x30;
    pub const BINS: u32 = 0x31;
    /// The last two bins of the eight.
    pub const LAST_BINS: u32 = 0x34;
    pub const COUNTS: u32 = 0x40;
    /// Registers of counts, two each.
    pub const COUNTS_LENGTH: u32 = 24;
}

/// What the registers from `CONTROL` to `SIZE` hold: settings, run, and who packs.
pub fn register_values(
    config: &PixelConfig<128>,
    packs: bool,
    pixels_log2: u32,
) -> Result<Vec<u32>> {
    let mut values = vec![1 | u32::from(packs) << 1];
    values.extend(ProcessorSettings::of(config)?.registers());
    values.push(1 << pixels_log2);
    Ok(values)
}

/// The accesses that configure the pixel processor so, from its reset on. Once it runs, what is
/// written changes nothing.
pub fn settings(register_values: &[u32]) -> Vec<Access> {
    let written = (register::CONTROL..register::SIZE).zip(register_values);
    let mut right: Vec<Access> = written
        .clone()
        .map(|(address, &data)| Access::Write(address, data))
        .collect();
    // `CONTROL` is the last: it starts.
    right.rotate_left(1);
    // It still runs.
    let wrong =
        written.map(|(address, &data)| Access::Write(address, !data | u32::from(address == 0)));
    let read_all = (register::CONTROL..=register::SIZE).map(Access::Read);
    right
        .into_iter()
        .chain(read_all.clone())
        .chain(wrong)
        .chain(read_all)
        .collect()
}
