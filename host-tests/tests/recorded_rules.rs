//! Recorded photons with ground truth, decided by the paper's rule and by window
//! rules: how many photons an event takes, and how far off it is. Needs the public
//! TMF8820 capture log, as `recorded.rs` does, and prints a table.

mod capture_log;

use capture_log::{ground_truth, log, tell};
use dtof::recorded::{RecordedHistograms, RecordingLength};
use dtof::source::{PhotonSource, Slice};
use dtof::tmf8820;
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{
    AsyncPixel, Count, DepthEstimator, DetectionRule, LaserCycle, PaperRule, PixelAddress,
    PixelConfig, RangeGate, RangeScale, WindowRule,
};

const ZONES: usize = 9;
const CENTRE: usize = 4;
const CYCLES: u16 = 10_000;
/// From 30 to 400 mm.
const DISTANCES: usize = 149;

/// What the centre zone reports over all captures from 30 to 400 mm.
struct Outcome {
    distances: usize,
    photons_an_event: f64,
    median: f64,
    within_95: f64,
    /// Events farther off than 50 mm.
    beyond_50: usize,
    events: usize,
}

fn replay<R: DetectionRule>(
    slice: &Slice,
    truth: &[f64],
    config: &PixelConfig<{ tmf8820::BINS }, R>,
) -> Outcome {
    let scale = RangeScale::new(tmf8820::BIN_WIDTH_PS, tmf8820::OFFSET_MM).unwrap();
    let (mut errors, mut photons, mut distances) = (Vec::new(), 0, 0);
    for (truth, pixels) in truth.iter().zip(slice.pixels.chunks(ZONES)) {
        if *truth < 29.9 {
            continue;
        }
        let mut pixel = AsyncPixel::<{ tmf8820::BINS }>::new(PixelAddress(0));
        let mut left = pixels[CENTRE].photons.iter().peekable();
        let before = errors.len();
        for cycle in 0..pixels[CENTRE].cycles {
            while let Some(photon) = left.next_if(|photon| photon.cycle == cycle) {
                pixel.count(config, photon.code);
            }
            let _ = pixel.end_laser_cycle(config, LaserCycle(cycle.into()));
            if let Some(event) = pixel.acknowledge() {
                errors.push(scale.range(event.position()).to_num::<f64>() - truth);
            }
        }
        photons += pixel.statistics().photons();
        distances += usize::from(errors.len() > before);
    }
    // One constant offset is allowed for.
    errors.sort_by(f64::total_cmp);
    let offset = errors[errors.len() / 2];
    let mut absolute: Vec<f64> = errors.iter().map(|error| (error - offset).abs()).collect();
    absolute.sort_by(f64::total_cmp);
    Outcome {
        distances,
        photons_an_event: photons as f64 / absolute.len() as f64,
        median: absolute[absolute.len() / 2],
        within_95: absolute[absolute.len() * 95 / 100],
        beyond_50: absolute.iter().filter(|&&error| error > 50.0).count(),
        events: absolute.len(),
    }
}

/// A rule at L1, and prints what it comes to.
fn outcome<R: DetectionRule>(
    name: &str,
    slice: &Slice,
    truth: &[f64],
    l1: u16,
    rule: R,
    estimator: DepthEstimator,
) -> Outcome {
    let config = PixelConfig::new(4, l1, 2000, RangeGate::full(), rule).unwrap();
    let outcome = replay(slice, truth, &config.with_estimator(estimator));
    tell(&format!(
        "{name:<44} {l1:>4} {:>7} {:>10} {:>9.1} {:>10.2} {:>8.2} {:>13}",
        outcome.events,
        outcome.distances,
        outcome.photons_an_event,
        outcome.median,
        outcome.within_95,
        outcome.beyond_50
    ));
    outcome
}

#[test]
fn window_rules_need_fewer_photons_than_the_papers() {
    let Some(log) = log() else {
        return;
    };
    let truth = ground_truth(&log);
    let recorded = tmf8820::read(&log).unwrap();
    for photons_per_cycle in [0.5, 1.0] {
        let length = RecordingLength::PhotonsPerCycle(photons_per_cycle);
        let mut photons = RecordedHistograms::new(
            recorded.geometry,
            &recorded.captures,
            length,
            CYCLES.into(),
            1,
        )
        .unwrap();
        let slice = photons.next_slice(CYCLES).unwrap();
        tell(&format!(
            "recorded photons, {photons_per_cycle} a laser cycle in the brightest zone; centre zone, L2 2000, X 4, \
             minimum 5"
        ));
        tell(
            "rule; depth                                    L1  events  distances   photons  median mm  95 % mm  \
             beyond 50 mm",
        );
        let count = Count::saturating(5);
        let paper = PaperRule::new(U8F8::lit("4"), count);
        let mass = DepthEstimator::CentreOfMass3;
        let centred = DepthEstimator::for_pulse(U8F8::lit("1"));
        for l1 in [4, 40] {
            let name = "paper's, α 4; centre of mass of 3";
            let paper = outcome(name, &slice, &truth, l1, paper, mass);
            let window = |width: u8| {
                let rule = WindowRule::new(width, U4F12::lit("4.3"), count).unwrap();
                let name = format!("window of {width}, z 4.3; centred window, σ 1");
                outcome(&name, &slice, &truth, l1, rule, centred)
            };
            let [one, two, three] = [1, 2, 3].map(window);
            for window in [&one, &two, &three] {
                assert_eq!(window.distances, DISTANCES, "a distance without an event");
                assert!(window.within_95 < paper.within_95);
                assert!(window.beyond_50 * 3000 <= window.events);
            }
            // L1 = 40 laser cycles are more than either rule needs.
            if l1 == 4 {
                assert!(two.photons_an_event < 0.75 * paper.photons_an_event);
                assert!(two.median < paper.median);
            }
        }
    }
}
