//! Registers, commands and answers of the TMF8820/21/28, named as in the
//! vendor's published headers and the data sheet DS000693. `tmf::registers` has those that all
//! TMF sensors share.

pub(super) use crate::tmf::registers::*;

/// APPID of the measurement application in RAM.
pub(super) const APPLICATION: u8 = 0x03;

/// MODE: how many zones a TMF8828 has.
pub(super) const MODE: u8 = 0x10;
/// MODE: 8×8 zones.
pub(super) const MODE_8X8: u8 = 8;

/// `PERIOD_MS`, `KILO_ITERATIONS`, 16 bits each, least significant byte first
/// (common configuration page).
pub(super) const PERIOD_MS: u8 = 0x24;
/// `SPAD_MAP_ID` (common configuration page).
pub(super) const SPAD_MAP_ID: u8 = 0x34;
/// `HIST_DUMP` (common configuration page).
pub(super) const HIST_DUMP: u8 = 0x39;
/// `HIST_DUMP` bit 0: give raw histograms away.
pub(super) const RAW_HISTOGRAMS: u8 = 1;
/// `I2C_SLAVE_ADDRESS`, in bits 7..1 (common configuration page).
pub(super) const I2C_SLAVE_ADDRESS: u8 = 0x3B;
/// `I2C_ADDR_CHANGE`: at which levels of the GPIOs the address changes; 0 is
/// always (common configuration page).
pub(super) const I2C_ADDR_CHANGE: u8 = 0x3E;

/// ENABLE.
pub(super) const ENABLE: u8 = 0xE0;
/// ENABLE bit 6: the processor is ready; no other register may be used before.
pub(super) const CPU_READY: u8 = 1 << 6;
/// ENABLE bit 0: powered on; 0 is standby.
pub(super) const PON: u8 = 1;

/// `INT_STATUS` bit 1: a measurement result stands ready.
pub(super) const RESULT_INT: u8 = 1 << 1;
/// `INT_STATUS` bit 3: a packet of a raw histogram stands ready.
pub(super) const HISTOGRAM_INT: u8 = 1 << 3;

/// The chip's identification.
pub(super) const CHIP_ID: u8 = 0x08;
/// Its bits in ID.
pub(super) const CHIP_ID_BITS: u8 = 0x3f;

/// A command of the measurement application.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
#[non_exhaustive]
pub enum Command {
    /// Measure until told to stop.
    Measure = 0x10,
    /// Take over the configuration page.
    WriteConfigPage = 0x15,
    /// Show the common configuration page.
    LoadConfigPageCommon = 0x16,
    /// Change the I²C address to that of the common configuration page.
    I2cSlaveAddress = 0x21,
    /// Have 8×8 zones, which a TMF8828 takes.
    Switch8x8 = 0x6C,
    /// Stop measuring.
    Stop = 0xFF,
}

impl Command {
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
    RamRemapReset = 0x11,
    /// Begin a download.
    DownloadInit = 0x14,
    /// Write to RAM and go on behind it.
    WriteRam = 0x41,
    /// Set the address in RAM.
    SetRamAddress = 0x43,
}
