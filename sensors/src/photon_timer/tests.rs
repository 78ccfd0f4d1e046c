//! Against a model that has one level a bin, and a ring that is overwritten.

use std::cell::Cell;
use std::rc::Rc;
use std::string::ToString;
use std::vec;
use std::vec::Vec;

use proptest::prelude::*;

use super::*;

/// One level a bin, and the one before.
#[derive(Clone, Debug)]
struct Levels(Vec<bool>);

impl Levels {
    /// As shift registers have them.
    fn samples(&self) -> Samples {
        let mut samples = Samples {
            before: u32::from(self.0[0]) << 31,
            even: [0; 2],
            odd: [0; 2],
        };
        for (bin, &level) in self.0[1..].iter().enumerate() {
            let words = [&mut samples.even, &mut samples.odd][bin % 2].iter_mut();
            let word = words.into_iter().nth(bin / 64).unwrap();
            *word |= u32::from(level) << (bin / 2 % 32);
        }
        samples
    }

    /// By the definition of an edge.
    fn photons(&self) -> Vec<u16> {
        let pairs = self.0.windows(2).zip(0..);
        let rising = pairs.filter(|(pair, _)| !pair[0] && pair[1]);
        rising.map(|(_, bin)| bin).collect()
    }
}

fn photons(samples: &Samples) -> Vec<u16> {
    let mut found = Vec::new();
    samples.photons(|bin| found.push(bin));
    found.sort_unstable();
    found
}

/// All levels of 13 clocks, at both ends and around the middle, where one word ends.
#[test]
fn every_pattern_of_a_few_clocks_has_its_edges() {
    for first in [0, 1, 57, 58, 64, 65, 115, 116] {
        for others in [false, true] {
            for pattern in 0..1 << 13 {
                let mut levels = Levels(vec![others; 129]);
                for bit in 0..13 {
                    levels.0[first + bit] = pattern >> bit & 1 == 1;
                }
                assert_eq!(photons(&levels.samples()), levels.photons());
            }
        }
    }
}

#[test]
fn a_pulse_from_before_is_no_photon_and_no_pulse_is_dark() {
    let mut levels = Levels(vec![false; 129]);
    assert!(levels.samples().is_dark());
    levels.0[0] = true;
    levels.0[1] = true;
    assert!(!levels.samples().is_dark());
    assert_eq!(photons(&levels.samples()), [0; 0]);
    levels.0[0] = false;
    assert_eq!(photons(&levels.samples()), [0]);
}

/// A ring of laser cycles in which more complete between any two calls.
struct Ring {
    cycles: Vec<Levels>,
    completed: u32,
    /// How many more at each call; over and over.
    steps: Vec<u32>,
    polls: usize,
    stalls_at: Option<u32>,
    starts: u32,
    /// While the laser fires.
    dither: Option<Dither>,
}

impl Sampler for Ring {
    const KEPT: u32 = 40;

    fn start(&mut self, _: &Config, dither: Dither) {
        self.completed = 0;
        self.starts += 1;
        self.dither = Some(dither);
        self.stalls_at = self.stalls_at.filter(|_| self.starts < 2);
    }

    fn stop(&mut self) {
        self.dither = None;
    }

    fn completed(&mut self) -> u32 {
        let more = self.steps[self.polls % self.steps.len()];
        self.polls += 1;
        self.completed = (self.completed + more).min(u32::try_from(self.cycles.len()).unwrap());
        self.completed
    }

    fn samples(&self, cycle: u32) -> Samples {
        // One more is being written.
        let is_overwritten = self.completed - cycle > Self::KEPT;
        if is_overwritten || self.stalls_at.is_some_and(|at| cycle >= at) {
            return Samples {
                before: 0,
                even: [0x5555_5555; 2],
                odd: [0; 2],
            };
        }
        self.cycles[cycle as usize].samples()
    }

    fn has_stalled(&self) -> bool {
        self.stalls_at.is_some_and(|at| self.completed >= at)
    }
}

