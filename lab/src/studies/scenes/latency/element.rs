//! The processing element that four pixels share (sections IV-A and IV-B, Fig. 22).
//!
//! Pixels submit their histograms in turn, and continue to count. If the answer is an event, the
//! pixel is cleared at that time: photons since its histogram was submitted are dropped, and the
//! next exposure begins with the laser cycle after the answer. The paper does not say when a pixel
//! is cleared; this is our choice.
//!
//! According to the paper a look comes every X = 4 laser cycles, a histogram takes four laser
//! cycles in the element, and the element has two stages. With one histogram per stage these
//! contradict each other. X = 4 requires a new histogram each laser cycle, so four in the element
//! at once: a pipeline of four. See [`READINGS`] for the other interpretations.

use crate::studies::scenes::one_pixel::BINS;
use dtof_core::{AnyRule, Histogram, PixelConfig};

/// Pixels that share an element.
pub const PIXELS: u16 = 4;

/// The timing of a processing element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProcessingElement {
    /// Its name.
    pub name: &'static str,
    /// Laser cycles between two histograms that enter.
    pub interval: u16,
    /// Laser cycles from the entry of a histogram to its answer, at most [`Self::x`].
    pub delay: u16,
}

/// Decides immediately, as the core does.
pub const AT_ONCE: ProcessingElement = ProcessingElement::new("decided at once", 1, 0);
/// A pipeline of four laser cycles that accepts a histogram in each: X = 4.
pub const PIPELINE: ProcessingElement = ProcessingElement::new("pipeline of four", 1, 4);
/// Two stages of two laser cycles each, in parallel: X = 8.
pub const SHORT_STAGES: ProcessingElement = ProcessingElement::new("stages of two", 2, 4);
/// Two stages of four laser cycles each, in parallel: X = 16.
pub const LONG_STAGES: ProcessingElement = ProcessingElement::new("stages of four", 4, 8);
/// Possible interpretations of the paper, after the immediate decision.
pub const READINGS: [ProcessingElement; 4] = [AT_ONCE, PIPELINE, SHORT_STAGES, LONG_STAGES];

impl ProcessingElement {
    const fn new(name: &'static str, interval: u16, delay: u16) -> Self {
        assert!(delay <= PIXELS * interval, "one histogram of a pixel");
        Self {
            name,
            interval,
            delay,
        }
    }

    /// Laser cycles from one look at a pixel to the next (X).
    pub const fn x(self) -> u16 {
        PIXELS * self.interval
    }

    /// The most histograms in the element at once.
    pub const fn in_flight(self) -> u16 {
        self.delay.div_ceil(self.interval)
    }

    /// Whether the histogram of pixel `turn` enters at the end of laser cycle `cycle`.
    fn takes(self, turn: u16, cycle: u64) -> bool {
        let (interval, x) = (u64::from(self.interval), u64::from(self.x()));
        cycle % x == u64::from(turn + 1) * interval - 1
    }
}

/// A pixel that shares a processing element.
pub struct SharedPixel {
    element: ProcessingElement,
    /// Its index among the pixels of the element.
    turn: u16,
    histogram: Histogram<BINS>,
    exposure: u16,
    /// The laser cycle at whose end the answer is ready, and whether it is an event.
    answer: Option<(u64, bool)>,
}

impl SharedPixel {
    /// An empty pixel.
    pub const fn new(element: ProcessingElement, turn: u16) -> Self {
        Self {
            element,
            turn,
            histogram: Histogram::new(),
            exposure: 0,
            answer: None,
        }
    }

    /// Counts a photon.
    pub fn count(&mut self, code: u16) {
        self.histogram.add(code);
    }

    /// Ends laser cycle `cycle`. Returns whether there is an event.
    pub fn end_laser_cycle(&mut self, config: &PixelConfig<BINS, AnyRule>, cycle: u64) -> bool {
        self.exposure = self.exposure.saturating_add(1);
        if self.is_event(cycle) {
            return true;
        }
        if !self.element.takes(self.turn, cycle) || self.exposure <= config.l1() {
            return false;
        }
        if self.exposure >= config.l2() {
            self.restart();
            return false;
        }
        let is_peak = config.detect(&self.histogram).is_some();
        self.answer = Some((cycle + u64::from(self.element.delay), is_peak));
        // Without a delay the answer is ready.
        self.is_event(cycle)
    }

