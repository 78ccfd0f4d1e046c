//! The request of each state.

use super::bootloader::{MAX_DATA, Message, SEED};
use super::config::Zones;
use super::frame::PACKET;
use super::registers::{
    APPID, BootCommand, CMD_STAT, Command, ENABLE, HIST_DUMP, HISTOGRAM_INT, I2C_ADDR_CHANGE,
    I2C_SLAVE_ADDRESS, ID, INT_ENAB, INT_STATUS, MODE, PAGE, PERIOD_MS, PON, RAW_HISTOGRAMS,
    RESULT_INT, SPAD_MAP_ID,
};
use super::{BOOT_MS, RESET_MS, START_MS, State, Tmf882xProtocol};
use crate::Polled;
use crate::protocol::Request;

/// Blocks of the configuration page that are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Block {
    Period,
    Map,
    Histograms,
    Address,
    AddressChange,
}

impl<const CHUNK: usize> Tmf882xProtocol<'_, CHUNK> {
    // Inlined into a main loop, its jump table would have backward branches, which `xtask sizes`
    // does not follow.
    #[inline(never)]
    pub(super) fn next_request(&mut self, now_ms: u32) -> Request<'_> {
        match self.state {
            State::Off { reset } => Request::Enable(!reset),
            State::Resetting if self.watch.is_over(RESET_MS, now_ms) => Request::Enable(true),
            State::Starting if self.watch.is_over(START_MS, now_ms) => {
                self.watch.restart(now_ms);
                self.state = State::Waking;
                Request::Nothing(Polled::Working)
            }
            State::Resetting | State::Starting => Request::Nothing(Polled::Idle),
            State::Waking => self.read(ENABLE, 1),
            State::SwitchingOn { enable } => self.write(&[ENABLE, enable | PON]),
            State::Identifying => self.read(ID, 1),
            State::Looking => self.read(APPID, 1),
            State::Loading { command, sent } => self.load(command, sent),
            State::Loaded { .. } => self.read(CMD_STAT, 3),
            State::Booting if self.watch.is_over(BOOT_MS, now_ms) => self.read(APPID, 1),
            State::Booting => Request::Nothing(Polled::Idle),
            State::Commanding(command) => {
                // Its answer may be lost.
                self.may_measure |= command == Command::Measure;
                self.write(&[CMD_STAT, command as u8])
            }
            State::Commanded(_) => self.read(CMD_STAT, 1),
            State::Switched => self.read(MODE, 1),
            State::Paging => self.read(PAGE, 1),
            State::Configuring(block) => self.configure(block),
            State::Unmasking { cleared: false } => self.write(&[INT_STATUS, 0xFF]),
            State::Unmasking { cleared: true } => {
                self.write(&[INT_ENAB, RESULT_INT | HISTOGRAM_INT])
            }
            State::Measuring => Request::Interrupt,
            State::Asking => self.read(INT_STATUS, 1),
            State::Clearing { reasons } => self.write(&[INT_STATUS, reasons]),
            State::Reading { at } => {
                let end = PACKET.min(usize::from(at) + CHUNK);
                Request::Read {
                    address: self.address,
                    // 0x20 + 135 bytes end at 0xA7.
                    register: PAGE.saturating_add(at),
                    bytes: self.buffer.get_mut(at.into()..end).unwrap_or_default(),
                }
            }
        }
    }

    fn load(&mut self, command: BootCommand, sent: usize) -> Request<'_> {
        let rest = self.image.get(sent..).unwrap_or_default();
        let data: &[u8] = match command {
            BootCommand::DownloadInit => &[SEED],
            BootCommand::SetRamAddress => &[0, 0],
            BootCommand::WriteRam => rest.get(..CHUNK.min(MAX_DATA)).unwrap_or(rest),
            BootCommand::RamRemapReset => &[],
        };
        self.write(Message::new(command, data).bytes())
    }

    fn configure(&mut self, block: Block) -> Request<'_> {
        let settings = self.config.settings();
        let address = settings.address;
        let [period_l, period_h] = settings.period_ms.to_le_bytes();
        let [pulses_l, pulses_h] = settings.kilo_iterations.to_le_bytes();
        match block {
            Block::Period => self.write(&[PERIOD_MS, period_l, period_h, pulses_l, pulses_h]),
            Block::Map => match settings.zones {
                Zones::Nine(map) => self.write(&[SPAD_MAP_ID, map as u8]),
                // The vendor's values: distances and their confidence.
                Zones::SixtyFour => self.write(&[SPAD_MAP_ID, 15, 0x84]),
            },
            Block::Histograms => self.write(&[HIST_DUMP, RAW_HISTOGRAMS]),
            Block::Address => self.write(&[I2C_SLAVE_ADDRESS, address << 1]),
            Block::AddressChange => self.write(&[I2C_ADDR_CHANGE, 0]),
        }
    }

    pub(super) fn write(&mut self, bytes: &[u8]) -> Request<'_> {
        let places = self.buffer.iter_mut();
        places.zip(bytes).for_each(|(place, &byte)| *place = byte);
        Request::Write {
            address: self.address,
            bytes: self.buffer.get(..bytes.len()).unwrap_or_default(),
        }
    }

    fn read(&mut self, register: u8, length: usize) -> Request<'_> {
        Request::Read {
            address: self.address,
            register,
            bytes: self.buffer.get_mut(..length).unwrap_or_default(),
        }
    }
}
