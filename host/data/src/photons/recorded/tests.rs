use std::convert::Infallible;

use super::*;
use rand_core::TryRng;

/// These numbers as if they were random.
pub struct Numbers<I>(pub I);

impl<I: Iterator<Item = u64>> TryRng for Numbers<I> {
    type Error = Infallible;

    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        Ok((self.try_next_u64()? >> 32) as u32)
    }

    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        Ok(self.0.next().expect("all numbers were taken"))
    }

    fn try_fill_bytes(&mut self, _bytes: &mut [u8]) -> Result<(), Infallible> {
        unreachable!("numbers are taken one by one")
    }
}

/// Pixels in a row.
fn recorded(pixels: Vec<Vec<u64>>, cycles: u64, seed: u64) -> Result<RecordedHistograms> {
    let array = Array::new(u32::try_from(pixels.len())?, 1).unwrap();
    let length = RecordingLength::Cycles(cycles);
    RecordedHistograms::new(array, &Histograms::of(pixels)?, length, u64::MAX, seed)
}

fn replay(counts: &[u64], cycles: u64) -> Vec<Photon> {
    let mut source = recorded(vec![counts.to_vec()], cycles, 7).unwrap();
    let slice = source.next_slice(u16::MAX).unwrap();
    assert_eq!(u64::from(slice.pixels[0].cycles), cycles);
    slice.pixels[0].photons.clone()
}

#[test]
fn every_recorded_photon_is_used_exactly_once() {
    for counts in [
        [3, 0, 500, 1, 0, 0, 77, 2],
        [0, 0, 0, 0, 1, 0, 0, 0],
        [0; 8],
    ] {
        let photons = replay(&counts, 100);
        let mut replayed = [0; 8];
        for photon in &photons {
            replayed[usize::from(photon.code)] += 1;
        }
        assert_eq!(replayed, counts);
        assert!(photons.is_sorted_by_key(|photon| photon.cycle));
    }
}

/// Two captures, one of which ends first. With a dead time no photon is in that of another.
#[test]
fn slices_of_any_length_hold_the_same_photons() {
    let photons = |dead_time: u16, lengths: &[u16]| {
        let captures = Histograms::of([700, 90].map(|count| vec![count; 8])).unwrap();
        let length = RecordingLength::PhotonsPerCycle(0.9);
        let array = Array::new(1, 1).unwrap();
        let source = RecordedHistograms::new(array, &captures, length, u64::MAX, 3).unwrap();
        let source = source.with_dead_time(&captures, &[], dead_time);
        let mut source = source.unwrap();
        let (shortest, longest) = source.recorded_cycles().unwrap();
        assert_eq!(source.cycles_left(), [longest, shortest]);
        let mut all = [(); 2].map(|()| Vec::new());
        for &length in lengths.iter().cycle().take(9_000) {
            let before = source.not_replayed();
            let slice = source.next_slice(length).unwrap();
            let mut given = 0;
            for (all, pixel) in all.iter_mut().zip(&slice.pixels) {
                given += pixel.photons.len() as u64;
                let at = |photon: &Photon| {
                    assert!(photon.cycle < pixel.cycles && pixel.cycles <= length);
                    (slice.first_cycle + u64::from(photon.cycle), photon.code)
                };
                all.extend(pixel.photons.iter().map(at));
            }
            assert_eq!(source.not_replayed() + given, before);
        }
        assert_eq!(source.not_replayed(), 0);
        all
    };
    let photons_of = |dead_time| {
        let expected = photons(dead_time, &[7000]);
        assert_eq!([expected[0].len(), expected[1].len()], [5600, 720]);
        for lengths in [&[1][..], &[256], &[3, 2048, 1, 700], &[2049]] {
            assert!(photons(dead_time, lengths) == expected, "{lengths:?}");
        }
        expected
    };
    let is_apart = |pair: &[(u64, u16)]| pair[0].0 < pair[1].0 || pair[0].1 + 3 < pair[1].1;
    let are_apart = |pixel: &Vec<(u64, u16)>| pixel.windows(2).all(is_apart);
    assert!(!photons_of(0).iter().any(are_apart));
    assert!(photons_of(3).iter().all(are_apart));
}

