//! One pixel: its events, and the readings of a frame-based sensor from the same photons.

use super::systems::FPGA;
use anyhow::Result;
use dtof_core::{
    AnyRule, AsyncPixel, BinPosition, DepthEstimator, DepthEvent, LaserCycle, PixelAddress,
    PixelConfig, RangeGate, Statistics,
};
use dtof_draw::palette::{self, Pen};
use dtof_engine::frame::FramePixel;
use dtof_light::SimulatedPixel;
use dtof_light::rates::Rates;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;

/// Bins of a histogram of the paper's prototype.
pub const BINS: usize = CODES as usize;
/// The number of TDC codes.
pub const CODES: u16 = FPGA.bins;
/// Units of a position per bin.
pub const PER_BIN: i64 = 1 << BinPosition::FRACTIONAL_BITS;
/// Exposures of the frames in comparison, in laser cycles.
pub const FRAMES: [u64; 4] = [100, 500, 1000, 2000];
/// The sensors that see the same photons: events, then [`FRAMES`].
pub const SENSORS: [&str; 5] = [
    "events",
    "frames of 100",
    "frames of 500",
    "frames of 1000",
    "frames of 2000",
];

/// The pen of a sensor, by its index in [`SENSORS`].
pub const fn pen(sensor: usize) -> Pen {
    match sensor {
        0 => palette::EVENTS,
        number => palette::frames(FRAMES[number - 1]),
    }
}

/// Laser cycles of the prototype from one look at the histogram to the next (X).
pub const PROTOTYPE_X: u16 = FPGA.x;

/// The paper's FPGA prototype with `l1`.
pub fn prototype(l1: u16) -> Result<PixelConfig<BINS, AnyRule>> {
    FPGA.settings(FPGA.by, l1, 0).config()
}

/// A depth and the laser cycles of its exposure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// The first laser cycle of the exposure.
    pub first: u64,
    /// The last laser cycle of the exposure, at which it is reported.
    pub last: u64,
    /// Bins from the start of bin 0, [`PER_BIN`] a bin.
    pub position: i64,
}

impl Reading {
    /// The reading of an event or a frame.
    pub fn of(event: &DepthEvent) -> Self {
        Self {
            first: event.cycle.raw() + 1 - u64::from(event.exposure),
            last: event.cycle.raw(),
            position: event.position().raw().into(),
        }
    }

    /// The exposure in laser cycles.
    pub const fn exposure(&self) -> u64 {
        self.last + 1 - self.first
    }
}

/// Frames of a pixel, the first from laser cycle `first` on.
pub fn frames<const BINS: usize>(first: u64, length: u64) -> FramePixel<BINS> {
    let length = u16::try_from(length).unwrap_or(u16::MAX);
    FramePixel::new(PixelAddress::new(0), first, length)
}

/// Ends a laser cycle of frames, without a gate and with the same centre of mass as events.
pub fn end_laser_cycle<const BINS: usize>(
    frames: &mut FramePixel<BINS>,
    cycle: u64,
) -> Option<Reading> {
    let read = frames.end_laser_cycle(&RangeGate::full(), &DepthEstimator::default(), cycle);
    read.as_ref().map(Reading::of)
}

/// The readings of each of [`SENSORS`] in `cycles` laser cycles. The frames of each length begin at
/// the laser cycle of `phases`. `photons` returns the TDC codes of a laser cycle.
pub fn watch<const BINS: usize>(
    cycles: u64,
    config: &PixelConfig<BINS, AnyRule>,
    phases: [u64; 4],
    mut photons: impl FnMut(u64, &mut dyn FnMut(u16)) -> Result<()>,
) -> Result<[Vec<Reading>; 5]> {
    let mut pixel = AsyncPixel::<BINS>::new(PixelAddress::new(0));
    let mut statistics = Statistics::new();
    let mut lengths = FRAMES.into_iter();
    let mut frames = phases.map(|first| frames::<BINS>(first, lengths.next().unwrap_or_default()));
    let mut readings: [Vec<Reading>; 5] = Default::default();
    for cycle in 0..cycles {
        photons(cycle, &mut |code| {
            pixel.count(config, code);
            for frame in &mut frames {
                frame.count(&RangeGate::full(), cycle, code);
            }
        })?;
        pixel.end_laser_cycle(config, &mut statistics, LaserCycle::new(cycle));
        let [events, of_frames @ ..] = &mut readings;
        events.extend(pixel.take_event().as_ref().map(Reading::of));
        for (readings, frame) in of_frames.iter_mut().zip(&mut frames) {
            readings.extend(end_laser_cycle(frame, cycle));
        }
    }
    Ok(readings)
}

/// Random phases of the frames.
pub fn phases(rng: &mut Pcg64) -> Result<[u64; 4]> {
    let mut phases = FRAMES;
    for phase in &mut phases {
        *phase = Uniform::new(0, *phase)?.sample(rng);
    }
    Ok(phases)
}

/// The readings of `pixel`, which has the rates `later` from laser cycle `at` on.
pub fn watch_step<const BINS: usize>(
    pixel: &SimulatedPixel,
    config: &PixelConfig<BINS, AnyRule>,
    later: &Rates,
    at: u64,
    cycles: u64,
    phases: [u64; 4],
) -> Result<[Vec<Reading>; 5]> {
    let mut pixel = pixel.clone();
    watch(cycles, config, phases, |cycle, photon| {
        if cycle == at {
            pixel.set_rates(later)?;
        }
        pixel.next_cycle(photon);
        Ok(())
    })
}

/// Converts bins to a position, rounded to the nearest.
#[allow(clippy::cast_possible_truncation, reason = "some hundred bins")]
pub fn in_parts(bins: f64) -> i64 {
    (bins * PER_BIN as f64).round() as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One photon a laser cycle: bin 40 in the first 1,000, then bin 20.
    fn step() -> [Vec<Reading>; 5] {
        let config = prototype(40).unwrap();
        watch(5000, &config, [30, 0, 250, 0], |cycle, photon| {
            photon(if cycle < 1000 { 40 } else { 20 });
            Ok(())
        })
        .unwrap()
    }

    #[test]
    fn frames_follow_each_other_from_their_phase() {
        let [events, short, .., long] = step();
        assert!(events.iter().all(|event| event.exposure() == 44));
        assert_eq!(events[0].position, in_parts(40.5));
        assert_eq!((short[0].first, short[0].last), (30, 129));
        let follows = |pair: &[Reading]| pair[0].last + 1 == pair[1].first;
        assert!(short.windows(2).all(follows));
        assert!(short.iter().all(|frame| frame.exposure() == 100));
        assert_eq!(long.len(), 2);
    }

    /// 70 photons in bin 40 against 30 in bin 20, and half of 2,000 each: the
    /// lower bin is the peak of equals.
    #[test]
    fn a_frame_with_both_surfaces_reports_that_with_more_photons() {
        let [_, short, _, middle, long] = step();
        let at = |frames: &[Reading], last: u64| {
            let found = frames.iter().find(|frame| frame.last == last);
            found.unwrap().position
        };
        assert_eq!(at(&short, 1029), in_parts(40.5));
        assert_eq!(at(&short, 1129), in_parts(20.5));
        assert_eq!(at(&middle, 1249), in_parts(40.5));
        assert_eq!(at(&long, 1999), in_parts(20.5));
    }
}
