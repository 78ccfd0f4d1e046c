//! A pin that is always low, whatever level it is set to.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, InputPin, OutputPin};

pub struct Low;

impl ErrorType for Low {
    type Error = Infallible;
}

impl InputPin for Low {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(false)
    }
    fn is_low(&mut self) -> Result<bool, Infallible> {
        Ok(true)
    }
}

impl OutputPin for Low {
    fn set_low(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}
