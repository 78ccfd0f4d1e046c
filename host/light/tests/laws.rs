//! The laws against Monte-Carlo simulation and against the core.
//!
//! Every comparison tests a count with an exact binomial interval. The level of a test is
//! divided by the number of its comparisons: with another seed, one run in a thousand may fail.

use dtof_core::rule::detect;
use dtof_core::{Count, DepthEstimator, Histogram, PaperRule, RangeGate};
use dtof_data::random::trial_rng;
use dtof_light::counts::binomial::plausible;
use dtof_light::gaussian::{self, MeanCounts};
use dtof_light::known_background;
use dtof_light::looks::single_look::SingleLook;
use dtof_light::rates::{bin_share, peak_share, signal_for_snr};
use rand_distr::{Distribution, Poisson};
use rand_pcg::Pcg64;

/// The probability that a test fails by chance.
const LEVEL: f64 = 1e-3;

/// Mean counts, from far too few for a Gaussian to ten times enough.
const MEANS: [f64; 8] = [0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0];

/// Draws one count a bin.
fn draw(laws: &[Poisson<f64>], rng: &mut Pcg64) -> Vec<f64> {
    laws.iter().map(|law| law.sample(rng)).collect()
}

/// Whether bin `target` is the highest, the lowest index winning a tie.
fn is_peak(counts: &[f64], target: usize) -> bool {
    let (before, from) = counts.split_at(target);
    let peak = from[0];
    before.iter().all(|&count| count < peak) && from.iter().all(|&count| count <= peak)
}

/// The paper's setting: 8 bins, B = 0.05, σ = 1.5 bins, the pulse on a bin
/// edge. One bin has signal, as in Eq. 7.
fn paper_counts(cycles: f64, snr: f64) -> MeanCounts {
    let (_, share) = peak_share(8, 4.0, 1.5);
    MeanCounts {
        background: cycles * 0.05,
        signal: cycles * signal_for_snr(snr, 0.05, cycles) * share,
        background_bins: 7,
    }
}

#[test]
fn equation_7_against_monte_carlo_at_the_papers_setting() {
    const TIMES: u32 = 20_000;
    let mut rng = trial_rng(7, 0);
    // 12,000 laser cycles are 600 background photons a bin.
    for cycles in [600.0, 2000.0, 12_000.0] {
        for snr in [0.0, 4.0, 8.0, 12.0, 16.0, 20.0] {
            let counts = paper_counts(cycles, snr);
            let mut means = [counts.background; 8];
            means[3] += counts.signal;
            let laws = means.map(|mean| Poisson::new(mean).unwrap());
            let hits = (0..TIMES).filter(|_| is_peak(&draw(&laws, &mut rng), 3));
            let hits = u32::try_from(hits.count()).unwrap();
            let exact = known_background::hit_probability(&means, 3).unwrap();
            assert!(
                plausible(hits, TIMES, exact, LEVEL / 18.0),
                "{cycles} {snr}: {hits}"
            );
            let gaussian = counts.hit_probability();
            println!(
                "N {cycles:5} SNR {snr:2}: Monte-Carlo {:.4}, Poisson {exact:.4}, Eq. 7 {gaussian:.4}",
                f64::from(hits) / f64::from(TIMES)
            );
        }
    }
}

/// The figures of `docs/theory.md`: mean background a bin; largest error of
/// Eq. 7 over SNR 0 to 30, at the paper's setting; largest error of Eq. 8 over
/// SNR 0.5 to 30 and α 0 to 8; exact probability that one of 127 background bins
/// exceeds the threshold at α = 4.
const GAUSSIAN_ERRORS: [(f64, f64, f64, f64); 8] = [
    (0.1, 0.177, 0.412, 0.449),
    (0.3, 0.119, 0.237, 0.367),
    (1.0, 0.074, 0.237, 0.0727),
    (3.0, 0.044, 0.147, 0.131),
    (10.0, 0.025, 0.083, 0.0369),
    (30.0, 0.015, 0.048, 0.0211),
    (100.0, 0.008, 0.026, 0.0081),
    (300.0, 0.005, 0.015, 0.0066),
];

