use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use proptest::option;
use proptest::prelude::*;

use super::*;
use crate::photons::input::NpyArray;
use crate::photons::npy::header;
use crate::photons::npy::records::RecordReader;
use crate::photons::photon_csv::CsvReader;

const SHAPE: ListOptions = ListOptions {
    bins: 128,
    rebin: 1,
    columns: None,
    once_per_bin: false,
};

fn csv(photons: &[RawPhoton]) -> String {
    let row = |[pixel, cycle, bin]: &RawPhoton| format!("{pixel},{cycle},{bin}\n");
    let rows: String = photons.iter().map(row).collect();
    format!("pixel,cycle,bin\n{rows}")
}

fn index(number: u64) -> usize {
    usize::try_from(number).unwrap()
}

fn open(text: &str, shape: ListOptions, cycles: u64) -> Result<PhotonList<CsvReader>> {
    PhotonList::open(&Input::in_memory("a.csv", text), shape, cycles)
}

/// Before and after the laser cycles that are replayed.
#[test]
fn times_are_no_laser_cycles() {
    let told = |period: u64, start: u64| {
        let photons: Vec<RawPhoton> = (0..40)
            .map(|number| [0, start + number * period, 5])
            .collect();
        open(&csv(&photons), SHAPE, 1000).unwrap().times_as_cycles()
    };
    assert!(
        told(100, 300)
            .unwrap()
            .starts_with("all laser cycles are multiples of 100 apart")
    );
    assert!(
        told(0, 7)
            .unwrap()
            .starts_with("all 40 photons come in laser cycle 7: ")
    );
    assert_eq!(told(1, 0), None);
}

proptest! {
    #[test]
    fn a_list_is_replayed_and_counted_as_it_is_written(
        steps in prop::collection::vec(
            (0u64..6, prop_oneof![Just(0), 0u64..3, 0u64..700], any::<u64>()),
            1..60,
        ),
        rebin in 1u16..4,
        columns in option::of(1u32..5),
        limit in prop_oneof![Just(u64::MAX), 1u64..3000],
        lengths in prop::collection::vec(1u16..900, 1..5),
    ) {
        let shape = ListOptions { bins: 32, rebin, columns, ..SHAPE };
        let most = u64::from(32 * rebin);
        let mut last = 0;
        let photons = steps.iter().map(|&(pixel, wait, bin)| {
            last += wait;
            [3 * pixel, last, bin % most]
        });
        let photons: Vec<RawPhoton> = photons.collect();
        let end = last + 1;
        let has_photons =
            |pixel: &u16| photons.iter().any(|photon| photon[0] == u64::from(*pixel));
        let addresses: Vec<u16> = (0..16).filter(has_photons).collect();
        let pixels = u32::from(*addresses.last().unwrap()) + 1;
        let columns = columns.unwrap_or(pixels);
        let array = Array::new(columns, pixels.div_ceil(columns)).unwrap();
        let replayed = |photon: &&RawPhoton| photon[1] < limit;
        let of_span = |span| photons.iter().filter(|photon| photon[1] / 256 == span).count();
        let brightest = photons.iter().map(|photon| of_span(photon[1] / 256)).max();

        let mut list = open(&csv(&photons), shape, limit).unwrap();
        prop_assert_eq!(list.array(), array);
        prop_assert_eq!(list.pixels(), pixels as usize);
        let raw: Vec<u16> = list.addresses().iter().map(|address| address.raw()).collect();
        prop_assert_eq!(&raw, &addresses);
        prop_assert_eq!(list.first_cycle(), photons[0][1]);
        let divides = |divisor: &u64| photons.iter().all(|photon| (photon[1] - photons[0][1]).is_multiple_of(*divisor));
        let divisor = (1..=last - photons[0][1]).rev().find(divides);
        let different: BTreeSet<u64> = photons.iter().map(|photon| photon[1]).collect();
        prop_assert_eq!((list.divisor, list.different), (divisor.unwrap_or(0), different.len() as u64));
        prop_assert_eq!(list.cycles(), limit.min(end));
        let not_replayed = photons.iter().filter(|photon| !replayed(photon)).count();
        prop_assert_eq!(list.not_replayed(), not_replayed as u64);
        let rate = brightest.unwrap() as f64 / end.min(256) as f64;
        prop_assert_eq!(list.photons_per_cycle(), rate);

        let counts = |end: u64| {
            let mut counts = vec![vec![0; 32]; array.pixels() as usize];
            for &[pixel, _, bin] in photons.iter().filter(|photon| photon[1] < end) {
                counts[index(pixel)][index(bin / u64::from(rebin))] += 1;
            }
            counts
        };
        let mut quarters = vec![[0; 4]; 32];
        for photon in photons.iter().filter(replayed) {
            let quarter = photon[1] / list.cycles().div_ceil(4);
            quarters[index(photon[2] / u64::from(rebin))][index(quarter)] += 1;
        }
        let again = photons.iter().enumerate().filter(|(at, photon)| {
            replayed(photon) && photons[..*at].iter().any(|before| before[..2] == photon[..2])
        });
        let again = again.count() as u64;
        let (counted, times) = list.counts().unwrap();
        prop_assert!(counted.iter().eq(counts(limit)));
        prop_assert_eq!((times.quarters, times.again), (quarters, again));

        // Slices go on to the end of the file, and are empty after it.
        let mut first_cycle = 0;
        for &cycles in lengths.iter().cycle() {
            let slice = list.next_slice(cycles).unwrap();
            let after = first_cycle + u64::from(cycles);
            let expected = addresses.iter().map(|&address| {
                let of_slice = photons.iter().filter(|photon| {
                    photon[0] == u64::from(address) && (first_cycle..after).contains(&photon[1])
                });
                let photons = of_slice.map(|photon| Photon {
                    cycle: u16::try_from(photon[1] - first_cycle).unwrap(),
                    code: u16::try_from(photon[2] / u64::from(rebin)).unwrap(),
                });
                PixelPhotons { cycles, photons: photons.collect() }
            });
            prop_assert_eq!(slice.first_cycle, first_cycle);
            prop_assert_eq!(slice.pixels, expected.collect::<Vec<_>>());
            if first_cycle >= end {
                break;
            }
            first_cycle = after;
        }
    }
}

