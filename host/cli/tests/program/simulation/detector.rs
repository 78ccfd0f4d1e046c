//! SPAD and TDC: dead time, pile-up, afterpulsing, jitter.

use super::{
    DEVIATIONS, float, histogram, mean, near, near_count, near_counts, near_in_blocks, near_mean,
    near_share, pixel, variance,
};

const CYCLES: u64 = 100_000;
/// A laser rate at which one histogram of 128 bins follows the other without a
/// gap.
const NO_GAP: &str = "laser_rate_mhz = 31.25\n";

/// Where photons lie, in bins from the start of the first laser cycle, without
/// gaps.
fn times(photons: &[(u64, u16)]) -> Vec<u64> {
    let time = |(cycle, code): &(u64, u16)| cycle * 128 + u64::from(*code);
    photons.iter().map(time).collect()
}

/// A steady rate r is counted as r / (1 + r τ), within a laser cycle and across
/// laser cycles.
#[test]
fn dead_time_counts_a_steady_rate_as_theory_says() {
    let rate = 0.05;
    for dead_bins in [4.0, 40.0, 300.0] {
        let dead_ps = dead_bins * 250.0;
        let dead = format!("[dead_time]\nduration_ps = {dead_ps}\n");
        let photons = pixel(&format!("{NO_GAP}background = {rate}\n{dead}"), CYCLES);
        // Between avalanches lies a dead time and an exponential time: a renewal
        // process.
        let interval = dead_bins + 1.0 / rate;
        let length = 128.0 * 1e5;
        near(
            &format!("dead time of {dead_bins} bins"),
            float(photons.len()),
            length * rate / (1.0 + rate * dead_bins),
            (length / rate.powi(2) / interval.powi(3)).sqrt(),
        );
        let times = times(&photons);
        let least = times.windows(2).map(|pair| pair[1] - pair[0]).min();
        let least = f64::from(u32::try_from(least.unwrap()).unwrap());
        assert!(
            (dead_bins..dead_bins + 2.0).contains(&(least + 1.0)),
            "{least}"
        );
    }
}

/// The background goes on between histogram and next pulse, so that the rate is
/// the same with a gap.
#[test]
fn dead_time_goes_on_between_histograms() {
    let photons = pixel(
        "background = 0.05\n[dead_time]\nduration_ps = 20_000\n", // 80 bins, 272 in the gap
        CYCLES,
    );
    let expected = 128.0 * 1000.0 * 0.05 / (1.0 + 0.05 * 80.0);
    let ones = photons.iter().map(|(cycle, _)| (*cycle, 1.0));
    near_in_blocks("photons", ones, CYCLES, expected);
    // Both ends of the histogram lose the same share.
    let expected = [float(photons.len()) / 128.0; 128];
    near_counts("bins", &histogram(&photons), &expected);
}

/// A dead time as long as the pulse passes only its first photon.
#[test]
fn pile_up_hides_what_comes_late() {
    let scene = "[[surface]]\nsignal = 2\nposition_bins = 60.5\n";
    let plain = pixel(scene, CYCLES);
    let dead = format!("{scene}[dead_time]\nduration_ps = 20_000\n");
    let piled = pixel(&dead, CYCLES);
    near_share("pulses", piled.len(), 100_000, 1.0 - (-2.0_f64).exp());
    let expected = first_photons(0.0, 2.0);
    near_counts("bins", &histogram(&piled)[56..65], &expected[56..65]);
    assert!(mean(&piled) < mean(&plain) - 0.3);
}

/// How many first photons of 100,000 laser cycles lie in each bin: none before,
/// at least one in it. The pulse is at 60.5, with σ = 1.
fn first_photons(background: f64, signal: f64) -> [f64; 128] {
    let mut before = 0.0_f64;
    let mut bin = 0.0;
    [(); 128].map(|()| {
        // Simpson's rule, far finer than needed.
        let steps = 100;
        let density = |step| {
            let at: f64 = bin + f64::from(step) / f64::from(steps) - 60.5;
            (-at.powi(2) / 2.0).exp() / std::f64::consts::TAU.sqrt()
        };
        let weight = |step| match step {
            step if step == 0 || step == steps => 1.0,
            step if step % 2 == 1 => 4.0,
            _ => 2.0,
        };
        let sum: f64 = (0..=steps).map(|step| weight(step) * density(step)).sum();
        let rate = background + signal * sum / f64::from(3 * steps);
        let first = (-before).exp() * (1.0 - (-rate).exp());
        before += rate;
        bin += 1.0;
        1e5 * first
    })
}