/// In 40 of 100 laser cycles the TDC was live in bin 2, if photons in bin 0 had blinded it.
#[test]
fn photons_in_the_dead_time_of_others_are_refused() {
    let array = Array::new(2, 1).unwrap();
    let captures = [[60, 40], [60, 41]].map(|[first, third]| {
        let right = vec![0, 100, 0, 0, 0, 0, 0, 0];
        [right, vec![first, 0, third, 0, 0, 0, 0, 0]]
    });
    let captures = Histograms::of(captures.into_iter().flatten()).unwrap();
    let refused = |masked: &[u16], dead_time| {
        let length = RecordingLength::Cycles(100);
        let source = RecordedHistograms::new(array, &captures, length, 100, 1).unwrap();
        let source = source.with_dead_time(&captures, masked, dead_time);
        source.err().map(|error| error.to_string())
    };
    assert_eq!(
        refused(&[1], 2).as_deref(),
        Some(
            "dead_time 2: bin 2 of pixel 3 has 41 photons, but was live in 40 of 100 laser cycles; give the laser \
             cycles with recorded_cycles, a shorter dead time, or leave the pixel out with masked 3"
        )
    );
    assert_eq!(refused(&[3], 2), None);
    assert_eq!(refused(&[], 1), None);
}

#[test]
fn captures_follow_each_other() {
    let array = Array::new(3, 2).unwrap();
    let captures = [2, 6].map(|count| vec![vec![count; 8]; 6]);
    let captures = Histograms::of(captures.into_iter().flatten()).unwrap();
    let length = RecordingLength::Cycles(50);
    let source = RecordedHistograms::new(array, &captures, length, 40, 1).unwrap();
    assert_eq!(source.axis_names(), ["column", "row"]);
    let source = source.with_axis_names(["zone", "subcapture"]);
    assert_eq!(source.axis_names(), ["zone", "subcapture"]);
    assert_eq!(source.array(), Array::new(3, 4).unwrap());
    assert_eq!(source.capture_rows(), 2);
    let addresses: Vec<_> = (0..12).map(PixelAddress::new).collect();
    assert_eq!(source.addresses(), addresses);
    assert_eq!(source.cycles(), 40);
    assert_eq!(source.recorded_cycles(), Some((50, 50)));
    // Of 6 pixels with 16 photons and 6 with 48.
    assert!((source.photons_per_cycle() - 384.0 / 50.0).abs() < 1e-9);
    assert_eq!(source.not_replayed(), 384);
}

#[test]
fn photons_of_pixels_that_are_not_needed_are_left_out() {
    let mut all = recorded(vec![vec![100; 8]; 3], 1000, 1).unwrap();
    let mut limited = all.clone();
    limited.limit_to(&|address| address.raw() == 1);
    let all = all.next_slice(1000).unwrap().pixels;
    let limited = limited.next_slice(1000).unwrap().pixels;
    let nothing = PixelPhotons::default();
    assert_eq!(limited, [nothing.clone(), all[1].clone(), nothing]);
}

/// The chunks of a recording hold about four million photons.
#[test]
fn chunks_are_shorter_if_there_are_many_photons() {
    for (photons_per_cycle, cycles) in [
        (0.0, 2048),
        (1953.125, 2048),
        (1954.0, 2047),
        (4e3, 1000),
        (3e6, 1),
        (5e7, 1),
    ] {
        assert_eq!(chunk(photons_per_cycle), cycles, "{photons_per_cycle}");
    }
}

#[test]
fn equal_pixels_and_other_seeds_receive_other_photons() {
    let photons = |seed| {
        let mut source = recorded(vec![vec![100; 8]; 2], 1000, seed).unwrap();
        source.next_slice(1000).unwrap().pixels
    };
    let (one, other) = (photons(1), photons(2));
    let all = [&one[0], &one[1], &other[0], &other[1]];
    for (index, pixel) in all.iter().enumerate() {
        assert_eq!(pixel.photons.len(), 800);
        assert!(all[..index].iter().all(|before| before != pixel));
    }
}

/// Nothing shows the length of a capture without photons, and no request for all laser cycles makes it endless.
#[test]
fn a_capture_without_photons_is_as_long_as_the_longest_other() {
    let array = Array::new(1, 1).unwrap();
    let length = RecordingLength::PhotonsPerCycle(0.5);
    let captures =
        |counts: &[u64]| Histograms::of(counts.iter().map(|&count| vec![count; 8])).unwrap();
    let cycles = |captures: &Histograms, cycles| {
        let photons = RecordedHistograms::new(array, captures, length, cycles, 1).unwrap();
        (photons.cycles(), photons.recorded_cycles())
    };
    let [all, only_dark, dim] = [&[5, 0, 700][..], &[0], &[5]].map(captures);
    assert_eq!(cycles(&all, u64::MAX), (11_200, Some((80, 11_200))));
    assert_eq!(cycles(&all, 100), (100, Some((80, 11_200))));
    assert_eq!(
        cycles(&only_dark, u64::MAX),
        (10_000, Some((10_000, 10_000)))
    );
    assert_eq!(cycles(&only_dark, 300), (300, Some((300, 300))));
    // Neither do masked pixels show it.
    let masked = RecordedHistograms::with_masked(array, &dim, length, u64::MAX, 1, &[0]);
    assert_eq!(masked.unwrap().cycles(), 10_000);
}

