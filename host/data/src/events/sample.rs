//! A sample of a run's events that has a bounded size.
//!
//! It keeps all events as long as there are few. At the limit, every other one is dropped, and from
//! then on one of two is kept, then one of four, and so on. The choice depends only on the number
//! of an event, so the same run gives the same sample.
//!
//! The choice follows multiples of the golden ratio. They spread evenly: of k in a row, none, one
//! or two are kept. Keeping every k-th would show as stripes in step with the columns of an array.

use dtof_core::{BlockLevel, DepthEvent, EchoNumber, Flags, PixelAddress};

/// The sampled fields of an event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledEvent {
    /// The laser cycle.
    pub cycle: u64,
    /// The pixel, or the first of the block.
    pub pixel: PixelAddress,
    /// [`BlockLevel::PIXEL`], or the level of the block.
    pub level: BlockLevel,
    /// The number of the echo in its exposure.
    pub echo: EchoNumber,
    /// The range in millimetres.
    pub range_mm: f64,
    /// The exposure in laser cycles.
    pub exposure: u16,
    /// The photons of its peak.
    pub peak_count: u32,
    /// The flags.
    pub flags: Flags,
}

/// An even sample: one of 1, 2, 4 … events.
#[derive(Clone, Debug)]
pub struct Sample {
    limit: usize,
    halvings: u32,
    seen: u64,
    /// Each event with its place in 0..2⁶⁴.
    kept: Vec<(u64, SampledEvent)>,
}

impl Sample {
    /// The most events of a report; they take 13 MB of memory.
    pub const LIMIT: usize = 1 << 18;

    /// Keeps at most `limit` events.
    #[must_use]
    pub fn new(limit: usize) -> Self {
        Self {
            limit,
            halvings: 0,
            seen: 0,
            kept: Vec::new(),
        }
    }

    /// Samples the next event.
    pub fn add(&mut self, event: &DepthEvent, range_mm: f64) {
        // 2⁶⁴ divided by the golden ratio, made odd.
        let place = self.seen.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.seen += 1;
        if place.leading_zeros() < self.halvings {
            return;
        }
        if self.kept.len() == self.limit {
            self.halve();
            if place.leading_zeros() < self.halvings || self.kept.len() == self.limit {
                return;
            }
        }
        let event = SampledEvent {
            cycle: event.cycle.raw(),
            pixel: event.pixel,
            level: event.level,
            echo: event.echo,
            range_mm,
            exposure: event.exposure,
            peak_count: event.peak_count.raw(),
            flags: event.flags,
        };
        self.kept.push((place, event));
    }

    fn halve(&mut self) {
        self.halvings += 1;
        let halvings = self.halvings;
        self.kept
            .retain(|(place, _)| place.leading_zeros() >= halvings);
    }

    /// Lowers the limit.
    pub fn limit(&mut self, limit: usize) {
        self.limit = self.limit.min(limit);
        while self.kept.len() > self.limit {
            self.halve();
        }
    }

    /// k, if one of k events is kept: a power of two.
    #[must_use]
    pub fn one_of(&self) -> u64 {
        1 << self.halvings
    }

    /// The number of events seen.
    #[must_use]
    pub fn seen(&self) -> u64 {
        self.seen
    }

    /// The events that were kept, in the order they came.
    #[must_use]
    pub fn events(&self) -> impl ExactSizeIterator<Item = &SampledEvent> {
        self.kept.iter().map(|(_, event)| event)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::events::fixtures;

    fn event(number: u64) -> DepthEvent {
        fixtures::event(u16::try_from(number % 64).unwrap(), number, 3)
    }

    fn sampled(limit: usize, events: u64) -> Sample {
        let mut sample = Sample::new(limit);
        for number in 0..events {
            sample.add(&event(number), 1.5);
            assert!(sample.events().len() <= limit);
        }
        assert_eq!(sample.seen(), events);
        sample
    }

    #[test]
    fn up_to_the_limit_all_are_kept() {
        let sample = sampled(100, 100);
        assert_eq!(sample.one_of(), 1);
        assert!(sample.events().map(|event| event.cycle).eq(0..100));
        assert!(sample.events().all(|event| event.range_mm == 1.5));
    }

    #[test]
    fn a_lower_limit_keeps_evenly_as_many_as_it_can() {
        for events in [0, 50, 100, 101, 5000] {
            for limit in [100, 99, 25] {
                let mut sample = sampled(200, events);
                sample.limit(limit);
                let kept = sample.events().len();
                assert!(kept <= limit);
                assert!(events <= limit as u64 && kept as u64 == events || kept * 9 >= limit * 4);
                let expected = events / sample.one_of();
                assert!((kept as u64).abs_diff(expected) <= 2, "{kept}");
                sample.limit(1000);
                sample.add(&event(events), 1.5);
                assert!(sample.events().len() <= limit, "it stays");
            }
        }
    }

    #[test]
    fn beyond_it_one_of_k_is_kept_at_every_time_and_of_every_column() {
        for events in [101, 1000, 12_345, 100_000] {
            let sample = sampled(100, events);
            let kept = sample.events().len() as u64;
            let expected = events / sample.one_of();
            assert!(kept.abs_diff(expected) <= 2, "{kept} of {events}");
            assert!(kept >= 45, "{kept} of {events}");
            let cycles: Vec<u64> = sample.events().map(|event| event.cycle).collect();
            let longest = cycles.windows(2).map(|pair| pair[1] - pair[0]).max();
            assert!(longest.unwrap() < 3 * sample.one_of());
        }
        let sample = sampled(1000, 64_000);
        assert!(sample.one_of() >= 64);
        for column in 0..64 {
            let kept = sample.events().filter(|event| event.pixel.raw() == column);
            assert!((4..32).contains(&kept.count()), "column {column}");
        }
    }
}
