//! Why the sensor of a device, and with it the laser, has stopped.

use std::error::Error;
use std::fmt;

use dtof_link::{Report, StopReason};

use super::HostTimeout;

/// The sensor that this program has started does not run any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stopped {
    /// The session goes on, and the device reports the reason.
    InSession {
        /// The reason, if this program knows it.
        reason: Option<StopReason>,
        /// The host timeout of the configuration.
        host_timeout: HostTimeout,
    },
    /// The device has been restarted, with the reason if known.
    Restarted(Option<StopReason>),
    /// Another program has begun a session.
    AnotherSession,
    /// The device has ended the session.
    Ended(StopReason),
}

impl Stopped {
    /// Checks a report of the device after it was configured to take photons from its sensor.
    ///
    /// # Errors
    /// Fails if the sensor has been started and does not run.
    pub fn check(report: &Report, host_timeout: HostTimeout) -> Result<(), Self> {
        let reason = StopReason::from_number(report.stop_reason);
        // These also keep a sensor from its first start.
        let is_prevented = matches!(
            reason,
            Some(StopReason::Silence | StopReason::NotListening | StopReason::PortFailed)
        );
        let runs = report.sensor_starts != report.sensor_stops;
        if runs || (report.sensor_starts == 0 && !is_prevented) {
            return Ok(());
        }
        Err(Self::InSession {
            reason,
            host_timeout,
        })
    }

    /// Why a device has forgotten a session, from the reason of its last stop.
    pub(super) const fn forgotten(reason: Option<StopReason>) -> Self {
        match reason {
            Some(StopReason::NewSession) => Self::AnotherSession,
            Some(reason) if !is_of_reset(reason) => Self::Ended(reason),
            reason => Self::Restarted(reason),
        }
    }

    /// A warning if the device has failed before this session.
    #[must_use]
    pub fn warning(report: &Report) -> Option<String> {
        let reason = StopReason::from_number(report.stop_reason)?;
        let has_failed = is_of_reset(reason) && reason != StopReason::Reset;
        has_failed.then(|| format!("the device has been restarted ({reason}) before this session"))
    }
}

impl fmt::Display for Stopped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InSession {
                reason,
                host_timeout,
            } => {
                f.write_str("the sensor has stopped: ")?;
                match reason {
                    None => f.write_str("for a reason this program does not know"),
                    Some(reason @ StopReason::Silence) => write!(f, "{reason} for {host_timeout}"),
                    Some(reason) => reason.fmt(f),
                }
            }
            Self::Restarted(reason) => {
                f.write_str("the device has been restarted")?;
                if let Some(reason) = reason {
                    write!(f, " ({reason})")?;
                }
                f.write_str(" and has forgotten this session")
            }
            Self::AnotherSession => {
                f.write_str("another program has begun a session with the device")
            }
            Self::Ended(reason) => write!(f, "the device has ended this session: {reason}"),
        }
    }
}

impl Error for Stopped {}

/// Whether the device was reset for this reason.
const fn is_of_reset(reason: StopReason) -> bool {
    matches!(
        reason,
        StopReason::Panic
            | StopReason::Fault
            | StopReason::Watchdog
            | StopReason::BrownOut
            | StopReason::Reset
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_has_stopped_if_it_was_started_and_does_not_run() {
        let host_timeout = HostTimeout::from_milliseconds(250).unwrap();
        let checked = |starts, stops, reason| {
            let report = Report {
                sensor_starts: starts,
                sensor_stops: stops,
                stop_reason: reason,
                ..Report::default()
            };
            Stopped::check(&report, host_timeout).map_err(|stopped| stopped.to_string())
        };
        // It runs, or has not been started.
        for (starts, stops, reason) in [(1, 0, 4), (7, 6, 4), (0, 0, 0), (0, 0, 8)] {
            assert_eq!(checked(starts, stops, reason), Ok(()));
        }
        assert!(checked(0, 0, 5).is_err(), "it may not start");
        for (reason, text) in [
            (4, "the host was silent for 0.25 s"),
            (5, "the host closed the USB port"),
            (99, "for a reason this program does not know"),
        ] {
            let expected = format!("the sensor has stopped: {text}");
            assert_eq!(checked(7, 7, reason), Err(expected));
        }
    }

    #[test]
    fn a_device_that_forgets_a_session_has_been_restarted_or_has_another() {
        let rest = "and has forgotten this session";
        for (reason, text) in [
            (0, format!("the device has been restarted {rest}")),
            (
                8,
                format!("the device has been restarted (the watchdog) {rest}"),
            ),
            (
                10,
                format!("the device has been restarted (a reset) {rest}"),
            ),
            (
                2,
                "another program has begun a session with the device".to_owned(),
            ),
            (
                5,
                "the device has ended this session: the host closed the USB port".to_owned(),
            ),
        ] {
            let stopped = Stopped::forgotten(StopReason::from_number(reason));
            assert_eq!(stopped.to_string(), text);
        }
    }

    #[test]
    fn a_failure_of_the_device_gives_a_warning() {
        let warned = (0..=u8::MAX).filter(|&stop_reason| {
            let report = Report {
                stop_reason,
                ..Report::default()
            };
            Stopped::warning(&report).is_some()
        });
        assert!(warned.eq([6, 7, 8, 9]));
    }
}