/// Photons of each laser cycle that has ended.
#[derive(Default)]
struct Seen {
    open: Vec<u16>,
    ended: Vec<Vec<u16>>,
}

impl PhotonSink for Seen {
    fn photon(&mut self, pixel: PixelAddress, code: u16) {
        assert_eq!(pixel, PixelAddress::new(0));
        self.open.push(code);
    }

    fn end_laser_cycles(&mut self, cycles: u16) {
        assert!(cycles > 0);
        self.open.sort_unstable();
        self.ended.push(core::mem::take(&mut self.open));
        self.ended
            .resize(self.ended.len() + usize::from(cycles) - 1, Vec::new());
    }

    fn begin_frame(&mut self, _: u32) {
        unreachable!("photons come one by one");
    }

    fn histogram(&mut self, _: PixelAddress, _: &[u32; 128]) {
        unreachable!("photons come one by one");
    }
}

const SETTINGS: Settings = Settings {
    laser_hz: 100_000,
    pulse_ns: 100,
};

fn timer(cycles: Vec<Levels>, steps: Vec<u32>) -> PhotonTimer<Ring> {
    let ring = Ring {
        cycles,
        completed: 0,
        steps,
        polls: 0,
        stalls_at: None,
        starts: 0,
        dither: None,
    };
    let mut timer = PhotonTimer::new(ring, Config::new(SETTINGS).unwrap());
    timer.start(U16F16::from_num(BIN_PS), Dither::OFF);
    assert_eq!(timer.poll(0, &mut Seen::default()), Ok(Polled::Idle));
    timer
}

/// When it has rested.
const LATER_MS: u32 = 2;

/// Laser cycles, of which many are dark.
fn laser_cycles(most: usize) -> impl Strategy<Value = Vec<Levels>> {
    let levels = prop::collection::vec(prop::bool::weighted(0.1), 129);
    let dark = Just(vec![false; 129]);
    let cycle = prop_oneof![levels, dark].prop_map(Levels);
    prop::collection::vec(cycle, 0..most)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn random_levels_have_their_edges(levels in prop::collection::vec(any::<bool>(), 129)) {
        let levels = Levels(levels);
        prop_assert_eq!(photons(&levels.samples()), levels.photons());
    }

    /// Nothing is lost while the ring is read in time, and all is in order.
    #[test]
    fn every_laser_cycle_comes_once_and_in_order(
        cycles in laser_cycles(200),
        steps in prop::collection::vec(0u32..4, 1..8),
    ) {
        let expected: Vec<_> = cycles.iter().map(Levels::photons).collect();
        let mut timer = timer(cycles, steps.iter().map(|&step| step + 1).collect());
        let mut seen = Seen::default();
        for _ in 0..1000 {
            prop_assert!(timer.poll(LATER_MS, &mut seen).is_ok());
        }
        prop_assert_eq!(timer.lost(), 0);
        prop_assert_eq!(seen.ended, expected);
    }

    /// However late it is read: what comes out is whole and in order, and what does not is
    /// counted.
    #[test]
    fn what_is_overwritten_is_counted_and_never_seen(
        cycles in laser_cycles(400),
        steps in prop::collection::vec(0u32..60, 1..8),
    ) {
        prop_assume!(steps.iter().any(|&step| step > 0));
        let photons: Vec<_> = cycles.iter().map(Levels::photons).collect();
        let mut timer = timer(cycles, steps);
        let (mut lost, mut expected) = (0, Vec::new());
        let mut seen = Seen::default();
        for _ in 0..2000 {
            let from = timer.next;
            let result = timer.poll(LATER_MS, &mut seen);
            let to = timer.next;
            let mut read = to - from;
            if let Err(error) = result {
                let Error::Lost(now) = error else { panic!("{error:?}") };
                lost += now;
                read -= now;
            }
            expected.extend_from_slice(&photons[from as usize..][..read as usize]);
        }
        prop_assert_eq!(timer.lost(), lost);
        prop_assert_eq!(seen.ended.len() + lost as usize, photons.len());
        prop_assert_eq!(seen.ended, expected);
    }
}

