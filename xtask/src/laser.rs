//! The laser pulses of an image for the photon timer: checked before it is built, and read from the image.

use std::env;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
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

/// Checks `LASER_HZ` and `LASER_PULSE_NS`, so that an image that cannot be built says so in one line.
pub fn check(is_limited: bool) -> Result<()> {
    let number = |variable, default: u32| {
        let value = env::var(variable).unwrap_or_else(|_| default.to_string());
        let number = value.parse::<u32>();
        let number = number.with_context(|| format!("{variable}={value}: not a whole number"))?;
        Ok::<u32, anyhow::Error>(number)
    };
    let (laser_hz, pulse_ns) = (number("LASER_HZ", 100_000)?, number("LASER_PULSE_NS", 16)?);
    if let Some(reason) = refusal(laser_hz, pulse_ns, is_limited) {
        bail!("LASER_HZ={laser_hz} LASER_PULSE_NS={pulse_ns}: {reason}");
    }
    Ok(())
}

/// Why an image cannot have these laser pulses. The image asks `photon_timer::Config`, and a test compares them: this
/// package compiles none of the product.
fn refusal(laser_hz: u32, pulse_ns: u32, is_limited: bool) -> Option<&'static str> {
    const CLOCK_HZ: u64 = 125_000_000;
    let hz = u64::from(laser_hz);
    if hz == 0 {
        return Some("there is to be a laser cycle a second or more");
    }
    let period = (CLOCK_HZ + hz / 2) / hz;
    let pulse = u64::from(pulse_ns).div_ceil(8).max(2);
    let reasons = [
        (
            period < 136,
            "a laser cycle is shorter than its bins: at most 919117 a second",
        ),
        (pulse_ns == 0, "the laser's pulse is 0 ns"),
        (
            pulse + 5 > period,
            "the laser's pulse leaves no pause in its laser cycle",
        ),
        (
            is_limited && pulse > 125,
            "the laser's pulse is longer than 1000 ns: only an image with laser-beyond-limits may do that",
        ),
        (
            is_limited && 50 * pulse > period,
            "the laser is on for more than 2 % of the time: only an image with laser-beyond-limits may do that",
        ),
    ];
    let reason = reasons.into_iter().find(|(is_wrong, _)| *is_wrong);
    reason.map(|(_, reason)| reason)
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
    use std::collections::BTreeSet;

    use super::*;
    use dtof_sensors::photon_timer::{Config, Settings};

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
    fn what_is_refused_is_what_the_image_refuses() {
        let mut reasons = BTreeSet::new();
        for laser_hz in [
            0,
            1,
            100,
            19_999,
            20_002,
            100_000,
            192_455,
            192_456,
            922_509,
            922_510,
            u32::MAX,
        ] {
            for pulse_ns in [
                0,
                1,
                16,
                96,
                97,
                104,
                1000,
                1001,
                1040,
                1048,
                9960,
                9961,
                u32::MAX,
            ] {
                let settings = Settings { laser_hz, pulse_ns };
                let image = Config::new(settings).err().map(|error| error.text());
                assert_eq!(refusal(laser_hz, pulse_ns, true), image, "{settings:?}");
                reasons.extend(image);
                let image = Config::beyond_limits(settings).err();
                let image = image.map(|error| error.text());
                assert_eq!(refusal(laser_hz, pulse_ns, false), image, "{settings:?}");
            }
        }
        assert_eq!(reasons.len(), 6);
    }

    #[test]
    fn what_is_no_laser_is_an_error() {
        assert!(laser(0, 1, 1).is_err());
        assert!(laser(1, 0, 1).is_err());
        assert!(Laser::from_bytes(&[1; 8]).is_err());
        assert!(Laser::from_bytes(&[1; 13]).is_err());
    }
}
