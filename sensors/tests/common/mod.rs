//! What the tests of the drivers share: a sink that records its calls, and
//! a pin whose level the test sets.

pub mod bus;
pub mod part;
pub mod tdc7200;
pub mod tmf8828;
pub mod tmf8829;
pub mod tmf882x;
pub mod wires;

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use dtof_core::PixelAddress;
use dtof_core::fixed::types::U16F16;
use dtof_sensors::dither::Dither;
use dtof_sensors::{PhotonSink, Sensor, Target};
use embedded_hal::digital::{Error, ErrorKind, ErrorType, InputPin, OutputPin};

/// The driver, started.
pub fn started<S: Sensor>(mut sensor: S) -> S {
    sensor.start(U16F16::from_num(250), Dither::OFF);
    sensor
}

/// One call of the sink.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SinkCall {
    Photon(u16, u16),
    End(u16),
    Frame(u32),
    Histogram(u16, Vec<u32>),
    Target(u16, Target),
}

/// Records every call.
#[derive(Debug, Default)]
pub struct RecordingSink(pub Vec<SinkCall>);

impl RecordingSink {
    /// The calls since this was last used.
    pub fn take(&mut self) -> Vec<SinkCall> {
        std::mem::take(&mut self.0)
    }
}

impl PhotonSink for RecordingSink {
    fn photon(&mut self, pixel: PixelAddress, code: u16) {
        self.0.push(SinkCall::Photon(pixel.raw(), code));
    }
    fn end_laser_cycles(&mut self, cycles: u16) {
        self.0.push(SinkCall::End(cycles));
    }
    fn begin_frame(&mut self, cycles: u32) {
        self.0.push(SinkCall::Frame(cycles));
    }
    fn histogram(&mut self, pixel: PixelAddress, counts: &[u32; 128]) {
        self.0
            .push(SinkCall::Histogram(pixel.raw(), counts.to_vec()));
    }
    fn target(&mut self, pixel: PixelAddress, target: &Target) {
        self.0.push(SinkCall::Target(pixel.raw(), *target));
    }
}

/// A pin; clones are the same pin.
#[derive(Clone, Debug)]
pub struct Line {
    level: Rc<Cell<bool>>,
    pub broken: Rc<Cell<bool>>,
    /// Every level set by the driver.
    pub driven: Rc<RefCell<Vec<bool>>>,
}

/// What a broken pin says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Broken;

impl Error for Broken {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl Line {
    pub fn new(high: bool) -> Self {
        Self {
            level: Rc::new(Cell::new(high)),
            broken: Rc::default(),
            driven: Rc::default(),
        }
    }
    pub fn set(&self, high: bool) {
        self.level.set(high);
    }
    fn check(&self) -> Result<(), Broken> {
        (!self.broken.get()).then_some(()).ok_or(Broken)
    }
    fn drive(&self, high: bool) -> Result<(), Broken> {
        self.check()?;
        self.driven.borrow_mut().push(high);
        self.set(high);
        Ok(())
    }
}

impl ErrorType for Line {
    type Error = Broken;
}

impl InputPin for Line {
    fn is_high(&mut self) -> Result<bool, Broken> {
        self.check()?;
        Ok(self.level.get())
    }
    fn is_low(&mut self) -> Result<bool, Broken> {
        self.is_high().map(|is_high| !is_high)
    }
}

impl OutputPin for Line {
    fn set_low(&mut self) -> Result<(), Broken> {
        self.drive(false)
    }
    fn set_high(&mut self) -> Result<(), Broken> {
        self.drive(true)
    }
}
