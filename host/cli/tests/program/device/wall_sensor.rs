//! A simulated sensor in front of a flat wall, with one hot pixel. The firmware's sidecar runs it
//! behind a TCP port of this computer.

use std::num::NonZeroU16;
use std::time::Duration;

use crate::device::{listen, serve};
use dtof_core::PixelAddress;
use dtof_core::fixed::types::{U0F32, U8F24, U16F16};
use dtof_firmware::sidecar::Sidecar;
use dtof_sensors::dither::Dither;
use dtof_sensors::simulated::{self, Pulse, Simulated, SimulatedPixel};
use dtof_sensors::{PhotonSink, Polled, Sensor, SensorFault, SensorInfo};

/// Longer than any test.
pub const LONG: Duration = Duration::from_secs(600);
pub const PIXELS: u16 = 12;
/// One pixel has many times the background of the others.
pub const HOT: u16 = 5;
/// Photons a laser cycle: of the wall, and of the background in all bins.
pub const SIGNAL: f64 = 0.4;
pub const BACKGROUND: f64 = 0.25;
pub const HOT_BACKGROUND: f64 = 3.5;
/// Standard deviation and position of the pulse in bins.
pub const SIGMA: f64 = 0.9;
pub const POSITION: f64 = 44.8;
/// The first bin of the pulse, and its number of bins.
pub const FIRST: u16 = 40;
pub const WIDTH: u16 = 10;

/// The share of the pulse in each of its bins: a Gaussian, summed in small steps.
fn shares() -> Vec<f64> {
    let step = |bin: u16, part: u16| {
        let at = f64::from(FIRST + bin) + (f64::from(part) + 0.5) / 1000.0 - POSITION;
        (-0.5 * (at / SIGMA).powi(2)).exp()
    };
    let bin = |bin| (0..1000).map(|part| step(bin, part)).sum::<f64>();
    let bins: Vec<f64> = (0..WIDTH).map(bin).collect();
    let all: f64 = bins.iter().sum();
    bins.iter().map(|bin| bin / all).collect()
}

/// Bin width of a sensor that counts histograms itself.
pub const WHOLE_BIN_PS: U16F16 = U16F16::lit("100");

/// Photons a laser cycle of signal and background, by pixel.
pub type Rates = fn(u16) -> (f64, f64);

pub const WALL: Rates = |pixel| match pixel {
    HOT => (0.0, HOT_BACKGROUND),
    _ => (SIGNAL, BACKGROUND),
};

/// The highest bin of one pixel would fill its counter in 700 laser cycles.
pub const BRIGHT: Rates = |pixel| (if pixel == 0 { 3.5 } else { SIGNAL }, BACKGROUND);

/// 20,000 laser cycles a second.
pub fn photons(rates: Rates) -> Simulated<'static> {
    let rate = U8F24::from_num::<f64>;
    let pixel = |pixel| {
        let (signal, background) = rates(pixel);
        let address = PixelAddress::new(pixel);
        SimulatedPixel::new(address, FIRST, rate(signal), rate(background)).unwrap()
    };
    let pixels: Vec<_> = (0..PIXELS).map(pixel).collect();
    let shares: Vec<U0F32> = shares().into_iter().map(U0F32::from_num).collect();
    let last = shares.len() - 1;
    let settings = simulated::Settings {
        seed: 7,
        bins: 128,
        cycles_per_second: 20_000,
        cycles_per_poll: NonZeroU16::new(400).unwrap(),
    };
    Simulated::new(pixels.leak(), Pulse::new(&shares.leak()[..last]), settings)
}

/// A sensor that may be unplugged, or count histograms itself.
#[derive(Clone)]
pub struct WallSensor {
    pub photons: Simulated<'static>,
    /// Its photons after the first second.
    pub later: Option<Simulated<'static>>,
    pub is_there: bool,
    /// A sensor that counts histograms: laser cycles of a histogram, and of the current one so far.
    pub histogram_cycles: Option<(u32, u32)>,
    pub counts: Vec<[u32; 128]>,
}

impl WallSensor {
    pub fn new(rates: Rates) -> Self {
        Self {
            photons: photons(rates),
            later: None,
            is_there: true,
            histogram_cycles: None,
            counts: vec![[0; 128]; PIXELS.into()],
        }
    }
}

/// Sums photons into histograms.
struct Adding<'a>(&'a mut [[u32; 128]], u32);

impl PhotonSink for Adding<'_> {
    fn photon(&mut self, pixel: PixelAddress, code: u16) {
        self.0[usize::from(pixel.raw())][usize::from(code)] += 1;
    }
    fn end_laser_cycles(&mut self, cycles: u16) {
        self.1 += u32::from(cycles);
    }
    fn begin_frame(&mut self, _: u32) {}
    fn histogram(&mut self, _: PixelAddress, _: &[u32; 128]) {}
}

impl Sensor for WallSensor {
    type Error = SensorFault;

    fn info(&self) -> SensorInfo {
        SensorInfo {
            gives_histograms: self.histogram_cycles.is_some(),
            bin_width: self.histogram_cycles.map(|_| WHOLE_BIN_PS),
            ..self.photons.info()
        }
    }

    fn start(&mut self, bin_width: U16F16, dither: Dither) {
        self.photons.start(bin_width, dither);
        if let Some(later) = &mut self.later {
            later.start(bin_width, dither);
        }
    }

    fn stop(&mut self) {}

    fn poll(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, SensorFault> {
        if !self.is_there {
            return Err(SensorFault::NoAnswer);
        }
        if let Some(later) = self.later.take_if(|_| now_ms > 1_000) {
            self.photons = later;
        }
        let Some((length, ended)) = &mut self.histogram_cycles else {
            let Ok(polled) = self.photons.poll(now_ms, sink);
            return Ok(polled);
        };
        let mut adding = Adding(&mut self.counts, 0);
        let Ok(_) = self.photons.poll(now_ms, &mut adding);
        *ended += adding.1;
        if *ended < *length {
            return Ok(Polled::Idle);
        }
        sink.begin_frame(std::mem::take(ended));
        for (pixel, counts) in (0..).map(PixelAddress::new).zip(&mut self.counts) {
            sink.histogram(pixel, counts);
            *counts = [0; 128];
        }
        Ok(Polled::Data)
    }
}

/// A device that closes its connection after `lives` and then listens again.
pub fn device(sensor: WallSensor, lives: Duration) -> String {
    listen(move |stream| {
        let mut pixels = heapless::Vec::<_, { PIXELS as usize }>::new();
        let mut blocks = heapless::Vec::<_, 1>::new();
        let mut sensor = sensor.clone();
        let mut sidecar = Sidecar::new(&mut pixels, &mut blocks, Some(sensor.info()));
        let poll = |sidecar: &mut Sidecar<'_>, now| sidecar.poll_sensor(&mut sensor, now);
        let _ = serve(stream, &mut sidecar, lives, poll);
        true
    })
}
