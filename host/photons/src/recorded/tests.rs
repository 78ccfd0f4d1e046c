use std::slice::from_ref;

use super::*;

/// A capture of pixels in a row.
fn recorded(capture: Capture, cycles: u64, seed: u64) -> Result<RecordedHistograms> {
    let array = Array::new(u32::try_from(capture.len())?, 1).unwrap();
    let length = RecordingLength::Cycles(cycles);
    RecordedHistograms::new(array, &[capture], length, u64::MAX, seed)
}

fn replay(counts: &[u64], cycles: u64) -> Vec<Photon> {
    let mut source = recorded(vec![counts.to_vec()], cycles, 7).unwrap();
    let slice = source.next_slice(u16::MAX).unwrap();
    assert_eq!(u64::from(slice.pixels[0].cycles), cycles);
    slice.pixels[0].photons.clone()
}

#[test]
fn every_recorded_photon_is_used_exactly_once() {
    let counts = [3, 0, 500, 1, 0, 0, 77, 2];
    let photons = replay(&counts, 100);
    let mut replayed = [0; 8];
    for photon in &photons {
        replayed[usize::from(photon.code)] += 1;
    }
    assert_eq!(replayed, counts);
    assert!(photons.is_sorted_by_key(|photon| photon.cycle));
}

/// Two captures, one of which ends first.
#[test]
fn slices_of_any_length_hold_the_same_photons() {
    let photons = |lengths: &[u16]| {
        let captures = [vec![vec![700; 8]], vec![vec![90; 8]]];
        let length = RecordingLength::PhotonsPerCycle(0.9);
        let array = Array::new(1, 1).unwrap();
        let mut source = RecordedHistograms::new(array, &captures, length, u64::MAX, 3).unwrap();
        let mut all = [(); 2].map(|()| Vec::new());
        for &length in lengths.iter().cycle().take(9_000) {
            let before = source.not_replayed();
            let slice = source.next_slice(length).unwrap();
            let mut given = 0;
            for (all, pixel) in all.iter_mut().zip(&slice.pixels) {
                given += pixel.photons.len() as u64;
                let at = |photon: &Photon| {
                    assert!(photon.cycle < pixel.cycles);
                    (slice.first_cycle + u64::from(photon.cycle), photon.code)
                };
                all.extend(pixel.photons.iter().map(at));
            }
            assert_eq!(source.not_replayed() + given, before);
        }
        assert_eq!(source.not_replayed(), 0);
        all
    };
    let expected = photons(&[7000]);
    assert_eq!([expected[0].len(), expected[1].len()], [5600, 720]);
    for lengths in [&[1][..], &[256], &[3, 2048, 1, 700], &[2049]] {
        assert!(photons(lengths) == expected, "{lengths:?}");
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
    let cycles = |captures: &[Capture], cycles| {
        let photons = RecordedHistograms::new(array, captures, length, cycles, 1).unwrap();
        (photons.cycles(), photons.recorded_cycles())
    };
    let [dark, dim, bright] = [0, 5, 700].map(|count| vec![vec![count; 8]]);
    let all = [dim.clone(), dark.clone(), bright];
    assert_eq!(cycles(&all, u64::MAX), (11_200, Some((80, 11_200))));
    assert_eq!(cycles(&all, 100), (100, Some((80, 11_200))));
    let only_dark = [dark];
    assert_eq!(
        cycles(&only_dark, u64::MAX),
        (10_000, Some((10_000, 10_000)))
    );
    assert_eq!(cycles(&only_dark, 300), (300, Some((300, 300))));
    // Neither do masked pixels show it.
    let dim = from_ref(&dim);
    let masked = RecordedHistograms::with_masked(array, dim, length, u64::MAX, 1, &[0]);
    assert_eq!(masked.unwrap().cycles(), 10_000);
}

/// Addresses go on from capture to capture: none is left out between them.
#[test]
fn pixels_of_later_captures_have_the_next_addresses() {
    let array = Array::new(2, 1).unwrap();
    let length = RecordingLength::PhotonsPerCycle(1.0);
    let captures = [[10, 20], [30, 40], [50, 60]].map(|pair| pair.map(|n| vec![n; 8]).to_vec());
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
fn what_does_not_fit_into_memory_is_refused() {
    let refused = |count: u64, cycles| recorded(vec![vec![count; 8]], cycles, 1).is_err();
    assert!(refused(1 << 38, 1 << 40));
    assert!(refused(1 << 30, 1));
    assert!(refused(1, (1 << 40) + 1));
    assert!(!refused(1 << 30, 1 << 20));
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
    let refused = |captures: &[Capture]| {
        let most = Array::new(256, 256).unwrap();
        let refused = RecordedHistograms::new(most, captures, RecordingLength::Cycles(10), 10, 1);
        refused.unwrap_err().to_string()
    };
    let capture = vec![vec![1; 8]; 65_536];
    assert_eq!(
        refused(&[capture.clone(), capture]),
        "more than 65,536 pixels"
    );
    assert_eq!(
        refused(&[vec![]]),
        "a capture does not have 65536 histograms"
    );
    assert_eq!(refused(&[]), "no captures");
}

/// A hot pixel that is masked does not count for the length. Each of two captures has its own
/// length.
#[test]
fn masked_pixels_do_not_set_the_length() {
    let array = Array::new(3, 1).unwrap();
    let row = |totals: [u64; 3]| totals.map(|total| vec![total; 8]).to_vec();
    let captures = [row([10, 5000, 20]), row([40, 3, 7])];
    let length = |masked: &[u16]| {
        let length = RecordingLength::PhotonsPerCycle(0.5);
        let source = RecordedHistograms::with_masked(array, &captures, length, u64::MAX, 1, masked);
        source.unwrap().recorded_cycles()
    };
    assert_eq!(length(&[]), Some((640, 80_000)));
    assert_eq!(length(&[1]), Some((320, 640)));
    assert_eq!(length(&[1, 3]), Some((112, 320)));
}
