//! The records of a device's sensor and of its errors.

use dtof_core::fixed::types::{I24F8, U16F16};

use crate::numbered::numbered;

/// A sensor, as the device describes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SensorRecord {
    /// The number of pixels; their addresses begin at 0.
    pub pixels: u16,
    /// The width of its bins in picoseconds; `None` if the configuration sets it.
    pub bin_width: Option<U16F16>,
    /// The range of the start of bin 0 in millimetres, if it is known, else 0.
    pub offset: I24F8,
    /// Laser cycles a second in thousandths, 0 if that is not known.
    pub laser_millihertz: u64,
    /// Bins that can hold photons. Those after them are not measured.
    pub bins: u16,
    /// Bins for which its TDC is blind after a photon; `u16::MAX` if it takes only the first photon
    /// of a laser cycle, 0 if there is none or it is unknown.
    pub dead_time: u16,
    /// The largest range of the laser's dither, in bins; 0 if it cannot.
    pub most_dither: u8,
}

impl SensorRecord {
    /// Bytes of the record.
    pub const BYTES: usize = 24;

    /// The record as bytes, with the width of the counters of the device's pixels. A device without a
    /// sensor sends one without pixels.
    #[must_use]
    pub fn to_le_bytes(sensor: Option<&Self>, counter_bits: u8) -> [u8; Self::BYTES] {
        // Devices of 10 bits have always sent 0.
        let counter_bits = if counter_bits == 10 { 0 } else { counter_bits };
        let mut bytes = [0; Self::BYTES];
        let Some(sensor) = sensor else {
            bytes[Self::BYTES - 2] = counter_bits;
            return bytes;
        };
        let [a, b] = sensor.pixels.to_le_bytes();
        let [c, d, e, f] = sensor.bin_width.unwrap_or_default().to_le_bytes();
        let [g, h, i, j] = sensor.offset.to_le_bytes();
        let rate = sensor.laser_millihertz.to_le_bytes();
        let fields = [a, b, c, d, e, f, g, h, i, j].into_iter().chain(rate);
        let fields = fields.chain(sensor.bins.to_le_bytes());
        let fields = fields.chain(sensor.dead_time.to_le_bytes());
        let fields = fields.chain([counter_bits, sensor.most_dither]);
        for (place, byte) in bytes.iter_mut().zip(fields) {
            *place = byte;
        }
        bytes
    }

    /// Reads the record, and the width of the counters: no record if the device has no sensor, `None`
    /// if the length is wrong or the width unknown.
    #[must_use]
    pub fn from_le_bytes(bytes: &[u8]) -> Option<(Option<Self>, u8)> {
        let bytes: &[u8; Self::BYTES] = bytes.try_into().ok()?;
        let (&[a, b, c, d, e, f, g, h, i, j], rest) = bytes.split_first_chunk()?;
        let (&rate, rest) = rest.split_first_chunk()?;
        let (&bins, rest) = rest.split_first_chunk()?;
        let (&dead_time, rest) = rest.split_first_chunk()?;
        let &[counter_bits, most_dither] = rest else {
            return None;
        };
        let counter_bits = match counter_bits {
            0 | 10 => 10,
            8 => 8,
            _ => return None,
        };
        let pixels = u16::from_le_bytes([a, b]);
        let bin_width = U16F16::from_le_bytes([c, d, e, f]);
        let sensor = (pixels > 0).then_some(Self {
            pixels,
            bin_width: (bin_width > 0).then_some(bin_width),
            offset: I24F8::from_le_bytes([g, h, i, j]),
            laser_millihertz: u64::from_le_bytes(rate),
            bins: u16::from_le_bytes(bins),
            dead_time: u16::from_le_bytes(dead_time),
            most_dither,
        });
        Some((sensor, counter_bits))
    }
}

numbered! {
    /// The kind of a sensor's error. The drivers' own errors have more detail; each has one
    /// of these kinds.
    FaultRecord {
        /// No chip answers on the bus: unplugged, without power, or at another address.
        NoAnswer = 1: "no answer",
        /// Another error of the bus.
        Bus = 2: "bus error",
        /// A pin failed.
        Pin = 3: "pin error",
        /// The driver is for another chip, or for another program on it.
        WrongChip = 4: "wrong chip or program",
        /// The sensor rejects a command or a setting, or never completes it.
        Rejected = 5: "command or setting not taken",
        /// No data in time: the laser or its START signal is missing, or the sensor is
        /// unplugged.
        Timeout = 6: "no data in time",
        /// The interrupt pin stays active, and the sensor reports no reason.
        StuckInterrupt = 7: "stuck interrupt",
        /// The sensor needs its program, and the firmware has none.
        NoImage = 8: "no image to load",
        /// Impossible data, which are dropped.
        Data = 9: "damaged data",
    }
}
