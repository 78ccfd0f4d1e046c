//! ENABLE of a sensor: low unless the driver needs it high.

use core::fmt;

use embedded_hal::digital::OutputPin;

/// The pin. It goes low when it is dropped.
#[derive(Debug)]
pub(crate) struct Enable<EN: OutputPin>(Option<EN>);

impl<EN: OutputPin> Enable<EN> {
    pub(crate) const fn new(pin: EN) -> Self {
        Self(Some(pin))
    }

    /// # Errors
    /// Fails if the pin does.
    pub(crate) fn set(&mut self, high: bool) -> Result<(), EN::Error> {
        match &mut self.0 {
            Some(pin) => pin.set_state(high.into()),
            None => Ok(()),
        }
    }

    /// Drives the pin low and gives it back, with what belongs to it.
    ///
    /// # Errors
    /// Fails if the pin does; the error has all of them.
    pub(crate) fn release<BUS, INT>(
        mut self,
        bus: BUS,
        interrupt: INT,
    ) -> Result<(BUS, INT, EN), ReleaseError<BUS, INT, EN>> {
        let low = self.set(false);
        let Some(enable) = self.0.take() else {
            // Never: only this function takes the pin, and it can be called once.
            loop {
                core::hint::spin_loop();
            }
        };
        match low {
            Ok(()) => Ok((bus, interrupt, enable)),
            Err(error) => Err(ReleaseError {
                error,
                bus,
                interrupt,
                enable,
            }),
        }
    }
}

impl<EN: OutputPin> Drop for Enable<EN> {
    fn drop(&mut self) {
        // There is no caller to take an error.
        let _ = self.set(false);
    }
}

/// ENABLE did not go low when its driver was released: the sensor may be on.
pub struct ReleaseError<BUS, INT, EN: OutputPin> {
    /// The error of the pin.
    pub error: EN::Error,
    /// The bus.
    pub bus: BUS,
    /// INT.
    pub interrupt: INT,
    /// ENABLE.
    pub enable: EN,
}

impl<BUS, INT, EN: OutputPin> fmt::Debug for ReleaseError<BUS, INT, EN> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ReleaseError")
            .field("error", &self.error)
            .finish_non_exhaustive()
    }
}

impl<BUS, INT, EN: OutputPin> fmt::Display for ReleaseError<BUS, INT, EN> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ENABLE did not go low: {:?}", self.error)
    }
}

impl<BUS, INT, EN: OutputPin> core::error::Error for ReleaseError<BUS, INT, EN> {}
