//! Simulated photons against the laws of physics they stand for.
//!
//! All seeds are fixed. An interval holds 99.9 % of all outcomes of a simulation
//! that is right.

mod detector;
mod light;
mod motion;
mod other_lidar;
mod plain;

use dtof_data::photons::source::PhotonSource;
use dtof_light::scene::Scene;

/// Standard deviations on either side of the mean that leave out 0.1 % of a normal distribution.
const DEVIATIONS: f64 = 3.290_527;

/// Laser cycle and TDC code of each photon of a pixel.
type Photons = Vec<(u64, u16)>;

/// The photons of each pixel of the scene `text`, with `slice` laser cycles at a
/// time.
fn sliced(text: &str, cycles: u64, slice: u16) -> Vec<Photons> {
    seeded(text, 1, cycles, slice)
}

fn seeded(text: &str, seed: u64, cycles: u64, slice: u16) -> Vec<Photons> {
    let mut source = Scene::parse(text).unwrap().photons(seed, cycles).unwrap();
    let mut pixels = vec![Vec::new(); source.array().pixels() as usize];
    for _ in 0..cycles / u64::from(slice) {
        let slice = source.next_slice(slice).unwrap();
        for (pixel, received) in pixels.iter_mut().zip(slice.pixels) {
            let photons = received.photons.iter();
            pixel.extend(
                photons.map(|photon| (slice.first_cycle + u64::from(photon.cycle), photon.code)),
            );
        }
    }
    pixels
}

fn array(text: &str, cycles: u64) -> Vec<Photons> {
    sliced(text, cycles, 1000)
}

/// The photons of a scene of one pixel.
fn pixel(text: &str, cycles: u64) -> Photons {
    array(text, cycles).remove(0)
}

/// Photons in each of 128 bins.
fn histogram(photons: &Photons) -> [u32; 128] {
    let mut bins = [0; 128];
    for (_, code) in photons {
        bins[usize::from(*code)] += 1;
    }
    bins
}

/// Fails unless `measured` is within the expected deviation of `expected`.
#[track_caller]
fn near(what: &str, measured: f64, expected: f64, deviation: f64) {
    let off = (measured - expected) / deviation;
    println!("{what}: {measured:.5}, expected {expected:.5}, {off:+.2} standard deviations");
    assert!(
        off.abs() <= DEVIATIONS,
        "{what}: {measured}, expected {expected} within {DEVIATIONS} × {deviation}"
    );
}

/// A number of rare or independent photons (Poisson).
#[track_caller]
fn near_count(what: &str, measured: usize, expected: f64) {
    near(what, float(measured), expected, expected.sqrt());
}

/// `measured` of `total`, each with probability `share`.
#[track_caller]
fn near_share(what: &str, measured: usize, total: usize, share: f64) {
    let deviation = (float(total) * share * (1.0 - share)).sqrt();
    near(what, float(measured), float(total) * share, deviation);
}

/// Compares counts with expected counts: chi-square as a normal deviate
/// (Wilson and Hilferty).
#[track_caller]
fn near_counts(what: &str, measured: &[u32], expected: &[f64]) {
    let pairs = measured.iter().zip(expected);
    let square =
        |(measured, expected): (&u32, &f64)| (f64::from(*measured) - expected).powi(2) / expected;
    let chi_square: f64 = pairs.map(square).sum();
    let freedom = float(measured.len());
    let spread = 2.0 / (9.0 * freedom);
    let cube_root = (chi_square / freedom).cbrt();
    near(what, cube_root, 1.0 - spread, spread.sqrt());
}

/// The sum of `values`, each of a laser cycle, over a block of laser cycles, a
/// hundredth of all. Values within a block may be correlated: the spread of the blocks gives the
/// error.
#[track_caller]
fn near_in_blocks(
    what: &str,
    values: impl Iterator<Item = (u64, f64)>,
    cycles: u64,
    expected: f64,
) {
    let mut blocks = [0.0; 100];
    for (cycle, value) in values {
        blocks[usize::try_from(cycle * 100 / cycles).unwrap()] += value;
    }
    let mean = blocks.iter().sum::<f64>() / 100.0;
    let squares: f64 = blocks.iter().map(|block| (block - mean).powi(2)).sum();
    // Student's distribution with 99 degrees of freedom is a little wider.
    let deviation = (squares / 99.0 / 100.0).sqrt() * 3.3915 / DEVIATIONS;
    near(what, mean, expected, deviation);
}

/// The mean position of photons, each of which has this variance.
#[track_caller]
fn near_mean(what: &str, photons: &[(u64, u16)], expected: f64, variance: f64) {
    let deviation = (variance / float(photons.len())).sqrt();
    near(what, mean(photons), expected, deviation);
}

/// Mean position of photons, in bins from the start of bin 0.
fn mean(photons: &[(u64, u16)]) -> f64 {
    let sum: f64 = photons.iter().map(|(_, code)| f64::from(*code) + 0.5).sum();
    sum / float(photons.len())
}

fn variance(photons: &[(u64, u16)]) -> f64 {
    let mean = mean(photons);
    let square = |(_, code): &(u64, u16)| (f64::from(*code) + 0.5 - mean).powi(2);
    photons.iter().map(square).sum::<f64>() / float(photons.len() - 1)
}

fn float(count: usize) -> f64 {
    count as f64
}
