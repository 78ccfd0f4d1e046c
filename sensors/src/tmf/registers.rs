//! Registers and answers that have the same address and value on the TMF8820/21/28 and the
//! TMF8829, named as in their data sheets DS000693 and DS001140.

/// The I²C address after power-up.
pub(crate) const DEFAULT_ADDRESS: u8 = 0x41;

/// APPID: which program runs.
pub(crate) const APPID: u8 = 0x00;
/// APPID of the bootloader.
pub(crate) const BOOTLOADER: u8 = 0x80;

/// `CMD_STAT`: a command is written here with its parameters, in one transaction; its state is
/// read back.
pub(crate) const CMD_STAT: u8 = 0x08;
/// `CMD_STAT`: done.
pub(crate) const STAT_OK: u8 = 0x00;
/// `CMD_STAT`: accepted and going on, the answer to the command to measure.
pub(crate) const STAT_ACCEPTED: u8 = 0x01;
/// `CMD_STAT` from here on is a command that is not done yet; all between [`STAT_ACCEPTED`] and
/// this are errors.
pub(crate) const FIRST_COMMAND: u8 = 0x10;

/// Which page or result the registers from here on hold.
pub(crate) const PAGE: u8 = 0x20;

/// `INT_STATUS`: why the pin INT is low. Writing a 1 clears a bit.
pub(crate) const INT_STATUS: u8 = 0xE1;
/// `INT_ENAB`: which bits of `INT_STATUS` pull INT low.
pub(crate) const INT_ENAB: u8 = 0xE2;
/// ID: the chip's identification.
pub(crate) const ID: u8 = 0xE3;