/// Addresses go on from capture to capture: none is left out between them.
#[test]
fn pixels_of_later_captures_have_the_next_addresses() {
    let array = Array::new(2, 1).unwrap();
    let length = RecordingLength::PhotonsPerCycle(1.0);
    let captures = Histograms::of([10, 20, 30, 40, 50, 60].map(|n| vec![n; 8])).unwrap();
    let photons = |masked: &[u16]| {
        RecordedHistograms::with_masked(array, &captures, length, u64::MAX, 1, masked).unwrap()
    };
    let all = photons(&[]);
    for (address, pixel) in (0..).zip(&all.pixels) {
        assert_eq!(pixel.rng, pixel_rng(1, PixelAddress::new(address)));
    }
    // The last pixel is the brightest of its capture.
    assert_eq!(all.recorded_cycles(), Some((160, 480)));
    assert_eq!(photons(&[5]).recorded_cycles(), Some((160, 400)));
}

#[test]
fn what_cannot_be_counted_or_does_not_fit_into_memory_is_refused() {
    use RecordingLength::{Cycles, PhotonsPerCycle};
    let refused = |count, length| {
        let captures = Histograms::of([vec![count, 0, 0, 0, 0, 0, 0, count]]).unwrap();
        let array = Array::new(1, 1).unwrap();
        let source = RecordedHistograms::new(array, &captures, length, u64::MAX, 1);
        source.err().map(|error| error.to_string())
    };
    let most = 1 << 40;
    let most_a_cycle = 25_000_000;
    let photons = "pixel 0 holds more than 2^40 photons";
    let cycles = "recorded_cycles 1099511627777: must be at most 2^40";
    let rate = "photons_per_cycle 0.5: makes the recording longer than 2^40 laser cycles";
    let memory = "50000002 photons a laser cycle are more than 50000000";
    for (count, length, reason) in [
        (most / 2, Cycles(most), None),
        (most / 2 + 1, Cycles(most), Some(photons)),
        (u64::MAX, Cycles(most), Some(photons)),
        (1, Cycles(most + 1), Some(cycles)),
        (most / 4, PhotonsPerCycle(0.5), None),
        (most / 4 + 1, PhotonsPerCycle(0.5), Some(rate)),
        (most_a_cycle, Cycles(1), None),
        (most_a_cycle + 1, Cycles(1), Some(memory)),
    ] {
        assert_eq!(
            refused(count, length).as_deref(),
            reason,
            "{count} {length:?}"
        );
    }
}

#[test]
fn photons_fall_evenly_over_the_laser_cycles_whatever_their_bin() {
    // 100,000 photons over 10 laser cycles: 5,000 a bin and laser cycle in
    // two bins, standard deviation 67; five of them are 335.
    let mut cells = [[0i64; 2]; 10];
    for photon in replay(&[50_000, 0, 0, 0, 0, 0, 0, 50_000], 10) {
        cells[usize::from(photon.cycle)][usize::from(photon.code) / 7] += 1;
    }
    for cell in cells.as_flattened() {
        assert!((cell - 5_000).abs() < 335, "{cells:?}");
    }
}

#[test]
fn captures_that_no_array_holds_are_refused() {
    let refused = |pixels: usize| {
        let most = Array::new(256, 256).unwrap();
        let histograms = Histograms::of(repeat_n(vec![1; 8], pixels)).unwrap();
        let refused =
            RecordedHistograms::new(most, &histograms, RecordingLength::Cycles(10), 10, 1);
        refused.unwrap_err().to_string()
    };
    assert_eq!(refused(2 * 65_536), "more than 65,536 pixels");
    assert_eq!(refused(65_535), "a capture does not have 65536 histograms");
    assert_eq!(refused(0), "no captures");
}

/// A hot pixel that is masked does not count for the length. Each of two captures has its own
/// length.
#[test]
fn masked_pixels_do_not_set_the_length() {
    let array = Array::new(3, 1).unwrap();
    let totals = [[10, 5000, 20], [40, 3, 7]].into_iter().flatten();
    let captures = Histograms::of(totals.map(|total| vec![total; 8])).unwrap();
    let length = |masked: &[u16]| {
        let length = RecordingLength::PhotonsPerCycle(0.5);
        let source = RecordedHistograms::with_masked(array, &captures, length, u64::MAX, 1, masked);
        source.unwrap().recorded_cycles()
    };
    assert_eq!(length(&[]), Some((640, 80_000)));
    assert_eq!(length(&[1]), Some((320, 640)));
    assert_eq!(length(&[1, 3]), Some((112, 320)));
}