#[test]
fn samples_that_come_late_are_never_seen_and_it_begins_anew() {
    for late_from in 1..40 {
        let mut dark = timer(vec![Levels(vec![false; 129]); 100], vec![10]);
        dark.sampler.stalls_at = Some(late_from);
        let mut seen = Seen::default();
        let mut results = Vec::new();
        for now_ms in LATER_MS..40 {
            results.push(dark.poll(now_ms, &mut seen));
        }
        assert!(results.contains(&Err(Error::Stalled)));
        assert_eq!(results.last(), Some(&Ok(Polled::Idle)));
        assert_eq!(dark.sampler.starts, 2);
        assert!(seen.ended.iter().all(Vec::is_empty), "from {late_from}");
    }
    assert_eq!(SensorFault::from(Error::Stalled), SensorFault::Data);
    assert_eq!(
        [Error::Stalled, Error::Lost(7)].map(|error| error.to_string()),
        [
            "samples came late and are dropped",
            "7 laser cycles were overwritten before they were read"
        ]
    );
}

/// Memory that always takes samples too slowly.
#[derive(Default)]
struct Stalling {
    fires: bool,
    starts: u32,
}

impl Sampler for Stalling {
    const KEPT: u32 = 40;

    fn start(&mut self, _: &Config, _: Dither) {
        assert!(!self.fires, "it has not rested");
        self.fires = true;
        self.starts += 1;
    }

    fn stop(&mut self) {
        self.fires = false;
    }

    fn completed(&mut self) -> u32 {
        0
    }

    fn samples(&self, _: u32) -> Samples {
        unreachable!("none is complete")
    }

    fn has_stalled(&self) -> bool {
        true
    }
}

/// Stalls and configurations come again and again: each start is a pulse.
#[test]
fn between_two_starts_the_laser_rests_for_a_laser_cycle() {
    for laser_hz in [1, 10, 999, 1000, 100_000] {
        let settings = Settings {
            laser_hz,
            ..SETTINGS
        };
        let config = Config::new(settings).unwrap();
        for configures in [false, true] {
            let mut timer = PhotonTimer::new(Stalling::default(), config);
            timer.start(U16F16::from_num(BIN_PS), Dither::OFF);
            // Where the milliseconds begin anew, too.
            let begin = u32::MAX - 1000;
            let mut started = Vec::new();
            for ms in 0..5000 {
                // Several polls a millisecond, as by a busy main loop.
                for _ in 0..3 {
                    let before = timer.sampler.starts;
                    let _ = timer.poll(begin.wrapping_add(ms), &mut Seen::default());
                    if timer.sampler.starts > before {
                        started.push(ms);
                        if configures {
                            timer.start(U16F16::from_num(BIN_PS), Dither::OFF);
                        }
                    }
                }
            }
            // Within their milliseconds the first may be late and the second early.
            let rested = started.windows(2).map(|two| two[1] - two[0] - 1);
            let clocks = rested.map(|ms| ms * (CLOCK_HZ / 1000));
            assert!(clocks.min().unwrap() >= config.period(), "{laser_hz} Hz");
        }
    }
}

/// Dark laser cycles.
fn dark(cycles: usize, steps: Vec<u32>) -> PhotonTimer<Ring> {
    timer(vec![Levels(vec![false; 129]); cycles], steps)
}

#[test]
fn as_many_laser_cycles_as_are_kept_may_wait_and_of_more_half_of_those_stay() {
    let mut seen = Seen::default();
    // Twice for each batch: before and after it is copied.
    let mut timer = dark(40, vec![40, 0]);
    assert_eq!(timer.poll(LATER_MS, &mut seen), Ok(Polled::Data));
    assert_eq!((timer.lost(), seen.ended.len()), (0, 40));
    for late in 41..80 {
        let mut timer = dark(late as usize, vec![late, 0]);
        let lost = timer.poll(LATER_MS, &mut seen);
        assert_eq!(lost, Err(Error::Lost(late - 20)));
    }
}

