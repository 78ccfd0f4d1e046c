//! The request of each state.

use super::frame::HEADER;
use super::registers::{
    APPID, BootCommand, CMD_STAT, Command, ENABLE, FIFO, FIFO_STATUS, FP_MODE, FRAME_INT,
    HISTOGRAMS_ON, I2C_ADDRESS, ID, INT_STATUS, ON_FROM_RAM, PAGE, PERIOD, POFF, PON,
    RESULT_FORMAT,
};
use super::{BOOT_MS, BUFFER, RESET_MS, START_MS, State, Tmf8829Protocol};
use crate::Polled;
use crate::protocol::Request;

/// Where an image is loaded.
const LOAD_ADDRESS: [u8; 4] = 0x0001_0000u32.to_le_bytes();

/// The block of the configuration with the address. It is skipped if the preset's address is right.
pub(super) const ADDRESS_BLOCK: u8 = 3;
/// The command that applies the configuration.
pub(super) const LAST_BLOCK: u8 = 5;

impl<const CHUNK: usize> Tmf8829Protocol<'_, CHUNK> {
    // Inlined into a main loop, its jump table would have backward branches, which `xtask sizes`
    // does not follow.
    #[inline(never)]
    pub(super) fn next_request(&mut self, now_ms: u32) -> Request<'_> {
        match self.state {
            State::Off { reset } => Request::Enable(!reset),
            State::Resetting if !self.watch.is_over(RESET_MS, now_ms) => {
                Request::Nothing(Polled::Idle)
            }
            State::Resetting => Request::Enable(true),
            State::Starting if !self.watch.is_over(START_MS, now_ms) => {
                Request::Nothing(Polled::Idle)
            }
            State::Starting | State::Waking => self.read(ENABLE, 1),
            State::SwitchingOn { enable } => self.write(&[ENABLE, enable & !POFF | PON]),
            State::Identifying => self.read(ID, 1),
            State::Booting if !self.watch.is_over(BOOT_MS, now_ms) => {
                Request::Nothing(Polled::Idle)
            }
            State::Looking | State::Booting => self.read(APPID, 1),
            State::BootCommanding(BootCommand::Upload) => {
                let words = self.image.len().div_ceil(4);
                // At most 0x1000.
                let [low, high] = u16::try_from(words).unwrap_or(u16::MAX).to_le_bytes();
                let [a, b, c, d] = LOAD_ADDRESS;
                let upload = BootCommand::Upload as u8;
                self.write(&[CMD_STAT, upload, 6, a, b, c, d, low, high])
            }
            State::BootCommanding(command) => self.write(&[CMD_STAT, command as u8]),
            State::BootCommanded(_) | State::Uploaded | State::Commanded(_) => {
                self.read(CMD_STAT, 1)
            }
            State::Uploading { sent } => self.upload(usize::from(sent)),
            State::Keeping => self.write(&[ENABLE, ON_FROM_RAM]),
            State::Commanding(command) => {
                // Its answer may be lost.
                self.may_measure |= command == Command::Measure;
                self.write(&[CMD_STAT, command.code()])
            }
            State::Paging => self.read(PAGE, 1),
            State::Configuring(block) => self.configure(block),
            State::Measuring => Request::Interrupt,
            State::Asking => self.read(INT_STATUS, 1),
            State::Clearing { reasons } => self.write(&[INT_STATUS, reasons]),
            State::Beginning => self.read(FIFO_STATUS, HEADER),
            State::Reading => {
                let left = usize::from(self.stream.left());
                self.read(FIFO, left.min(CHUNK))
            }
        }
    }

    pub(super) fn stop_request(&mut self) -> Request<'_> {
        self.write(&[CMD_STAT, Command::Stop.code()])
    }

    fn configure(&mut self, block: u8) -> Request<'_> {
        let settings = *self.config.settings();
        let [period_l, period_h] = settings.period_ms.to_le_bytes();
        let [pulses_l, pulses_h] = settings.kilo_iterations.to_le_bytes();
        match block {
            0 => self.write(&[PERIOD, period_l, period_h, pulses_l, pulses_h]),
            1 => self.write(&[FP_MODE, settings.zones.mode()]),
            2 => self.write(&[RESULT_FORMAT, settings.results.format(), HISTOGRAMS_ON]),
            ADDRESS_BLOCK => self.write(&[I2C_ADDRESS, settings.interface.address() << 1]),
            4 => self.write(&[INT_STATUS, 0xFF, FRAME_INT]),
            _ => self.write(&[CMD_STAT, Command::WritePage.code()]),
        }
    }

    /// The next bytes of the image, and zeros up to a whole word.
    fn upload(&mut self, sent: usize) -> Request<'_> {
        let rest = self.image.get(sent..).unwrap_or_default();
        let chunk = rest.get(..CHUNK).unwrap_or(rest);
        let length = 1 + chunk.len().next_multiple_of(4);
        self.buffer = [0; BUFFER];
        if let Some((register, data)) = self.buffer.split_first_mut() {
            *register = FIFO;
            data.iter_mut()
                .zip(chunk)
                .for_each(|(place, &byte)| *place = byte);
        }
        self.written(length)
    }

    fn write(&mut self, bytes: &[u8]) -> Request<'_> {
        let places = self.buffer.iter_mut();
        places.zip(bytes).for_each(|(place, &byte)| *place = byte);
        self.written(bytes.len())
    }

    fn written(&self, length: usize) -> Request<'_> {
        Request::Write {
            address: self.address,
            bytes: self.buffer.get(..length).unwrap_or_default(),
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