/// So that it does not grow while it is filled.
#[test]
fn a_slice_has_room_for_a_quarter_more_photons_than_the_brightest_part() {
    let photons: Vec<RawPhoton> = (0..1000).map(|at| [at % 2, at / 4, 5]).collect();
    let mut list = open(&csv(&photons), SHAPE, u64::MAX).unwrap();
    // Two photons a pixel in each of 250 laser cycles. If the room were less, it would double.
    let slice = list.next_slice(150).unwrap();
    for pixel in &slice.pixels {
        let room = pixel.photons.capacity();
        assert_eq!(pixel.photons.len(), 300);
        assert!((379..600).contains(&room), "{room}");
    }
}

#[test]
fn photons_that_cannot_be_are_refused_with_their_place() {
    let refused = |rows: &str, shape, cycles| {
        let refused = open(&format!("pixel,cycle,bin\n{rows}"), shape, cycles);
        format!("{:#}", refused.err().expect(rows))
    };
    for (rows, expected) in [
        ("", "2: no photons"),
        ("0,1,2\n0,2\n", "3: 2 fields, not 3"),
        (
            "65536,0,2\n",
            "2: pixel 65536 is above 65535, the last address: cut the array into tiles, as docs/recordings.md shows",
        ),
        (
            "0,5,2\n0,4,2\n",
            "3: cycle 4 comes after cycle 5: photons must be in order of their cycles",
        ),
        (
            "0,5,2\n0,1000000005,2\n",
            "3: cycle 1000000005 comes 1,000,000,000 laser cycles after the photon before it: must be less than \
             1,000,000,000; is the number damaged, or a time?",
        ),
        (
            "0,5,2\n0,18446744073709551615,2\n",
            "3: cycle 18446744073709551615 is the highest number of 64 bits: it is damaged, or stands for no cycle",
        ),
        (
            "0,5,2\n0,5,128\n",
            "3: bin 128 is past the last of 128 bins (see bins and rebin)",
        ),
        (
            "0,5,65664\n",
            "2: bin 65664 is past the last of 128 bins (see bins and rebin)",
        ),
        (
            "0,1700000000,2\n0,1700001999,2\n",
            " the first photon comes in laser cycle 1,700,000,000, and all within 2,000: count laser cycles from 0; times \
             are no laser cycles",
        ),
    ] {
        assert_eq!(refused(rows, SHAPE, u64::MAX), format!("a.csv:{expected}"));
    }
    // After the last laser cycle to replay, too.
    assert_eq!(
        refused("0,1,2\n0,5000,3\n0,5001,x\n", SHAPE, 100),
        "a.csv:4: bin \"x\" is not a whole number from 0"
    );
    let last = "0,18446744073709551614,2\n0,18446744073709551615,2\n";
    assert_eq!(
        refused(last, SHAPE, 100),
        "a.csv:3: cycle 18446744073709551615 is the highest number of 64 bits: it is damaged, or stands for no cycle"
    );
    let summed = ListOptions {
        bins: 64,
        rebin: 2,
        ..SHAPE
    };
    assert_eq!(
        refused("0,1,127\n0,2,128\n", summed, u64::MAX),
        "a.csv:3: bin 128 is past the last of 128 bins (see bins and rebin)"
    );
    for (columns, expected) in [
        (0, "columns 0: must be 1 or more"),
        (40_000, "columns 40000: makes more than 65,536 pixels"),
    ] {
        let shape = ListOptions {
            columns: Some(columns),
            ..SHAPE
        };
        assert_eq!(refused("50000,0,1\n", shape, u64::MAX), expected);
    }
}