#[test]
fn what_the_gaussian_gets_wrong() {
    let snrs = || (0..=60).map(|step| f64::from(step) / 2.0);
    let alphas = || (0..=16).map(|step| f64::from(step) / 2.0);
    // Eq. 10 does not depend on the background.
    let equation_10 = gaussian::false_positive_rate(4.0, 127);
    assert!((equation_10 - 0.0040).abs() < 5e-5, "{equation_10}");
    for (mean, hit_error, pass_error, false_positive) in GAUSSIAN_ERRORS {
        let mut worst = (0f64, 0f64);
        for snr in snrs() {
            let counts = paper_counts(mean / 0.05, snr);
            let mut means = [counts.background; 8];
            means[3] += counts.signal;
            let exact = known_background::hit_probability(&means, 3).unwrap();
            worst.0 = worst.0.max((counts.hit_probability() - exact).abs());
            for alpha in alphas().filter(|_| snr > 0.0) {
                let MeanCounts {
                    background, signal, ..
                } = counts;
                let exact = known_background::pass_probability(background, signal, alpha);
                worst.1 = worst.1.max((counts.pass_probability(alpha) - exact).abs());
            }
        }
        assert!((worst.0 - hit_error).abs() < 6e-4, "{mean}: {worst:?}");
        assert!((worst.1 - pass_error).abs() < 6e-4, "{mean}: {worst:?}");
        let exact = known_background::false_positive_rate(mean, 4.0, 127);
        let ratio = exact / false_positive;
        assert!((ratio - 1.0).abs() < 0.01, "{mean}: {exact}");
    }
}

#[test]
fn ninety_nine_percent_hit_rate_needs_an_snr_near_18() {
    // Mean background a bin, SNR by Eq. 7, SNR with Poisson counts.
    for (background, gaussian, poisson) in [
        (2.0, 29.6, 28.6),
        (30.0, 19.8, 19.8),
        (100.0, 18.4, 18.4),
        (1000.0, 17.3, 17.3),
    ] {
        let counts = |snr| paper_counts(background / 0.05, snr);
        let with_poisson = |snr| {
            let mut means = [background; 8];
            means[3] += counts(snr).signal;
            known_background::hit_probability(&means, 3).unwrap()
        };
        // To a tenth.
        assert!(counts(gaussian - 0.1).hit_probability() < 0.99);
        assert!(counts(gaussian + 0.1).hit_probability() > 0.99);
        assert!(with_poisson(poisson - 0.1) < 0.99 && with_poisson(poisson + 0.1) > 0.99);
    }
}

#[test]
fn a_pulse_on_an_edge_hits_either_of_two_bins() {
    // Eq. 7 leaves out the other bins of the pulse. At the SNR where it gives 99 %, the peak
    // is the lower of the two equal bins in 45 % of histograms, and one of the two in 88 %.
    let background: f64 = 100.0;
    let signal = 18.4 * background.sqrt();
    let means = paper_pulse(background, signal);
    let hit = |bin| known_background::hit_probability(&means, bin).unwrap();
    assert!((hit(3) - 0.45).abs() < 0.005, "{}", hit(3));
    let either = hit(3) + hit(4);
    assert!((either - 0.88).abs() < 0.005, "{either}");
}

/// Mean counts with the whole pulse, neighbours included.
fn paper_pulse(background: f64, signal: f64) -> [f64; 8] {
    let mut means = [background; 8];
    for (bin, mean) in (0..).zip(&mut means) {
        *mean += signal * bin_share(bin, 4.0, 1.5);
    }
    means
}

