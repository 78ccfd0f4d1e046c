//! Raw histograms as they come: 30 packets for ten histograms.
//!
//! A packet is 135 bytes from `CONFIG_RESULT` on:
//!
//! | bytes | register | |
//! |---|---|---|
//! | 0 | 0x20 | result: 0x81, a packet of raw histograms |
//! | 1 | 0x21 | transaction, changes with each packet |
//! | 2, 3 | 0x22, 0x23 | bytes yet to come of the whole set |
//! | 4 | 0x24 | number of the packet |
//! | 5 | 0x25 | data bytes in the packet: 128 |
//! | 6 | 0x26 | which of the time-multiplexed measurements |
//! | 7..135 | 0x27.. | data |
//!
//! Packet n, 0 to 29, is one byte of each of the 128 counts of channel n mod 10:
//! the least significant ones in packets 0 to 9, the most significant ones in
//! packets 20 to 29. Channel 0 is the reference, 1 to 9 are the zones.

use super::DeviceError;

/// Bytes of a packet.
pub(super) const PACKET: usize = HEADER + BINS;
/// Bins of a histogram.
pub(super) const BINS: usize = 128;
/// Channels, the reference included.
pub(super) const CHANNELS: u8 = 10;
/// Packets of ten histograms.
pub(super) const PACKETS: u8 = 3 * CHANNELS;
const HEADER: usize = 7;
/// Byte 0 of a packet of raw histograms.
const RAW_HISTOGRAM: u8 = 0x81;
/// Byte 0 of a result.
pub(super) const RESULT: u8 = 0x10;

/// A packet of raw histograms.
#[derive(Clone, Copy, Debug)]
pub(super) struct Packet<'a> {
    pub(super) number: u8,
    data: &'a [u8],
}

impl<'a> Packet<'a> {
    /// With `is_captured`, packets of the second half have numbers from 30 on.
    ///
    /// # Errors
    /// Fails if the bytes are not a packet of raw histograms.
    pub(super) fn of(bytes: &'a [u8; PACKET], is_captured: bool) -> Result<Self, DeviceError> {
        let (&[result, _, _, _, mut number, size, half], data) = bytes
            .split_first_chunk::<HEADER>()
            .ok_or(DeviceError::WrongSize { size: 0 })?;
        if result != RAW_HISTOGRAM {
            return Err(DeviceError::ForeignResult { result });
        }
        if usize::from(size) != BINS {
            return Err(DeviceError::WrongSize { size });
        }
        if is_captured {
            number = match half {
                0 if number < PACKETS => number,
                1 if number < PACKETS => PACKETS + number,
                _ => u8::MAX,
            };
        }
        Ok(Self { number, data })
    }
}

/// Puts packets together to histograms. 2.5 KiB: two bytes of every count.
#[derive(Clone, Debug)]
pub(super) struct Assembly {
    low: [[u16; BINS]; CHANNELS as usize],
    next: Next,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Next {
    /// Packet 0; all others are dropped.
    Set,
    /// This packet, not the first.
    Packet(u8),
}

impl Assembly {
    pub(super) const fn new() -> Self {
        Self {
            low: [[0; BINS]; CHANNELS as usize],
            next: Next::Set,
        }
    }

    /// Waits for the next packet 0.
    pub(super) const fn restart(&mut self) {
        self.next = Next::Set;
    }

    /// Takes a packet of a set of `all`. Writes its histogram to `counts` once the most
    /// significant bytes are there.
    ///
    /// # Errors
    /// Returns [`DeviceError::OutOfOrder`] and drops the set. A packet 0 begins the next one.
    pub(super) fn take(
        &mut self,
        packet: Packet,
        all: u8,
        counts: &mut [u32; BINS],
    ) -> Result<Taken, DeviceError> {
        let found = packet.number;
        let result = match self.next {
            Next::Packet(expected) if found != expected => {
                Err(DeviceError::OutOfOrder { expected, found })
            }
            Next::Set if found >= all => Err(DeviceError::OutOfOrder { expected: 0, found }),
            Next::Set if found != 0 => Ok(Taken::LeftOut),
            Next::Set | Next::Packet(_) => Ok(Taken::Part),
        };
        if !matches!(result, Ok(Taken::Part)) && found != 0 {
            self.next = Next::Set;
            return result;
        }
        self.next = match found + 1 {
            next if next == all => Next::Set,
            next => Next::Packet(next),
        };
        let (plane, channel) = (found % PACKETS / CHANNELS, found % CHANNELS);
        let Some(low) = self.low.get_mut(usize::from(channel)) else {
            return result;
        };
        if plane < 2 {
            for (low, &byte) in low.iter_mut().zip(packet.data) {
                *low = match plane {
                    0 => byte.into(),
                    _ => *low | u16::from(byte) << 8,
                };
            }
            return result;
        }
        for ((count, &low), &byte) in counts.iter_mut().zip(&*low).zip(packet.data) {
            *count = u32::from(byte) << 16 | u32::from(low);
        }
        Ok(Taken::Histogram { channel })
    }
}

/// The use of a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Taken {
    /// It is not part of a set that began with packet 0.
    LeftOut,
    /// More of its histogram is yet to come.
    Part,
    /// It completed the histogram of this channel.
    Histogram { channel: u8 },
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every number and half: a number that no packet has is that of no set.
    #[test]
    fn packets_of_64_zones_are_numbered_through_both_halves() {
        for (sent, half) in
            (0..=u8::MAX).flat_map(|sent| (0..=u8::MAX).map(move |half| (sent, half)))
        {
            let mut bytes = [0; PACKET];
            bytes[..HEADER].copy_from_slice(&[RAW_HISTOGRAM, 0, 0, 0, sent, 128, half]);
            let number = |is_captured| Packet::of(&bytes, is_captured).map(|packet| packet.number);
            let expected = match (half, sent) {
                (0, 0..30) => sent,
                (1, 0..30) => sent + 30,
                _ => 255,
            };
            assert_eq!((number(true), number(false)), (Ok(expected), Ok(sent)));
        }
    }

    /// Only the packets of a set may be left out until the next set begins.
    #[test]
    fn a_number_that_no_set_has_is_out_of_order() {
        let take = |number: u8, all: u8| {
            let data = &[0; BINS];
            Assembly::new().take(Packet { number, data }, all, &mut [0; BINS])
        };
        for all in [PACKETS, 2 * PACKETS] {
            for found in 1..=u8::MAX {
                let expected = match found < all {
                    true => Ok(Taken::LeftOut),
                    false => Err(DeviceError::OutOfOrder { expected: 0, found }),
                };
                assert_eq!(take(found, all), expected);
            }
        }
    }
}