#[test]
fn a_gap_of_fewer_than_a_billion_laser_cycles_is_none() {
    let list = open(
        "pixel,cycle,bin\n0,5,2\n0,1000000004,127\n65535,1000000004,0\n",
        SHAPE,
        u64::MAX,
    );
    assert_eq!(list.unwrap().cycles(), 1_000_000_005);
}

#[test]
fn times_are_refused_and_excerpts_are_not() {
    // A second of a counter at 10 MHz, after two seconds and after two minutes.
    assert!(check_cycles(20_000_000, 30_000_000).is_ok());
    assert!(check_cycles(1_200_000_000, 1_210_000_000).is_err());
    // A billion laser cycles without a photon are too many, and one less is not.
    assert!(check_cycles(1_000_000_000, 1_000_000_010).is_err());
    assert!(check_cycles(999_999_999, 1_000_000_010).is_ok());
    // Half of the laser cycles have photons; or none that is replayed.
    assert!(check_cycles(2_000_000_000, 4_000_000_000).is_ok());
    assert!(check_cycles(1_700_000_000, 10_000).is_ok());
    assert!(check_cycles(1 << 63, 999_999_999).is_ok());
    let reason = check_cycles(1 << 62, 1_000_000_000)
        .unwrap_err()
        .to_string();
    let first = "4,611,686,018,427,387,904";
    assert_eq!(
        reason,
        format!(
            "cycles 1000000000: the first photon comes in laser cycle {first}, after all of them"
        )
    );
    assert!(check_cycles(1_700_000_000, 1_700_002_000).is_err());
}

/// The bytes of a file until another program replaces them, and after it.
struct Replaced {
    before: Vec<u8>,
    after: Vec<u8>,
    is_replaced: Arc<AtomicBool>,
}

impl AsRef<[u8]> for Replaced {
    fn as_ref(&self) -> &[u8] {
        match self.is_replaced.load(Relaxed) {
            true => &self.after,
            false => &self.before,
        }
    }
}

/// A list whose file is replaced once it has been opened.
fn replaced<R: PhotonReader>(
    before: impl Into<Vec<u8>>,
    after: impl Into<Vec<u8>>,
) -> PhotonList<R> {
    let is_replaced = Arc::default();
    let data = Replaced {
        before: before.into(),
        after: after.into(),
        is_replaced: Arc::clone(&is_replaced),
    };
    let input = Input::Array(Arc::new(NpyArray {
        name: "a.csv".to_owned(),
        header: Vec::new(),
        data: Box::new(data),
    }));
    let list = PhotonList::open(&input, SHAPE, u64::MAX).unwrap();
    is_replaced.store(true, Relaxed);
    list
}

fn steady(cycles: u64) -> Vec<RawPhoton> {
    (0..cycles).map(|cycle| [0, cycle, 60]).collect()
}

