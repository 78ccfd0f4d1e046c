//! Packets of histograms while the sensor measures.

use embedded_hal::digital::{ErrorType as PinErrorType, InputPin, OutputPin};
use embedded_hal::i2c::I2c;

use super::frame::{PACKET, Packet, Taken};
use super::registers::{CONFIG_RESULT, HISTOGRAM_INT, INT_STATUS, RESULT_INT};
use super::{Error, Result, State, Tmf882x, Waiting, bus_error, count};
use crate::timer::Since;
use crate::{PhotonSink, Polled};

impl<I2C, INT, EN, const CHUNK: usize> Tmf882x<'_, I2C, INT, EN, CHUNK>
where
    I2C: I2c,
    INT: InputPin,
    EN: OutputPin + PinErrorType<Error = INT::Error>,
{
    /// Sees whether a packet came, and takes it.
    pub(super) fn serve(
        &mut self,
        since: Since,
        stuck: u8,
        now_ms: u32,
        sink: &mut impl PhotonSink,
    ) -> Result<Polled, I2C, INT> {
        let settings = self.config.settings();
        let silent = since.is_over(settings.data_timeout_ms, now_ms);
        if self.interrupt.is_high().map_err(Error::Pin)? {
            if silent {
                return Err(Error::Timeout(Waiting::Histogram));
            }
            self.state = State::Measuring { since, stuck: 0 };
            return Ok(Polled::Idle);
        }
        let limit = settings.stuck_limit;
        let [status] = self.read_register(INT_STATUS)?;
        let reasons = status & (RESULT_INT | HISTOGRAM_INT);
        if reasons & HISTOGRAM_INT == 0 {
            // A result now and then is no reason to worry; more in a row are.
            let stuck = stuck.saturating_add(1);
            if stuck >= limit {
                return Err(Error::StuckInterrupt { status });
            }
            if silent {
                return Err(Error::Timeout(Waiting::Histogram));
            }
            self.state = State::Measuring { since, stuck };
            if reasons == 0 {
                return Ok(Polled::Idle);
            }
            self.write(&[INT_STATUS, reasons])?;
            return Ok(Polled::Working);
        }
        self.write(&[INT_STATUS, reasons])?;
        let taken = self.take_packet(sink)?;
        if taken != Polled::Idle || !silent {
            let since = if taken == Polled::Idle {
                since
            } else {
                Since::new(now_ms)
            };
            self.state = State::Measuring { since, stuck: 0 };
            return Ok(taken);
        }
        Err(Error::Timeout(Waiting::Histogram))
    }

    /// Reads a packet. [`Polled::Idle`] if it is left out.
    fn take_packet(&mut self, sink: &mut impl PhotonSink) -> Result<Polled, I2C, INT> {
        let mut bytes = [0; PACKET];
        let mut register = CONFIG_RESULT;
        for chunk in bytes.chunks_mut(CHUNK) {
            self.i2c
                .write_read(self.address, &[register], chunk)
                .map_err(bus_error)?;
            // 0x20 + 135 bytes end at 0xA7.
            register += u8::try_from(chunk.len()).unwrap_or(0);
        }
        let packet = Packet::of(&bytes).inspect_err(|_| self.assembly.restart())?;
        count(&mut self.counts.packets);
        if packet.number == 0 {
            sink.begin_frame(self.config.pulses());
        }
        match self.assembly.take(packet)? {
            Taken::Histogram { channel, counts } => {
                let Some(pixel) = self.config.pixel(channel) else {
                    return Ok(Polled::Working);
                };
                sink.histogram(pixel, &counts);
                count(&mut self.counts.histograms);
                Ok(Polled::Data)
            }
            Taken::Part => Ok(Polled::Working),
            Taken::LeftOut => {
                count(&mut self.counts.left_out);
                Ok(Polled::Idle)
            }
        }
    }
}
