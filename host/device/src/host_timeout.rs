//! Longest silence of the host.

use std::fmt;

use dtof_link::Configuration;

use dtof_data::options::numbers::real;

/// A device stops its sensor, and with it the laser, after the host has been silent for so long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostTimeout {
    milliseconds: u16,
}

impl HostTimeout {
    /// A timeout in milliseconds: 200 to 60,000, or 0 for never. `None` for other numbers.
    #[must_use]
    pub fn from_milliseconds(milliseconds: u16) -> Option<Self> {
        let is_valid = milliseconds == 0 || Configuration::HOST_TIMEOUTS_MS.contains(&milliseconds);
        is_valid.then_some(Self { milliseconds })
    }

    /// Reads seconds: 0.2 to 60 with at most three decimals, or 0.
    ///
    /// # Errors
    /// Fails for other numbers and texts.
    pub fn from_seconds(text: &str) -> Result<Self, String> {
        let exact = real(text).map(|seconds| seconds * 1000.0);
        let milliseconds = exact.filter(|exact| (exact - exact.round()).abs() < 1e-6);
        // -1 stands for every text that is not a number of milliseconds.
        #[allow(clippy::cast_possible_truncation, reason = "saturates")]
        let milliseconds = milliseconds.map_or(-1, |exact| exact.round() as i64);
        let milliseconds = u16::try_from(milliseconds).ok();
        milliseconds
            .and_then(Self::from_milliseconds)
            .ok_or_else(|| {
                let (least, most) = Configuration::HOST_TIMEOUTS_MS.into_inner();
                let [least, most] = [least, most].map(|end| f64::from(end) / 1000.0);
                format!("must be seconds from {least} to {most} with at most three decimals, or 0")
            })
    }

    /// The timeout in milliseconds.
    #[must_use]
    pub const fn milliseconds(self) -> u16 {
        self.milliseconds
    }
}

/// 3 seconds.
impl Default for HostTimeout {
    fn default() -> Self {
        Self {
            milliseconds: Configuration::HOST_TIMEOUT_MS,
        }
    }
}

impl fmt::Display for HostTimeout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} s", f64::from(self.milliseconds) / 1000.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_are_read_to_the_millisecond() {
        for (text, milliseconds, shown) in [
            ("0.2", 200, "0.2 s"),
            ("3", 3_000, "3 s"),
            ("1.125", 1_125, "1.125 s"),
            ("57.301", 57_301, "57.301 s"),
            ("6e1", 60_000, "60 s"),
            ("0", 0, "0 s"),
        ] {
            let timeout = HostTimeout::from_seconds(text).unwrap();
            assert_eq!(timeout.milliseconds(), milliseconds);
            assert_eq!(timeout.to_string(), shown);
        }
        assert_eq!(HostTimeout::from_seconds("3"), Ok(HostTimeout::default()));
    }

    #[test]
    fn other_texts_are_refused() {
        for text in [
            "", "x", "-3", "0.199", "0.1999", "0.0001", "2.0005", "60.001", "61", "65536", "1e300",
            "3 s", "inf", "NaN",
        ] {
            assert_eq!(
                HostTimeout::from_seconds(text).unwrap_err(),
                "must be seconds from 0.2 to 60 with at most three decimals, or 0",
                "{text}"
            );
        }
    }
}