/// No photon is lost silently.
#[test]
fn a_list_that_is_cut_while_it_is_read_is_refused() {
    fn refused<R: PhotonReader>(before: Vec<u8>, after: &[u8]) {
        let mut list: PhotonList<R> = replaced(before, after);
        assert_eq!(list.cycles(), 20_000);
        let error = format!("{:#}", list.next_slice(20_000).unwrap_err());
        let expected = ": the file became shorter while it was read";
        assert!(error.ends_with(expected), "{error}");
    }
    // More than is read ahead.
    let text = csv(&steady(20_000));
    refused::<CsvReader>(text.into(), csv(&steady(15_000)).as_bytes());
    let descr = "[('pixel', '<u2'), ('cycle', '<u4'), ('bin', '<u2')]";
    let mut bytes = header(descr, &[20_000], 128);
    for cycle in 0..20_000u32 {
        bytes.extend([&[0; 2], &cycle.to_le_bytes()[..], &[60, 0]].concat());
    }
    let cut = bytes[..128 + 8 * 15_000].to_vec();
    refused::<RecordReader>(bytes, &cut);
}

#[test]
fn another_file_in_the_place_of_a_list_is_refused() {
    let refused = |before: &[RawPhoton], after: &[RawPhoton]| {
        let mut list: PhotonList<CsvReader> = replaced(csv(before), csv(after));
        // The file was open, and is opened again after the last photon.
        let (all, _) = list.counts().unwrap();
        let all: u64 = all.iter().flatten().sum();
        assert_eq!(all, before.len() as u64);
        format!("{:#}", list.next_slice(500).unwrap_err())
    };
    let expected = "a.csv:402: the file changed while it was read: it had 500 photons up to cycle 499, and now has 400 up to \
                    cycle 399";
    assert_eq!(refused(&steady(500), &steady(400)), expected);
    let other = [[0, 0, 5], [3, 1, 5]];
    assert_eq!(
        refused(&steady(2), &other),
        "a.csv changed while it was read"
    );
    let mut list: PhotonList<CsvReader> = replaced(csv(&steady(2)), csv(&other));
    assert!(list.counts().is_ok());
    assert_eq!(
        list.counts().unwrap_err().to_string(),
        "a.csv changed while it was read"
    );
}

proptest! {
    /// So a slice of that length has a bounded size, also if a burst comes after it.
    #[test]
    fn sparse_laser_cycles_hold_at_most_so_many_photons(
        steps in prop::collection::vec(prop_oneof![Just(0u64), 0u64..3, 0u64..300, 0u64..5000], 1..200),
        most in 0u64..60,
        lengths in prop::collection::vec(1u16..2000, 1..5),
    ) {
        let mut cycle = 0;
        let photons = steps.iter().map(|wait| {
            cycle += wait;
            [0, cycle, 5]
        });
        let photons: Vec<RawPhoton> = photons.collect();
        let mut list = open(&csv(&photons), SHAPE, u64::MAX).unwrap();
        let mut at = 0;
        for &length in lengths.iter().cycle() {
            let end = at + list.sparse_cycles(most);
            let held = photons.iter().filter(|photon| (at..end).contains(&photon[1]));
            prop_assert!(held.count() as u64 <= most);
            if at > cycle {
                break;
            }
            list.next_slice(length).unwrap();
            at += u64::from(length);
        }
    }
}

/// The slice with the first photon after 65,000 dark laser cycles has no room for a burst of that length.
#[test]
fn dark_laser_cycles_need_no_memory() {
    let dark = [[0, 0, 5], [0, 66_000, 5]].into_iter();
    let burst = (0..100_000).map(|at| [0, 70_000 + at / 100, 5]);
    let photons: Vec<RawPhoton> = dark.chain(burst).collect();
    let mut list = open(&csv(&photons), SHAPE, u64::MAX).unwrap();
    list.next_slice(256).unwrap();
    assert_eq!(list.sparse_cycles(1 << 14), 66_000 - 256);
    let slice = list.next_slice(65_535).unwrap();
    assert!(slice.pixels[0].photons.capacity() < 10);
}

#[test]
fn photons_of_one_bin_and_laser_cycle_count_once_if_asked_for() {
    let rows = "0,0,5\n1,0,5\n0,0,5\n0,0,6\n0,1,5\n0,1,5\n0,1,5\n1,9,5\n";
    for (once_per_bin, expected) in [(false, [5, 1, 2]), (true, [2, 1, 2])] {
        let shape = ListOptions {
            once_per_bin,
            ..SHAPE
        };
        let input = Input::in_memory("a.csv", format!("pixel,cycle,bin\n{rows}"));
        let mut list = PhotonList::<CsvReader>::open(&input, shape, u64::MAX).unwrap();
        let (counts, _) = list.counts().unwrap();
        assert_eq!(
            [(0, 5), (0, 6), (1, 5)].map(|(pixel, bin)| counts.count(pixel, bin)),
            expected
        );
    }
}