#[test]
fn one_hit_a_laser_cycle_is_the_first_photon() {
    let scene = "background = 0.01\n[[surface]]\nsignal = 1\nposition_bins = 60.5\n";
    let mut plain = pixel(scene, CYCLES);
    let hits = pixel(&format!("{scene}[tdc]\nhits_per_cycle = 1\n"), CYCLES);
    plain.sort_unstable();
    plain.dedup_by_key(|(cycle, _)| *cycle);
    assert!(hits == plain, "the first of each laser cycle");
    near_counts("bins", &histogram(&hits), &first_photons(0.01, 1.0));
}

#[test]
fn two_hits_a_laser_cycle_are_the_first_two() {
    let scene = "background = 0.05\n";
    let mut plain = pixel(scene, 5000);
    plain.sort_unstable();
    let hits = pixel(&format!("{scene}[tdc]\nhits_per_cycle = 2\n"), 5000);
    let of = |photons: &[(u64, u16)], cycle| -> Vec<u16> {
        let in_cycle = photons.iter().filter(|photon| photon.0 == cycle);
        in_cycle.map(|photon| photon.1).take(2).collect()
    };
    for cycle in (0..5000).step_by(50) {
        assert_eq!(of(&hits, cycle), of(&plain, cycle));
    }
    assert!(hits.len() < plain.len());
}

#[test]
fn a_tdc_is_blind_for_its_dead_time_after_each_photon() {
    let scene = "background = 0.05\n";
    let mut plain = pixel(scene, 5000);
    plain.sort_unstable();
    for dead_time in [1, 20, 127] {
        let hits = pixel(
            &format!("{scene}[tdc]\ndead_time_bins = {dead_time}\n"),
            5000,
        );
        let mut last = None;
        let expected = plain.iter().filter(|&&(cycle, code)| {
            let is_blind =
                last.is_some_and(|(before, hit)| before == cycle && code <= hit + dead_time);
            if !is_blind {
                last = Some((cycle, code));
            }
            !is_blind
        });
        assert!(hits.iter().eq(expected), "{dead_time}");
        assert!(hits.len() < plain.len());
    }
}

/// p an avalanche, afterpulses included: p / (1 - p) a photon.
#[test]
fn afterpulses_are_as_many_as_their_probability_says() {
    let scene = format!("{NO_GAP}background = 0.01\n");
    let plain = pixel(&scene, CYCLES);
    for probability in [0.02, 0.3] {
        let with =
            format!("{scene}[afterpulsing]\nprobability = {probability}\ndecay_ps = 30_000\n");
        let more = pixel(&with, CYCLES).len() - plain.len();
        let photons = float(plain.len());
        near(
            &format!("probability {probability}"),
            float(more),
            photons * probability / (1.0 - probability),
            (photons * probability).sqrt() / (1.0 - probability),
        );
    }
}

#[test]
fn afterpulses_come_after_the_dead_time_at_their_own_pace() {
    // Photons at one time: the first blinds the SPAD for the others.
    let (decay, dead) = (10.0_f64, 8.0_f64);
    let photons = pixel(
        "pulse_sigma_bins = 0\n[[surface]]\nsignal = 0.1\nposition_bins = 20.5\n\
         [dead_time]\nduration_ps = 2000\n[afterpulsing]\nprobability = 0.1\ndecay_ps = 2500\n",
        1_000_000,
    );
    let pulses = photons.iter().filter(|(_, code)| *code == 20).count();
    near_share("pulses", pulses, 1_000_000, 1.0 - (-0.1_f64).exp());
    // Dead from 20.5 to 28.5. The first afterpulse comes before the second, which
    // lies at least 8 bins further.
    let late = photons.iter().filter(|(_, code)| *code != 20);
    assert!(late.clone().all(|(_, code)| *code >= 28));
    let first = late.filter(|(_, code)| (28..36).contains(code)).count();
    let share = 0.1 * (1.0 - (-7.5 / decay).exp());
    near_share("first afterpulses", first, pulses, share);
    // The k-th afterpulse has probability p^k and comes k (dead time + decay) after
    // the pulse: all delays together are p / (1 - p)² times that. Ten thousand
    // laser cycles are a block.
    let delays = photons
        .iter()
        .filter(|(_, code)| *code != 20)
        .map(|(cycle, code)| (*cycle, f64::from(*code) + 0.5 - 20.5));
    let expected = 1e4 * (1.0 - (-0.1_f64).exp()) * 0.1 / 0.81 * (dead + decay);
    near_in_blocks("delays", delays, 1_000_000, expected);
}

