//! The tables behind `z_for` are what they are said to be.
//!
//! z against the number of independent trials is the normal distribution's: one
//! trial in as many exceeds it. How many independent looks there are in the first `k`,
//! of an exposure with a look every X laser cycles, is simulated: without a target, 128
//! bins, one photon a bin and look, windows of 2, 3 and 5 bins. The z that one exposure
//! in 300 exceeds says how many independent trials that is; a single look counts as 1.

use dtof_core::{RangeGate, z_for};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

const BINS: usize = 128;
const WIDTHS: [usize; 3] = [2, 3, 5];
const EXPOSURES: usize = 30_000;
const ONE_IN: usize = 300;
/// As many numbers of looks as `LOOKS` has entries: powers of two.
const POWERS: usize = 11;

/// The numbers of a table of the source, in its order.
fn table(name: &str) -> Vec<u32> {
    let source = include_str!("../../src/detect/window_z.rs");
    let start = format!("const {name}: ");
    let (_, rest) = source.split_once(&start).unwrap();
    let (_, rest) = rest.split_once("= [").unwrap();
    let (numbers, _) = rest.split_once(']').unwrap();
    let numbers = numbers.split(',').map(str::trim);
    let numbers = numbers.filter(|number| !number.is_empty());
    numbers.map(|number| number.parse().unwrap()).collect()
}

/// From 2⁶ trials on, every second power of two.
#[test]
fn z_is_that_of_the_normal_distribution() {
    let powers = (6..=34).step_by(2).map(f64::from);
    let expected: Vec<f64> = powers
        .map(|power| (z_of(power.exp2()) * 4096.0).round())
        .collect();
    let table: Vec<f64> = table("Z").into_iter().map(f64::from).collect();
    assert_eq!(table, expected);
}

/// What so many looks are worth, in whole 1/16, with a straight line between powers of two.
fn worth(looks: u32) -> f64 {
    let table = table("LOOKS");
    let power = looks.max(1).ilog2();
    let index = power.min(9) as usize;
    let [low, rise] = [table[index], table[index + 1] - table[index]].map(f64::from);
    let part = f64::from(looks.max(1)) / f64::from(power).exp2() - 1.0;
    let beyond = f64::from(power) - index as f64 + part;
    (low + rise * beyond).floor() / 16.0
}

/// The looks from L1 to L2, of all bins, of so many exposures; the line between powers of two is
/// straight for the trials and for z.
#[test]
fn z_for_is_that_of_its_tables() {
    let z = table("Z");
    let exposures = [
        (4, 40, 1000),
        (1, 1, 2),
        (1, 1, 3),
        (2, 2, 9),
        (4, 4, 41),
        (8, 64, 8 * 700),
        (1, 3, u16::MAX),
        (5, 0, 999),
        (0, 9, 9),
        (40, 40, 40),
    ];
    for one_in in [1, 3, 100, 1000, 1_000_000, u32::MAX] {
        for (x, l1, l2) in exposures {
            let look = |cycles: u16| u32::from(cycles.checked_div(x).unwrap_or(0));
            let (first, last) = (look(l1) + 1, look(l2 - 1));
            let looks = 1.0 + (worth(last) - worth(first)).max(0.0);
            for (first, last) in [(0, 127), (20, 27), (3, 90)] {
                let gate = RangeGate::<128>::new(first, last).unwrap();
                let trials = f64::from(one_in) * f64::from(last - first + 1) * looks;
                let trials = trials.floor();
                let power = trials.log2().floor();
                let steps = ((power - 6.0 + trials / power.exp2() - 1.0) / 2.0).clamp(0.0, 14.0);
                let low = (steps as usize).min(13);
                let [low_z, high_z] = [z[low], z[low + 1]].map(f64::from);
                let expected = low_z + (high_z - low_z) * (steps - low as f64);
                let found = f64::from(z_for(one_in, &gate, x, l1, l2).to_bits());
                // Of the logarithm 8 bits are kept.
                let context = format!("1 in {one_in}, {x} {l1} {l2}: {found} for {expected}");
                assert!((found - expected).abs() <= 8.0, "{context}");
            }
        }
    }
}

