//! The tables behind `z_for` are what they are said to be.
//!
//! z against the number of independent trials is the normal distribution's: one
//! trial in as many exceeds it. How many independent looks there are in the first `k`,
//! of an exposure with a look every X laser cycles, is simulated: without a target, 128
//! bins, one photon a bin and look, windows of 2, 3 and 5 bins. The z that one exposure
//! in 300 exceeds says how many independent trials that is; a single look counts as 1.

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