#[test]
fn poisson_forms_against_monte_carlo_from_a_tenth_to_300_counts() {
    const TIMES: u32 = 20_000;
    let alphas = [0.5, 2.0, 4.0];
    let comparisons = MEANS.len() * 2 * (1 + 3 * alphas.len());
    let level = LEVEL / f64::from(u32::try_from(comparisons).unwrap());
    let mut rng = trial_rng(8, 0);
    for background in MEANS {
        for snr in [6.0, 15.0] {
            let means = paper_pulse(background, snr * background.sqrt());
            let laws = means.map(|mean| Poisson::new(mean).unwrap());
            let target = 3;
            let levels = alphas.map(|alpha| gaussian::threshold(background, alpha));
            let (mut hits, mut passes, mut both, mut stray) = (0, [0; 3], [0; 3], [0; 3]);
            for _ in 0..TIMES {
                let counts = draw(&laws, &mut rng);
                let hit = is_peak(&counts, target);
                hits += u32::from(hit);
                // Background alone in seven other bins.
                let law = Poisson::new(background).unwrap();
                let highest = (0..7).map(|_| law.sample(&mut rng)).fold(0.0, f64::max);
                for (step, &level) in levels.iter().enumerate() {
                    let pass = counts[target] > level;
                    passes[step] += u32::from(pass);
                    both[step] += u32::from(hit && pass);
                    stray[step] += u32::from(highest > level);
                }
            }
            let exact = known_background::hit_probability(&means, target).unwrap();
            assert!(
                plausible(hits, TIMES, exact, level),
                "{background} {snr}: {hits} {exact}"
            );
            for (step, &alpha) in alphas.iter().enumerate() {
                let signal = means[target] - background;
                let pass = known_background::pass_probability(background, signal, alpha);
                let true_positive =
                    known_background::true_positive_rate(&means, target, background, alpha);
                let false_positive = known_background::false_positive_rate(background, alpha, 7);
                for (what, seen, exact) in [
                    ("pass", passes[step], pass),
                    ("true positive", both[step], true_positive.unwrap()),
                    ("false positive", stray[step], false_positive),
                ] {
                    let is_right = plausible(seen, TIMES, exact, level);
                    assert!(is_right, "{what}: {background} {snr} {alpha}");
                }
            }
        }
    }
}

/// Decisions of the core on background only.
fn false_alarms<const BINS: usize>(
    mean: f64,
    rules: &[PaperRule],
    times: u32,
    rng: &mut Pcg64,
) -> Vec<u32> {
    let gate = RangeGate::full();
    let law = Poisson::new(mean).unwrap();
    let mut events = vec![0; rules.len()];
    for _ in 0..times {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let counts: [u32; BINS] = std::array::from_fn(|_| law.sample(rng) as u32);
        let mut histogram = Histogram::<BINS>::new();
        histogram.add_frame(&counts, &gate);
        for (events, rule) in events.iter_mut().zip(rules) {
            let found = detect(&histogram, &gate, rule, &DepthEstimator::default());
            *events += u32::from(found.is_some());
        }
    }
    events
}

#[test]
fn the_quadrant_law_is_that_of_the_core() {
    const TIMES: u32 = 10_000;
    let rules: Vec<PaperRule> = ["0.5", "1", "1.75", "2.5", "3", "4"]
        .iter()
        .flat_map(|alpha| {
            [1, 5].map(|count| PaperRule::new(alpha.parse().unwrap(), Count::saturating(count)))
        })
        .collect();
    // Beyond 1000 the counters saturate.
    let means = [0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 990.0];
    let comparisons = 3 * means.len() * rules.len();
    let level = LEVEL / f64::from(u32::try_from(comparisons).unwrap());
    let mut rng = trial_rng(9, 0);
    for mean in means {
        for (bins, events) in [
            (8, false_alarms::<8>(mean, &rules, TIMES, &mut rng)),
            (32, false_alarms::<32>(mean, &rules, TIMES, &mut rng)),
            (128, false_alarms::<128>(mean, &rules, TIMES, &mut rng)),
        ] {
            let look = SingleLook::new(bins, mean);
            for (rule, &seen) in rules.iter().zip(&events) {
                let exact = look.false_alarm_probability(rule.threshold());
                assert!(
                    plausible(seen, TIMES, exact, level),
                    "{bins} bins, mean {mean}, {rule:?}: {seen} of {TIMES}, expected {exact}"
                );
            }
        }
    }
}
