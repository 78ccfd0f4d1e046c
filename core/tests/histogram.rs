//! The histogram loses nothing without counting it.

use dtof_core::{Count8, Count10, Count16, Count24, CounterWidth, Histogram, RangeGate};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// A histogram as one would count by hand.
struct Naive {
    counts: Vec<u32>,
    full: u32,
    saturated: u32,
    rejected: u32,
    gated_out: u32,
}

impl Naive {
    fn new(bins: usize, full: u32) -> Self {
        Self {
            counts: vec![0; bins],
            full,
            saturated: 0,
            rejected: 0,
            gated_out: 0,
        }
    }

    fn add(&mut self, code: u16) {
        let code = usize::from(code);
        if code >= self.counts.len() {
            self.rejected += 1;
        } else if self.counts[code] == self.full {
            self.saturated += 1;
        } else {
            self.counts[code] += 1;
        }
    }

    fn add_gated(&mut self, code: u16, first: u16, last: u16) {
        if code < first || code > last {
            self.gated_out += 1;
        } else {
            self.add(code);
        }
    }

    /// The lowest of the highest bins, and its count.
    fn peak(&self) -> (u16, u32) {
        let count = self.counts.iter().copied().max().unwrap();
        let bin = self.counts.iter().position(|&c| c == count).unwrap();
        (bin as u16, count)
    }

    fn assert_same<const BINS: usize, W: CounterWidth>(&self, histogram: &Histogram<BINS, W>) {
        let counts: Vec<u32> = histogram.counts().iter().map(|&c| c.into()).collect();
        assert_eq!(counts, self.counts);
        assert_eq!(histogram.total(), self.counts.iter().sum::<u32>());
        assert_eq!(histogram.saturated(), self.saturated);
        assert_eq!(histogram.rejected(), self.rejected);
        let peak = histogram.peak();
        assert_eq!((peak.bin.raw(), peak.count.raw()), self.peak());
    }
}

fn every_code<const BINS: usize>() {
    for code in 0..=u16::MAX {
        let mut histogram = Histogram::<BINS>::new();
        histogram.add(code);
        if usize::from(code) < BINS {
            assert_eq!((histogram.total(), histogram.rejected()), (1, 0));
            assert_eq!(histogram.count(code.into()), Some(1));
        } else {
            assert_eq!((histogram.total(), histogram.rejected()), (0, 1));
            assert_eq!(histogram.count(code.into()), None);
            assert!(histogram.counts().iter().all(|&count| count == 0));
        }
    }
}

#[test]
fn every_code_is_counted_in_its_bin_or_rejected() {
    every_code::<8>();
    every_code::<128>();
    every_code::<1024>();
}

/// Counts on to `past` photons beyond full, photon by photon.
fn fill_one_bin<W: CounterWidth>(full: u32, past: u32) {
    let mut histogram = Histogram::<8, W>::new();
    for photon in 1..=full + past {
        histogram.add(3);
        let expected = photon.min(full);
        assert_eq!(histogram.count(3), Some(expected));
        assert_eq!(histogram.total(), expected);
        assert_eq!(histogram.saturated(), photon - expected);
    }
    assert_eq!(histogram.peak().count.raw(), full);
}

#[test]
fn counters_of_8_10_16_and_24_bits_stop_when_they_are_full() {
    fill_one_bin::<Count8>(255, 100);
    fill_one_bin::<Count10>(1023, 100);
    fill_one_bin::<Count16>(65_535, 100);
    fill_one_bin::<Count24>(16_777_215, 100);
}

#[test]
fn photons_offered_are_counted_saturated_or_rejected() {
    let mut rng = Pcg32::seed_from_u64(1);
    for _ in 0..100 {
        let mut histogram = Histogram::<8>::new();
        let mut naive = Naive::new(8, 1023);
        // Two favoured bins fill up, two codes in ten are past the last bin.
        for offered in 1..=6000 {
            let code = [0, 1, 2, 3, 4, 5, 5, 7, 8, 65_535][rng.next_u32() as usize % 10];
            let code = if rng.next_u32() % 2 == 0 { 6 } else { code };
            histogram.add(code);
            naive.add(code);
            let lost = histogram.saturated() + histogram.rejected();
            assert_eq!(histogram.total() + lost, offered);
        }
        assert!(histogram.saturated() > 0 && histogram.rejected() > 0);
        naive.assert_same(&histogram);
    }
}