/// For 1, 2, 4, … looks, in 1/16. Takes minutes, so `.ci/long` asks for it.
#[test]
fn looks_are_worth_what_is_simulated() {
    if std::env::var_os("DTOF_LONG").is_none() {
        println!("left to .ci/long");
        return;
    }
    let threads = 2;
    let highest: Vec<_> = std::thread::scope(|scope| {
        let run = |seed| scope.spawn(move || simulate(seed, EXPOSURES / threads));
        let workers: Vec<_> = (0..threads as u64).map(run).collect();
        let results = workers.into_iter().map(|worker| worker.join().unwrap());
        results.flatten().collect()
    });
    let worth = (0..POWERS).map(|power| {
        let mut z = 0.0;
        for width in 0..WIDTHS.len() {
            let mut of_all: Vec<f64> = highest.iter().map(|z| z[power][width]).collect();
            of_all.sort_by(|a, b| b.total_cmp(a));
            z += of_all[EXPOSURES / ONE_IN] / WIDTHS.len() as f64;
        }
        let trials = 1.0 / upper_tail(z);
        (trials / (ONE_IN * BINS) as f64 * 16.0).round()
    });
    let table: Vec<f64> = table("LOOKS").into_iter().map(f64::from).collect();
    assert_eq!(worth.collect::<Vec<_>>(), table);
}

/// The highest z of each exposure up to each power of two looks, for each width.
fn simulate(seed: u64, exposures: usize) -> Vec<[[f64; WIDTHS.len()]; POWERS]> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let exposure = |_| {
        let (mut counts, mut total) = ([0u32; BINS], 0u32);
        let mut highest = [0.0; WIDTHS.len()];
        let mut looks = 0;
        core::array::from_fn(|power| {
            while looks < 1 << power {
                for count in &mut counts {
                    let photons = poisson_of_one(&mut rng);
                    *count += photons;
                    total += photons;
                }
                for (highest, width) in highest.iter_mut().zip(WIDTHS) {
                    *highest = z_reached(&counts, total, width, *highest);
                }
                looks += 1;
            }
            highest
        })
    };
    (0..exposures).map(exposure).collect()
}

fn poisson_of_one(rng: &mut Pcg64Mcg) -> u32 {
    let mut left = rng.next_u32();
    // e⁻¹/k! of 2³²
    let (mut share, mut count) = (1_580_030_169, 0);
    while left >= share && share > 0 {
        left -= share;
        count += 1;
        share /= count;
    }
    count
}

/// The z at which the window rule just fires, or `reached` if that is higher.
fn z_reached(counts: &[u32; BINS], total: u32, width: usize, reached: f64) -> f64 {
    let peak = (0..BINS).max_by_key(|&bin| (counts[bin], BINS - bin));
    let peak = peak.unwrap_or(0);
    let starts = (peak + 1).saturating_sub(width)..=peak.min(BINS - width);
    let sums = starts.map(|start| counts[start..start + width].iter().sum::<u32>());
    let inside = f64::from(sums.max().unwrap_or(0));
    let share = width as f64 / BINS as f64;
    let mean = f64::from(total) * share;
    let variance = mean * (1.0 - share);
    let fires = |z: f64| {
        let skew = z * z / 6.0 * (1.0 - 2.0 * share);
        inside > mean + z * variance / (variance + z * z / 36.0).sqrt() + skew
    };
    let (mut low, mut high) = (reached, 16.0);
    while fires(low) && high - low > 1e-6 {
        let middle = f64::midpoint(low, high);
        if fires(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// The share of a normal distribution above `z`.
fn upper_tail(z: f64) -> f64 {
    libm::erfc(z / std::f64::consts::SQRT_2) / 2.0
}

/// The z that one of `trials` exceeds.
fn z_of(trials: f64) -> f64 {
    let (mut low, mut high) = (0.0, 40.0);
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        if upper_tail(middle) * trials > 1.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}
