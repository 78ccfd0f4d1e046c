//! Drivers of sensors, and a bus that answers anything. Each has a model written from the data sheet
//! that sees the same answers and tells the expected calls of the sink.

mod bus;
mod tdc7200;
mod tmf8829;
mod tmf882x;

use dtof_chips::Chip;
use dtof_core::PixelAddress;
use dtof_core::fixed::types::U16F16;
use dtof_sensors::dither::Dither;
use dtof_sensors::{PhotonSink, Polled, Sensor, SensorFault};

use self::bus::Bus;
use crate::Input;

/// One call of the sink.
#[derive(Clone, Debug, PartialEq, Eq)]
enum SinkCall {
    Photon(u16, u16),
    End(u16),
    Frame(u32),
    Histogram(u16, Vec<u32>),
}

/// Records the calls of a poll.
#[derive(Default)]
struct RecordingSink(Vec<SinkCall>);

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
}

/// The most transfers of a poll: a TDC7200 is configured by 19.
const TRANSFERS: usize = 20;
/// A sensor that answers well again has something after so many milliseconds: the longest time
/// limit of a driver is a second.
const AGAIN_MS: u32 = 3000;

/// What the answers of a poll must bring, beside the driver.
trait Model<C> {
    /// The driver is told to begin anew.
    fn restart(&mut self);

    /// Sees the answers of a poll, and what came of them.
    fn check(&mut self, answers: &[bus::Answer], failed: bool, calls: &[SinkCall]);
}

/// The input says which sensor, how it is set, and what the bus and the pins do. Calls of a poll are
/// bounded, what is given is what was answered, once, and good answers bring data again.
pub fn sensors(data: &[u8]) {
    let mut input = Input::new(data);
    let (kind, settings) = (input.byte(), input.byte());
    // Kinds below 224 are older than the TMF8829: the corpus has them.
    match (kind >= 224, kind % 4) {
        (false, 0) => tdc7200::run::<13>(settings, input),
        (false, 1) => tdc7200::run::<2>(settings, input),
        (false, 2) => tmf882x::run::<135>(settings, input),
        (false, _) => tmf882x::run::<32>(settings, input),
        (true, 0 | 1) => tmf8829::run::<128>(settings, input),
        (true, _) => tmf8829::run::<252>(settings, input),
    }
}

/// Polls while there is input, and then until the sensor has something.
fn drive<C: Chip, S: Sensor>(sensor: &mut S, bus: &Bus<'_, C>, model: &mut impl Model<C>)
where
    S::Error: std::error::Error,
{
    let mut now_ms = 0u32.wrapping_sub(50);
    sensor.start(U16F16::lit("250"), Dither::OFF);
    let mut is_on = true;
    while let Some(what) = bus.next() {
        now_ms = now_ms.wrapping_add([0, 1, 1, 3, 11, 60, 150, 1001][usize::from(what & 7)]);
        match what >> 3 {
            // A line that is torn off, or lies on another.
            0 => bus.set_line(bus::Line::Broken),
            1 => bus.set_line(bus::Line::High),
            2 => bus.set_line(bus::Line::Low),
            3 => {
                model.restart();
                sensor.start(U16F16::lit("250"), Dither::OFF);
                is_on = true;
            }
            4 => {
                model.restart();
                sensor.stop();
                is_on = false;
                bus.take_answers();
            }
            _ => bus.set_line(bus::Line::Chip),
        }
        let polled = poll(sensor, bus, now_ms, model);
        assert!(
            is_on || polled != Ok(Polled::Data),
            "a sensor that is off gives something"
        );
    }
    bus.set_line(bus::Line::Chip);
    if !is_on {
        model.restart();
        sensor.start(U16F16::lit("250"), Dither::OFF);
    }
    let began = now_ms;
    while poll(sensor, bus, now_ms, model) != Ok(Polled::Data) {
        now_ms = now_ms.wrapping_add(1);
        assert!(
            now_ms.wrapping_sub(began) <= AGAIN_MS,
            "a good sensor gives nothing"
        );
    }
}

fn poll<C: Chip, S: Sensor>(
    sensor: &mut S,
    bus: &Bus<'_, C>,
    now_ms: u32,
    model: &mut impl Model<C>,
) -> Result<Polled, SensorFault>
where
    S::Error: std::error::Error,
{
    let mut sink = RecordingSink::default();
    let polled = sensor.poll(now_ms, &mut sink);
    let answers = bus.take_answers();
    assert!(answers.len() <= TRANSFERS, "{} transfers", answers.len());
    model.check(&answers, polled.is_err(), &sink.0);
    if let Ok(polled) = &polled {
        // A frame may begin before any of its histograms is whole.
        let has_data = sink
            .0
            .iter()
            .any(|call| !matches!(call, SinkCall::Frame(_)));
        assert_eq!(*polled == Polled::Data, has_data);
    }
    polled.map_err(|error| {
        let line = error.to_string();
        assert!(!line.is_empty() && !line.contains('\n'), "{line:?}");
        error.into()
    })
}
