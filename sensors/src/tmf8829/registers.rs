//! Registers, commands and answers of the TMF8829, named as in its data sheet DS001140 and in
//! the vendor's application note AN001096. `tmf::registers` has those that all TMF sensors share.

pub(super) use crate::tmf::registers::*;

/// APPID of the measurement application in RAM.
pub(super) const APPLICATION: u8 = 0x01;

/// `CMD_STAT` of the bootloader: words of the image are missing.
pub(super) const STAT_INCOMPLETE: u8 = 0x04;
/// Period in ms and iterations in 1,024, 16 bits each.
pub(super) const PERIOD: u8 = 0x22;
/// `fp_mode`: the zones.
pub(super) const FP_MODE: u8 = 0x26;
/// The format of results; behind it, whether histograms are given.
pub(super) const RESULT_FORMAT: u8 = 0x2A;
/// Histograms are given, and wait for the host.
pub(super) const HISTOGRAMS_ON: u8 = 1;
/// The I²C address in bits 7..1.
pub(super) const I2C_ADDRESS: u8 = 0x90;

/// `INT_STATUS`: a frame of results, or of histograms, stands ready.
pub(super) const FRAME_INT: u8 = 1 << 3 | 1;
/// The value of ID.
pub(super) const CHIP_ID: u8 = 0x9E;

/// ENABLE.
pub(super) const ENABLE: u8 = 0xF8;
/// ENABLE bit 7: the processor is ready.
pub(super) const CPU_READY: u8 = 1 << 7;
/// ENABLE bit 3: standby.
pub(super) const POFF: u8 = 1 << 3;
/// ENABLE bit 2: powered on.
pub(super) const PON: u8 = 1 << 2;
/// ENABLE bits 5..4: it wakes up with the program in RAM; with PON.
pub(super) const ON_FROM_RAM: u8 = 2 << 4 | PON;

/// FIFOSTATUS; behind it the systick, and the FIFO.
pub(super) const FIFO_STATUS: u8 = 0xFA;
/// FIFOSTATUS bit 5: data were lost.
pub(super) const OVERRUN: u8 = 1 << 5;
/// The FIFO, at which addresses stay.
pub(super) const FIFO: u8 = 0xFF;

/// A command of the measurement application.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Command {
    /// Measure until told to stop.
    Measure,
    /// Take over the configuration page.
    WritePage,
    /// Load the preset of this number.
    LoadPreset(u8),
    /// Stop measuring.
    Stop,
}

impl Command {
    pub(super) const fn code(self) -> u8 {
        match self {
            Self::Measure => 0x10,
            Self::WritePage => 0x15,
            Self::LoadPreset(code) => code,
            Self::Stop => 0xFF,
        }
    }

    /// The value of `CMD_STAT` when the command is done.
    pub(super) const fn done(self) -> u8 {
        match self {
            Self::Measure => STAT_ACCEPTED,
            _ => STAT_OK,
        }
    }
}

/// A command of the bootloader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
#[non_exhaustive]
pub enum BootCommand {
    /// Start the program in RAM.
    Start = 0x16,
    /// Switch SPI off.
    SpiOff = 0x20,
    /// Switch I²C and I3C off. SCL has to be high.
    I2cOff = 0x22,
    /// The program comes through the FIFO.
    Upload = 0x45,
}