#[test]
fn a_poll_takes_eight_batches_and_says_whether_there_was_anything() {
    let mut seen = Seen::default();
    let mut timer = dark(133, vec![16, 0]);
    assert_eq!(timer.poll(LATER_MS, &mut seen), Ok(Polled::Data));
    assert_eq!(seen.ended.len(), 128);
    assert_eq!(timer.poll(LATER_MS, &mut seen), Ok(Polled::Data));
    assert_eq!(seen.ended.len(), 133);
    assert_eq!(timer.poll(LATER_MS, &mut seen), Ok(Polled::Idle));
}

#[test]
fn the_laser_is_off_until_the_poll_after_its_rest_and_after_a_stop() {
    let dither = Dither::new(64, 5).unwrap();
    let mut timer = dark(10, vec![1, 0]);
    let poll = |timer: &mut PhotonTimer<Ring>, now_ms| {
        timer.poll(now_ms, &mut Seen::default()).unwrap();
        timer.sampler.dither
    };
    assert_eq!(poll(&mut timer, LATER_MS), Some(Dither::OFF));
    timer.start(U16F16::from_num(BIN_PS), dither);
    assert_eq!(timer.sampler.dither, None);
    assert_eq!(poll(&mut timer, 10), None);
    assert_eq!(poll(&mut timer, 20), Some(dither));
    timer.stop();
    assert_eq!(timer.sampler.dither, None);
}

/// A laser: whether it fires, and how often it has begun.
#[derive(Clone, Default)]
struct Laser(Rc<Cell<(bool, u32)>>);

impl Sampler for Laser {
    const KEPT: u32 = 40;

    fn start(&mut self, _: &Config, _: Dither) {
        self.0.set((true, self.0.get().1 + 1));
    }

    fn stop(&mut self) {
        self.0.set((false, self.0.get().1));
    }

    fn completed(&mut self) -> u32 {
        0
    }

    fn samples(&self, _: u32) -> Samples {
        unreachable!("none is complete")
    }

    fn has_stalled(&self) -> bool {
        false
    }
}

#[test]
fn the_laser_fires_only_between_a_start_and_a_stop_and_not_once_it_is_dropped() {
    for polls in 0..10 {
        let laser = Laser::default();
        let mut timer = PhotonTimer::new(laser.clone(), Config::new(SETTINGS).unwrap());
        let poll = |timer: &mut PhotonTimer<Laser>, times| {
            for now_ms in 0..times {
                assert_eq!(timer.poll(now_ms, &mut Seen::default()), Ok(Polled::Idle));
            }
            laser.0.get()
        };
        assert_eq!(poll(&mut timer, 100), (false, 0));
        timer.start(U16F16::from_num(BIN_PS), Dither::OFF);
        let fires = polls > LATER_MS;
        let starts = u32::from(fires);
        assert_eq!(poll(&mut timer, polls), (fires, starts));
        timer.stop();
        assert_eq!(poll(&mut timer, 100), (false, starts));
        timer.start(U16F16::from_num(BIN_PS), Dither::OFF);
        assert_eq!(poll(&mut timer, polls), (fires, 2 * starts));
        drop(timer);
        assert_eq!(laser.0.get(), (false, 2 * starts));
    }
}

#[test]
fn says_what_it_is() {
    let info = timer(Vec::new(), vec![0]).info();
    assert_eq!((info.pixels, info.gives_histograms), (1, false));
    assert_eq!(info.bin_width, Some(U16F16::from_num(8000)));
    assert_eq!(info.laser_millihertz, 100_000_000);
    assert_eq!(info.most_dither, 254);
}
