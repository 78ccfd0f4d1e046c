//! The laser pulses of an image for the photon timer, read from the image.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use object::{Object, ObjectSection, ObjectSymbol};

/// A symbol of the image: its clock in Hz, the clocks per laser cycle and the clocks per laser
/// pulse.
const SYMBOL: &str = "LASER_CLOCKS";

/// Pulses of a laser.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Laser {
    clock_hz: u64,
    period: u64,
    pulse: u64,
}

impl Laser {
    /// The laser pulses of an image; `None` if it does not drive a laser.
    pub fn read(image: &Path) -> Result<Option<Self>> {
        let name = || image.display().to_string();
        let bytes = fs::read(image).with_context(name)?;
        let file = object::File::parse(&*bytes).with_context(name)?;
        let Some(symbol) = file.symbol_by_name(SYMBOL) else {
            return Ok(None);
        };
        let section = symbol.section_index().with_context(name)?;
        let section = file.section_by_index(section).with_context(name)?;
        let words = section.data_range(symbol.address(), symbol.size());
        let words = words.with_context(name)?.with_context(name)?;
        Ok(Some(Self::from_bytes(words).with_context(name)?))
    }

    fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let (words, rest) = bytes.as_chunks();
        let words = words.iter().map(|word| u32::from_le_bytes(*word).into());
        let words: Vec<u64> = words.collect();
        let (&[clock_hz, period, pulse], []) = (&*words, rest) else {
            anyhow::bail!("{SYMBOL} has not three words");
        };
        ensure!(
            clock_hz > 0 && period > 0,
            "{SYMBOL}: a laser without a rate"
        );
        Ok(Self {
            clock_hz,
            period,
            pulse,
        })
    }

    /// Length of the pulse.
    fn nanoseconds(self) -> String {
        decimal(self.pulse * 1_000_000_000, self.clock_hz, 3, true)
    }

    /// Pulse rate.
    fn kilohertz(self) -> String {
        decimal(self.clock_hz, self.period * 1000, 3, false)
    }

    /// Share of the time that the laser is on.
    fn percent(self) -> String {
        decimal(self.pulse * 100, self.period, 2, false)
    }

    /// As a part of a file name.
    pub fn file_name(self) -> String {
        let [ns, khz, percent] = [self.nanoseconds(), self.kilohertz(), self.percent()];
        format!("{ns}ns+{khz}kHz+{percent}pct")
    }

    /// As text. Peak power in watts times the pulse length in nanoseconds is the energy in
    /// nanojoules; times the duty cycle it is the average power.
    pub fn text(self) -> String {
        let [ns, khz, percent] = [self.nanoseconds(), self.kilohertz(), self.percent()];
        let milliwatts = decimal(self.pulse * 1000, self.period, 2, false);
        format!(
            "laser: pulses of {ns} ns, {khz} kHz, on for {percent} % of the time\n\
             for each watt of the diode's peak power: {ns} nJ a pulse, {milliwatts} mW on average"
        )
    }
}

/// A fraction rounded to `digits` decimals, which are left out if they are 0 and `short` is set.
fn decimal(numerator: u64, denominator: u64, digits: usize, short: bool) -> String {
    let scale = 10_u64.pow(u32::try_from(digits).unwrap_or(0));
    let scaled = (numerator * scale + denominator / 2) / denominator;
    let (whole, part) = (scaled / scale, scaled % scale);
    if short && part == 0 {
        return whole.to_string();
    }
    format!("{whole}.{part:0digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn laser(clock_hz: u32, period: u32, pulse: u32) -> Result<Laser> {
        let words = [clock_hz, period, pulse].map(u32::to_le_bytes);
        Laser::from_bytes(words.as_flattened())
    }

    #[test]
    fn says_what_the_hardware_does() {
        let laser = laser(125_000_000, 1250, 13).unwrap();
        assert_eq!(laser.file_name(), "104ns+100.000kHz+1.04pct");
        assert_eq!(
            laser.text(),
            "laser: pulses of 104 ns, 100.000 kHz, on for 1.04 % of the time\n\
             for each watt of the diode's peak power: 104 nJ a pulse, 10.40 mW on average"
        );
    }

    #[test]
    fn rounds_to_the_nearest_digit() {
        // 801.282 kHz and 1.282 %; 1 Hz.
        let fast = laser(125_000_000, 156, 2).unwrap();
        assert_eq!(fast.file_name(), "16ns+801.282kHz+1.28pct");
        let slow = laser(125_000_000, 125_000_000, 2).unwrap();
        assert_eq!(slow.file_name(), "16ns+0.001kHz+0.00pct");
        // Longer by half a nanosecond.
        let other = laser(133_000_000, 1330, 13).unwrap();
        assert_eq!(other.file_name(), "97.744ns+100.000kHz+0.98pct");
    }

    #[test]
    fn what_is_no_laser_is_an_error() {
        assert!(laser(0, 1, 1).is_err());
        assert!(laser(1, 0, 1).is_err());
        assert!(Laser::from_bytes(&[1; 8]).is_err());
        assert!(Laser::from_bytes(&[1; 13]).is_err());
    }
}