/// Charge that is trapped in one laser cycle is released in a later one.
#[test]
fn afterpulses_cross_laser_cycles() {
    let (signal, probability, decay) = (0.1, 0.05, 100.0_f64);
    let photons = pixel(
        &format!(
            "{NO_GAP}pulse_sigma_bins = 0\n[[surface]]\nsignal = 0.1\nposition_bins = 20.5\n\
             [afterpulsing]\nprobability = 0.05\ndecay_ps = 25_000\n"
        ),
        1_000_000,
    );
    let mut pulses = vec![0.0; 1_000_001];
    let mut later = vec![0.0; 1_000_001];
    for (cycle, code) in &photons {
        let cycle = usize::try_from(*cycle).unwrap();
        match code {
            20 => pulses[cycle] += 1.0,
            21..53 => later[cycle] += 1.0,
            _ => {}
        }
    }
    let next = pulses.iter().zip(&later[1..]);
    let pairs = next.take(1_000_000).map(|(pulses, later)| pulses * later);
    // Afterpulses of all generations come at p/d exp(-(1 - p) t/d) after a pulse;
    // bins 21 to 52 of the n-th laser cycle after it are 128 n + 0.5 to 32.5.
    let left = 1.0 - probability;
    let until = |time: f64| probability / left * (1.0 - (-left * time / decay).exp());
    let own = |n: f64| until(128.0 * n + 32.5) - until(128.0 * n + 0.5);
    // Other pulses add theirs.
    let others: f64 = (0..50).map(|n| signal * own(n.into())).sum();
    let expected = 1e4 * signal * (own(1.0) + others);
    near_in_blocks("pairs", (0..).zip(pairs), 1_000_000, expected);
}

#[test]
fn the_variance_of_jitter_adds() {
    let photons = pixel(
        "pulse_sigma_bins = 2\n[[surface]]\nsignal = 1\nposition_bins = 60.3\n\
         [jitter]\nsigma_ps = 750\n",
        CYCLES,
    );
    near_count("photons", photons.len(), 1e5);
    let expected = 2.0_f64.powi(2) + 3.0_f64.powi(2) + 1.0 / 12.0;
    let deviation = expected * (2.0 / float(photons.len())).sqrt();
    near("variance", variance(&photons), expected, deviation);
    near_mean("mean", &photons, 60.3, expected);
}

/// As many photons move into the histogram as out of it.
#[test]
fn jitter_leaves_the_background_even() {
    for laser_rate_mhz in [10.0, 31.25] {
        let jitter = "background = 0.02\n[jitter]\nsigma_ps = 1000\n";
        let text = format!("laser_rate_mhz = {laser_rate_mhz}\n{jitter}");
        let photons = pixel(&text, CYCLES);
        near_counts("bins", &histogram(&photons), &[2000.0; 128]);
    }
}

#[test]
fn the_intervals_hold_999_of_1000() {
    // Of a normal distribution: erfc(x / √2) = 0.001, by its tail's expansion.
    let x = DEVIATIONS;
    let density = (-x * x / 2.0).exp() / std::f64::consts::TAU.sqrt();
    let tail = density / x
        * (1.0 - 1.0 / x.powi(2) + 3.0 / x.powi(4) - 15.0 / x.powi(6) + 105.0 / x.powi(8));
    assert!((2.0 * tail - 0.001).abs() < 2e-5, "{tail}");
}