/// A frame at once against its photons one at a time, over frames and gates.
fn frames_against_photons<const BINS: usize>(rounds: u32, seed: u64) {
    let mut rng = Pcg32::seed_from_u64(seed);
    for _ in 0..rounds {
        let width = 8 + rng.next_u32() % (BINS as u32 - 7);
        let first = (rng.next_u32() % (BINS as u32 - width + 1)) as u16;
        let last = first + width as u16 - 1;
        let gate = RangeGate::new(first, last).unwrap();
        let mut histogram = Histogram::<BINS>::new();
        let mut naive = Naive::new(BINS, 1023);
        for _ in 0..4 {
            let mut frame = [0u16; BINS];
            frame.fill_with(|| match rng.next_u32() % 8 {
                0 => 500, // three of four fill a counter
                1 => (rng.next_u32() % 5) as u16,
                _ => 0,
            });
            let before = naive.gated_out;
            for (bin, &photons) in (0..).zip(&frame) {
                for _ in 0..photons {
                    naive.add_gated(bin, first, last);
                }
            }
            let gated_out = histogram.add_frame(&frame, &gate);
            assert_eq!(gated_out, naive.gated_out - before);
            naive.assert_same(&histogram);
        }
    }
}

#[test]
fn a_frame_is_its_photons_one_at_a_time() {
    frames_against_photons::<8>(3000, 2);
    frames_against_photons::<128>(300, 3);
    frames_against_photons::<1024>(30, 4);
}

#[test]
fn a_frame_may_be_of_bytes_or_words() {
    let frame = [0u8, 1, 2, 255, 4, 5, 6, 7];
    let (mut bytes, mut words) = (Histogram::<8>::new(), Histogram::<8>::new());
    bytes.add_frame(&frame, &RangeGate::full());
    words.add_frame(&frame.map(u32::from), &RangeGate::full());
    for histogram in [bytes, words] {
        assert_eq!(histogram.counts(), &frame.map(u16::from));
        assert_eq!(histogram.peak().bin.raw(), 3);
    }
}

#[test]
fn extreme_frames_fill_every_counter_and_stick() {
    let mut histogram = Histogram::<16, Count24>::new();
    let gate = RangeGate::new(0, 7).unwrap();
    let gated_out = histogram.add_frame(&[u32::MAX; 16], &gate);
    assert_eq!(gated_out, u32::MAX); // 8 · u32::MAX
    assert_eq!(histogram.total(), 8 * 16_777_215);
    assert_eq!(histogram.saturated(), u32::MAX);
    assert_eq!(histogram.count(7), Some(16_777_215));
    assert_eq!(histogram.count(8), Some(0));
    // The largest total there is: 256 bins of 24 bits.
    let mut histogram = Histogram::<256, Count24>::new();
    histogram.add_frame(&[0x00ff_ffffu32; 256], &RangeGate::full());
    assert_eq!(histogram.total(), u32::MAX - 255);
    assert_eq!(histogram.saturated(), 0);
}

#[test]
fn a_cleared_histogram_counts_like_a_new_one() {
    let mut histogram = Histogram::<8>::new();
    for _ in 0..1100 {
        histogram.add_batch(&[2, 3, 3, 9]);
    }
    assert!(histogram.saturated() > 0 && histogram.rejected() > 0);
    histogram.clear();
    let mut naive = Naive::new(8, 1023);
    naive.assert_same(&histogram);
    for code in [7, 7, 1, 8] {
        histogram.add(code);
        naive.add(code);
    }
    naive.assert_same(&histogram);
}

/// Bins and counters as wide as a key allows, so that the key of one count more
/// would not fit it.
#[test]
fn full_counters_of_24_bits_stay_full() {
    let full = 0x00ff_ffff;
    let codes = [255, 0, 7, 254, 0, 1, 0, 255, 9, 0];
    let mut frame = [full - 1; 256];
    let mut single = Histogram::<256, Count24>::new();
    let mut batched = Histogram::<256, Count24>::new();
    single.add_frame(&frame, &RangeGate::full());
    batched.add_frame(&frame, &RangeGate::full());
    for code in codes {
        single.add(code);
        frame[usize::from(code)] += 1;
    }
    batched.add_batch(&codes);
    for histogram in [single, batched] {
        assert_eq!(histogram.counts(), &frame.map(|count| count.min(full)));
        assert_eq!(histogram.saturated(), 4); // three of bin 0, one of bin 255
        assert_eq!(histogram.total(), 256 * (full - 1) + 6);
        let peak = histogram.peak();
        assert_eq!((peak.bin.raw(), peak.count.raw()), (0, full));
    }
}

#[test]
fn it_takes_the_memory_it_says() {
    assert_eq!(size_of::<Histogram<128>>(), 128 * 2 + 16);
    assert_eq!(size_of::<Histogram<128, Count8>>(), 128 + 16);
    assert_eq!(size_of::<Histogram<128, Count16>>(), 128 * 2 + 16);
    assert_eq!(size_of::<Histogram<128, Count24>>(), 128 * 4 + 16);
}

proptest! {
    #[test]
    fn any_codes_one_at_a_time_or_in_batches(
        batches in prop::collection::vec(prop::collection::vec(0u16..40, 0..50), 0..20),
    ) {
        let mut naive = Naive::new(32, 1023);
        let mut single = Histogram::<32>::new();
        let mut batched = Histogram::<32>::new();
        for codes in &batches {
            batched.add_batch(codes);
            for &code in codes {
                single.add(code);
                naive.add(code);
            }
        }
        naive.assert_same(&single);
        naive.assert_same(&batched);
    }
}