    /// Takes the answer if it is ready, and restarts the pixel if it is an event.
    fn is_event(&mut self, cycle: u64) -> bool {
        let answer = self.answer.take_if(|(due, _)| *due == cycle);
        let is_event = answer.is_some_and(|(_, is_event)| is_event);
        if is_event {
            self.restart();
        }
        is_event
    }

    fn restart(&mut self) {
        self.histogram.clear();
        self.exposure = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studies::scenes::one_pixel::prototype;
    use dtof_core::{AsyncPixel, LaserCycle, PixelAddress, Statistics};
    use rand_core::{Rng, SeedableRng};
    use rand_pcg::Pcg64;

    /// Laser cycles until each of the first three events of each pixel, with a photon in
    /// every laser cycle.
    fn events(element: ProcessingElement, l1: u16) -> [[u64; 3]; 4] {
        let config = prototype(l1).unwrap();
        [0, 1, 2, 3].map(|turn| {
            let mut pixel = SharedPixel::new(element, turn);
            let events = (0..1000).filter(|&cycle| {
                pixel.count(60);
                pixel.end_laser_cycle(&config, cycle)
            });
            let mut ends = events.map(|cycle| cycle + 1);
            std::array::from_fn(|_| ends.next().unwrap())
        })
    }

    /// After power-up a pixel waits for its turn; the time between events is constant.
    #[test]
    fn first_events_and_the_next_come_when_the_turn_says() {
        let firsts = READINGS.map(|element| events(element, 40).map(|ends| ends[0]));
        assert_eq!(firsts[0], [41, 42, 43, 44]);
        assert_eq!(firsts[1], [45, 46, 47, 48]);
        assert_eq!(firsts[2], [46, 48, 50, 52]);
        assert_eq!(firsts[3], [60, 64, 52, 56]);
        let periods = |l1| READINGS.map(|element| events(element, l1)[0].map(|end| end));
        let apart = |l1| periods(l1).map(|[_, second, third]| third - second);
        assert_eq!(apart(40), [44, 48, 48, 64]);
        assert_eq!(apart(20), [24, 28, 32, 32]);
    }

    /// X = 4 takes four histograms in the element at once.
    #[test]
    fn looks_and_histograms_in_the_element_are_those_of_each_reading() {
        let looks = READINGS.map(|element| (element.x(), element.in_flight()));
        assert_eq!(looks, [(4, 0), (4, 4), (8, 2), (16, 2)]);
        // At most one histogram enters in a laser cycle.
        for element in READINGS {
            for cycle in 0..64 {
                let taken = (0..PIXELS).filter(|&turn| element.takes(turn, cycle));
                let is_one = (cycle + 1) % u64::from(element.interval) == 0;
                assert_eq!(taken.count(), usize::from(is_one));
            }
        }
    }

    /// The fourth pixel's turn is the end of each fourth laser cycle, as in the core. With
    /// the pipeline its first event is later by the delay, whatever the photons.
    #[test]
    fn decided_at_once_it_is_the_core_and_a_look_in_vain_costs_nothing() {
        let config = prototype(40).unwrap();
        let mut rng = Pcg64::seed_from_u64(1);
        for case in 0..50 {
            let mut core = AsyncPixel::<BINS>::new(PixelAddress::new(0));
            let [mut at_once, mut pipeline] =
                [AT_ONCE, PIPELINE].map(|element| SharedPixel::new(element, 3));
            let mut statistics = Statistics::new();
            let (mut first, mut delayed) = (None, None);
            for cycle in 0..10_000u64 {
                // A background photon in half of the laser cycles, a signal photon in one of 2 to 20.
                let code = (rng.next_u32() % 256) as u16;
                let is_signal = rng.next_u32() % (2 + case % 19) == 0;
                for code in [Some(code), is_signal.then_some(60)].into_iter().flatten() {
                    if code < 128 {
                        core.count(&config, code);
                        at_once.count(code);
                        pipeline.count(code);
                    }
                }
                core.end_laser_cycle(&config, &mut statistics, LaserCycle::new(cycle));
                let is_event = core.take_event().is_some();
                assert_eq!(is_event, at_once.end_laser_cycle(&config, cycle));
                if is_event {
                    first.get_or_insert(cycle);
                }
                if pipeline.end_laser_cycle(&config, cycle) {
                    delayed.get_or_insert(cycle);
                }
            }
            assert!(first.is_some());
            assert_eq!(delayed, first.map(|first| first + 4));
        }
    }
}
