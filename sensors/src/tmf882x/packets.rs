//! Packets of histograms while the sensor measures.

use super::answers::Next;
use super::config::Zones;
use super::frame::{BINS, PACKET, PACKETS, Packet, RESULT, Taken};
use super::registers::{HISTOGRAM_INT, RESULT_INT};
use super::{DeviceError, Error, State, Tmf882xProtocol, Waiting};
use crate::tmf::count;
use crate::{PhotonSink, Polled};

impl<const CHUNK: usize> Tmf882xProtocol<'_, CHUNK> {
    /// Takes a packet if one came.
    pub(super) fn serve<B, P>(
        &mut self,
        is_high: bool,
        now_ms: u32,
        sink: &mut impl PhotonSink,
    ) -> Next<B, P> {
        let limit = self.config.settings().data_timeout_ms;
        let is_silent = self.watch.is_over(limit, now_ms);
        let timeout = Err(Error::Timeout(Waiting::Data));
        match self.state {
            State::Asking => self.ask(is_silent),
            State::Clearing { reasons } if reasons & self.readable() == 0 => {
                self.state = State::Measuring;
                Ok(Some(Polled::Working))
            }
            State::Clearing { .. } => self.go_on_in(State::Reading { at: 0 }),
            State::Reading { at } => {
                let end = usize::from(at) + CHUNK;
                if end < PACKET {
                    let at = u8::try_from(end).unwrap_or(u8::MAX);
                    return self.go_on_in(State::Reading { at });
                }
                self.state = State::Measuring;
                let taken = self.take(sink)?;
                self.watch.clear_stuck();
                if taken != Polled::Idle {
                    self.watch.restart(now_ms);
                    self.has_given = true;
                } else if is_silent {
                    return timeout;
                }
                Ok(Some(taken))
            }
            _ if !is_high => self.go_on_in(State::Asking),
            _ if is_silent => timeout,
            _ => {
                self.watch.clear_stuck();
                Ok(Some(Polled::Idle))
            }
        }
    }

    /// The reasons of an interrupt whose data the driver reads.
    const fn readable(&self) -> u8 {
        match self.config.settings().zones {
            Zones::Nine(_) => HISTOGRAM_INT,
            Zones::SixtyFour => HISTOGRAM_INT | RESULT_INT,
        }
    }

    fn ask<B, P>(&mut self, is_silent: bool) -> Next<B, P> {
        let [status, ..] = self.buffer;
        let reasons = status & (RESULT_INT | HISTOGRAM_INT);
        if reasons & self.readable() == 0 {
            // A single result is harmless; many in a row are not.
            let limit = self.config.settings().stuck_limit;
            self.watch.check_stuck(limit, status)?;
            if is_silent {
                return Err(Error::Timeout(Waiting::Data));
            }
            if reasons == 0 {
                self.state = State::Measuring;
                return Ok(Some(Polled::Idle));
            }
        }
        self.go_on_in(State::Clearing { reasons })
    }

    /// Takes a packet, or with 64 zones a result. Returns [`Polled::Idle`] if it is dropped.
    fn take(&mut self, sink: &mut impl PhotonSink) -> Result<Polled, DeviceError> {
        let is_captured = self.config.settings().zones == Zones::SixtyFour;
        if is_captured && self.buffer.first() == Some(&RESULT) {
            self.assembly.restart();
            let first = self.config.settings().first_pixel;
            self.captures.end(&self.buffer, first, sink)?;
            return Ok(Polled::Working);
        }
        let packet = Packet::of(&self.buffer, is_captured);
        let packet = packet.inspect_err(|_| self.assembly.restart())?;
        count(&mut self.counts.packets);
        let lost = DeviceError::OutOfOrder {
            expected: 2 * PACKETS,
            found: 0,
        };
        let is_lost = is_captured && packet.number == 0 && self.captures.begin();
        if packet.number == 0 || (is_captured && packet.number == PACKETS) {
            sink.begin_frame(self.config.pulses());
        }
        let all = if is_captured { 2 * PACKETS } else { PACKETS };
        let half = packet.number / PACKETS;
        let mut counts = [0; BINS];
        match self.assembly.take(packet, all, &mut counts)? {
            Taken::Histogram { channel } => {
                let pixel = match channel.checked_sub(1) {
                    Some(zone) if is_captured => match self.captures.zone(half, zone) {
                        Some(zone) => self.config.pixel(zone),
                        // The zones are not known yet; or it is the last channel, which is empty.
                        None => {
                            self.counts.left_out =
                                self.counts.left_out.saturating_add(u32::from(zone < 8));
                            None
                        }
                    },
                    Some(zone) => self.config.pixel(zone),
                    None => self.config.settings().reference,
                };
                let Some(pixel) = pixel else {
                    return Ok(Polled::Working);
                };
                sink.histogram(pixel, &counts);
                count(&mut self.counts.histograms);
                Ok(Polled::Data)
            }
            Taken::Part if is_lost => Err(lost),
            Taken::Part => Ok(Polled::Working),
            Taken::LeftOut => {
                count(&mut self.counts.left_out);
                Ok(Polled::Idle)
            }
        }
    }
}
