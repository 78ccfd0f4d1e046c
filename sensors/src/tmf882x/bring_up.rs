//! The way up: from power to a measurement.

use embedded_hal::digital::{ErrorType as PinErrorType, InputPin, OutputPin};
use embedded_hal::i2c::I2c;

use super::bootloader::{MAX_DATA, Message, SEED};
use super::registers::{
    APPID, APPLICATION, BOOTLOADER, CHIP_ID, CHIP_ID_BITS, CMD_STAT, CONFIG_RESULT, CPU_READY,
    ENABLE, HIST_DUMP, HISTOGRAM_INT, I2C_ADDR_CHANGE, I2C_SLAVE_ADDRESS, ID, INT_ENAB, INT_STATUS,
    PERIOD_MS, PON, RAW_HISTOGRAMS, RESULT_INT, SPAD_MAP_ID,
};
use super::{BootCommand, Command, Error, Result, State, Tmf882x, Waiting};
use crate::Polled;
use crate::timer::Since;

impl<I2C, INT, EN, const CHUNK: usize> Tmf882x<'_, I2C, INT, EN, CHUNK>
where
    I2C: I2c,
    INT: InputPin,
    EN: OutputPin + PinErrorType<Error = INT::Error>,
{
    /// Waits for the processor, then sees what runs.
    pub(super) fn wake(&mut self, since: Since, now_ms: u32) -> Result<Polled, I2C, INT> {
        let [enable] = self.read_register(ENABLE)?;
        if enable & CPU_READY == 0 {
            if since.is_over(self.config.settings().command_timeout_ms, now_ms) {
                return Err(Error::Timeout(Waiting::PowerUp));
            }
            if enable & PON == 0 {
                self.write(&[ENABLE, enable | PON])?;
            }
            return Ok(Polled::Idle);
        }
        let [id] = self.read_register(ID)?;
        if id & CHIP_ID_BITS != CHIP_ID {
            return Err(Error::WrongChip { id });
        }
        let now = Since::new(now_ms);
        match self.read_register(APPID)? {
            // It may be measuring.
            [APPLICATION] => self.command(Command::Stop, now)?,
            [BOOTLOADER] if self.image.is_empty() => return Err(Error::NoImage),
            [BOOTLOADER] => self.load(BootCommand::DownloadInit, &[SEED], 0, now)?,
            [id] => return Err(Error::WrongApplication { id }),
        }
        Ok(Polled::Working)
    }

    /// The bootloader has done `command`, and `sent` bytes of the image are in
    /// RAM.
    pub(super) fn load_more(
        &mut self,
        command: BootCommand,
        sent: usize,
        now: Since,
    ) -> Result<(), I2C, INT> {
        if command == BootCommand::DownloadInit {
            return self.load(BootCommand::SetRamAddress, &[0, 0], sent, now);
        }
        let rest = self.image.get(sent..).unwrap_or_default();
        if let Some(chunk) = rest.chunks(CHUNK.min(MAX_DATA)).next() {
            return self.load(BootCommand::WriteRam, chunk, sent + chunk.len(), now);
        }
        // It does not answer this one: the application does.
        self.load(BootCommand::RamRemapReset, &[], sent, now)?;
        self.state = State::Booting { since: now };
        Ok(())
    }

    fn load(
        &mut self,
        command: BootCommand,
        data: &[u8],
        sent: usize,
        since: Since,
    ) -> Result<(), I2C, INT> {
        self.write(Message::new(command, data).bytes())?;
        self.state = State::Loading {
            since,
            command,
            sent,
        };
        Ok(())
    }

    /// The application has done `command`.
    pub(super) fn go_on_after(&mut self, command: Command, now: Since) -> Result<(), I2C, INT> {
        let wanted = self.config.settings().address;
        match command {
            Command::Stop => self.command(Command::LoadConfigPageCommon, now),
            Command::LoadConfigPageCommon => {
                self.configure()?;
                self.command(Command::WriteConfigPage, now)
            }
            Command::WriteConfigPage if self.address != wanted => {
                self.command(Command::I2cSlaveAddress, now)?;
                // Its status stands at the new address.
                self.address = wanted;
                Ok(())
            }
            Command::WriteConfigPage | Command::I2cSlaveAddress => {
                self.write(&[INT_STATUS, 0xFF])?;
                self.write(&[INT_ENAB, RESULT_INT | HISTOGRAM_INT])?;
                self.command(Command::Measure, now)
            }
            Command::Measure => {
                self.assembly.restart();
                self.state = State::Measuring {
                    since: now,
                    stuck: 0,
                };
                Ok(())
            }
        }
    }

    pub(super) fn command(&mut self, command: Command, since: Since) -> Result<(), I2C, INT> {
        self.write(&[CMD_STAT, command as u8])?;
        self.state = State::Commanded { since, command };
        Ok(())
    }

    /// Writes what is configured to the common configuration page.
    fn configure(&mut self) -> Result<(), I2C, INT> {
        let [page] = self.read_register(CONFIG_RESULT)?;
        if page != Command::LoadConfigPageCommon as u8 {
            return Err(Error::WrongPage { page });
        }
        let settings = *self.config.settings();
        let [period_l, period_h] = settings.period_ms.to_le_bytes();
        let [iterations_l, iterations_h] = settings.kilo_iterations.to_le_bytes();
        self.write(&[PERIOD_MS, period_l, period_h, iterations_l, iterations_h])?;
        self.write(&[SPAD_MAP_ID, settings.spad_map as u8])?;
        self.write(&[HIST_DUMP, RAW_HISTOGRAMS])?;
        if self.address != settings.address {
            self.write(&[I2C_SLAVE_ADDRESS, settings.address << 1])?;
            self.write(&[I2C_ADDR_CHANGE, 0])?;
        }
        Ok(())
    }
}
