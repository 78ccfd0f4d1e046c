//! The parts of `dtof compare`: costs, thresholds of equal false alarms, harder conditions, the bound,
//! and the choice.

use std::path::Path;

use crate::slow_or_quick;

use dtof_core::fixed::types::U8F8;
use dtof_data::photons::source::PhotonSource;
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_engine::settings::SettingsFile;
use dtof_light::bounds::likelihood_ratio::information;
use dtof_light::scene::Scene;
use dtof_run::compare::Figures;
use dtof_run::compare::answer::answer;
use dtof_run::compare::bound::Bound;
use dtof_run::compare::cost;
use dtof_run::compare::measure::{Trial, TrialOutcome};
use dtof_run::compare::method::{Kind, Method, Rule};
use dtof_run::compare::stress::{Light, Stress, Stressed};
use dtof_run::compare::thresholds::Thresholds;

/// The instructions of an operation in a table, at opt-level 3.
fn counted(variant: &str) -> f64 {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/results/bench/instructions.csv");
    let text = std::fs::read_to_string(path).unwrap();
    let row = text
        .lines()
        .find(|row| row.contains(&format!(",{variant},3,")));
    let row = row.unwrap_or_else(|| panic!("no {variant}"));
    row.rsplit(',').next().unwrap().parse().unwrap()
}

#[test]
fn costs_are_the_counted_instructions() {
    let with_blocks = "array with blocks; ";
    for (cost, counted) in [
        (cost::PHOTON, counted("AsyncPixel::count_batch")),
        (
            cost::ONCE_PER_BIN,
            counted("AsyncPixel::count_once_per_bin"),
        ),
        (
            cost::FEED,
            counted(&format!("{with_blocks}feeds none")) - counted("array"),
        ),
        (
            cost::BLOCK_PHOTON,
            counted(&format!("{with_blocks}1 level"))
                - counted(&format!("{with_blocks}feeds none")),
        ),
        (cost::PAPER, counted("kept peak; no event")),
        (cost::AVERAGE, counted("average; no event")),
        (cost::TRACKING, counted("look; tracking; no event")),
        (cost::BLOCK_LOOK, counted("look; block; no event")),
        (
            cost::DEAD_TIME,
            counted("look; dead time of 20 bins; no event"),
        ),
        (
            cost::FIRST_PHOTON,
            counted("look; dead time; first photon only; no event"),
        ),
        (
            cost::NEIGHBOURS,
            counted("look; array, 8 neighbours; no event"),
        ),
        (cost::LOOK, counted("look; array; no event")),
        (
            cost::CONFIRMED,
            counted("look; array, 8 neighbours; more for each confirmed")
                + counted("encode and to_le_bytes"),
        ),
        (cost::EXPIRY, counted("look at L2")),
        (
            cost::EVENT,
            counted("kept peak; event and depth") + counted("encode and to_le_bytes"),
        ),
        (
            cost::CENTRED,
            counted("centred window, σ 1") - counted("centroid"),
        ),
    ] {
        assert!((cost - counted).abs() < 0.005, "{cost} {counted}");
    }
    for width in [1, 2, 3, 5, 7] {
        let row = counted(&format!("window of {width}; no event"));
        assert_eq!(cost::window(width), row, "{width}");
    }
}

fn settings(l1: u16) -> Settings {
    let toml = format!("[sensor]\nsigma_bins = 1\n[detection]\nl1 = {l1}\nl2 = 1000\n");
    SettingsFile::parse(&toml).unwrap().settings(128).unwrap()
}

/// In exposures to a background alone, the engine finds the requested number of events.
#[test]
fn rules_have_the_requested_false_alarms() {
    const ALL: [Rule; 4] = [Rule::Paper, Rule::Window(3), Rule::Average, Rule::Window(5)];
    let rules = slow_or_quick(&ALL[..], &ALL[..2]);
    for &(background, l1) in slow_or_quick(&[(0.02, 40), (0.1, 4)][..], &[(0.02, 40)]) {
        let settings = settings(l1);
        let found = Thresholds::simulate(rules, &settings, background, 1, &|_| Ok(())).unwrap();
        let scene = format!("columns = 64\nrows = 32\ncycles = 8000\nbackground = {background}\n");
        let scene = Scene::parse(&scene).unwrap();
        for &rule in rules {
            let threshold = found.of(rule, 0.01).unwrap();
            let of_rule = settings
                .clone()
                .configured(|array| array.rule = rule.with(threshold, 5).unwrap());
            let mut photons = scene.photons(7, scene.cycles).unwrap();
            let addresses = photons.addresses();
            let mut engine = host_engine(&of_rule, photons.array(), &addresses).unwrap();
            for _ in 0..scene.cycles / 250 {
                let slice = photons.next_slice(250).unwrap();
                engine.run(&slice).unwrap();
            }
            let [pixels, _] = engine.statistics();
            let exposures = pixels.events + pixels.expired;
            let share = pixels.events as f64 / exposures as f64;
            // 16,000 exposures with 160 events, found from 200 of 20,000: four standard
            // deviations are a factor of 1.4. The rules of whole counts have a step there.
            let least = if matches!(rule, Rule::Window(_)) {
                0.006
            } else {
                0.001
            };
            assert!(
                (least..0.014).contains(&share),
                "{rule:?} {background} {threshold}: {share}"
            );
        }
    }
}

#[test]
fn harder_conditions_have_the_photons_they_say() {
    let scene = "columns = 9\nrows = 5\ncycles = 4000\nbackground = 0.02\n\
                 [[surface]]\nposition_bins = 60.5\nsignal = 1\n";
    let scene = Scene::parse(scene).unwrap();
    let light = Light {
        background: 0.02,
        signal: 1.0,
        sigma: 1.0,
    };
    let all = Stress::all(&light, 10);
    assert_eq!(all.len(), 9);
    let counted = |stress: &Stress| {
        let photons = Box::new(scene.photons(3, scene.cycles).unwrap());
        let mut photons = Stressed::new(photons, stress, 128, 1.0, 3);
        let mut counts = vec![vec![0.0; 128]; 45];
        // Slices of other lengths have the same photons.
        for _ in 0..8 {
            let slice = photons.next_slice(500).unwrap();
            for (pixel, counts) in slice.pixels.iter().zip(&mut counts) {
                assert!(pixel.photons.is_sorted_by_key(|photon| photon.cycle));
                for photon in &pixel.photons {
                    counts[usize::from(photon.code)] += 1.0 / 4000.0;
                }
            }
        }
        counts
    };
    // Background a bin far from the pulse, and signal, of pixel 40, which is never hot.
    let of = |counts: &[Vec<f64>]| {
        let far: f64 = counts[40][90..].iter().sum::<f64>() / 38.0;
        let near: f64 = counts[40][50..72].iter().sum();
        (far, near - 22.0 * far)
    };
    for (stress, background, signal) in [
        (0, 0.02, 1.0),
        (1, 0.04, 1.0),
        (2, 0.08, 1.0),
        (3, 0.02, 0.5),
        (4, 0.02, 0.25),
        (5, 0.02, 1.0),
        (6, 0.02, 1.0),
        (7, 0.02, 1.0),
    ] {
        let counts = counted(&all[stress]);
        let (far, near) = of(&counts);
        let name = all[stress].name;
        // Five standard deviations: sqrt(0.08 / (38 * 4000)) is 0.0007, sqrt(2.8 / 4000) 0.026.
        assert!((far - background).abs() < 0.0036, "{name} {far}");
        assert!((near - signal).abs() < 0.14, "{name} {near}");
        let hot: f64 = counts[0][90..].iter().sum::<f64>() / 38.0;
        let is_hot = name.starts_with("a hot pixel");
        assert_eq!(hot > 1.8, is_hot, "{name} {hot}");
        let glass: f64 = counts[40][8..20].iter().sum();
        assert_eq!(glass > 9.0, name.starts_with("a glass"), "{name} {glass}");
    }
    // The second laser is in all places in turn: its signal is in 8 times as many bins.
    let (far, _) = of(&counted(&all[8]));
    assert!((far - 0.02 - 1.0 / (8.0 * 128.0)).abs() < 0.001, "{far}");
}

/// A likelihood ratio gains information at a known rate, and needs that of its threshold.
#[test]
fn the_bound_is_that_of_the_information() {
    const ALL: [(f64, f64, f64); 3] = [(0.05, 0.145, 1.0), (0.01, 0.3, 0.6), (0.2, 0.5, 1.5)];
    for &(background, signal, sigma) in slow_or_quick(&ALL[..], &ALL[1..2]) {
        let light = Light {
            background,
            signal,
            sigma,
        };
        let bound = Bound::new(&light, &settings(4), 0.01, 1).unwrap().unwrap();
        let rate = information(background, signal, 64.25, sigma);
        let nats = bound.cycles * rate;
        // One false alarm in 100 exposures of some 250 looks at some 60 places that differ:
        // 4.6 nats if it were one look at one place, at most ln(1.5 million) = 14.2.
        assert!((4.6..14.2).contains(&nats), "{nats}");
        let [near, far] = [100.0, 400.0].map(|cycles| bound.error_mm(cycles));
        assert!((near / far - 2.0).abs() < 1e-6, "{near} {far}");
    }
}

/// The answer lies between two trials. The slowest pixels may report in only one of them.
#[test]
fn the_slowest_pixels_of_the_answer_lie_between_those_of_its_trials() {
    let slowest = |slow: [f64; 2]| {
        let trials = [(5, 100.0, 20.0), (20, 400.0, 5.0)];
        let mut outcomes = trials.map(|(effort, cycles, mm)| outcome(0, effort, cycles, mm, 30.0));
        for (outcome, slow) in outcomes.iter_mut().zip(slow) {
            outcome.figures.slow_cycles = slow;
        }
        let methods = Method::all(U8F8::ONE, 2, true, &Settings::static_scene(1));
        answer(&methods, &outcomes, 10.0).candidates[0].slow_cycles
    };
    assert!((slowest([200.0, 800.0]) - 400.0).abs() < 1e-3);
    assert_eq!(slowest([200.0, f64::INFINITY]), 200.0);
    assert_eq!(slowest([f64::INFINITY, 800.0]), 800.0);
    assert_eq!(slowest([f64::INFINITY; 2]), f64::INFINITY);
}

fn outcome(
    method: usize,
    effort: u16,
    cycles: f64,
    error_mm: f64,
    instructions: f64,
) -> TrialOutcome {
    TrialOutcome {
        trial: Trial {
            method,
            effort,
            settings: settings(4),
        },
        figures: Figures {
            cycles,
            slow_cycles: cycles,
            error_mm,
            reports: 1_000_000_000_000,
            wrong: 0.0,
            stray: 0,
            of_blocks: 0.0,
            silent: 0.0,
        },
        instructions,
    }
}

#[test]
fn the_cheapest_of_the_nearly_fastest_is_taken() {
    let methods = Method::all(U8F8::ONE, 2, true, &Settings::static_scene(1));
    let frames = methods.len() - 1;
    assert_eq!(methods[frames].kind, Kind::Frames);
    let all = [
        // Twice as exact for four times the time: 10 mm is reached at 200 laser cycles.
        outcome(0, 5, 100.0, 14.142, 50.0),
        outcome(0, 20, 400.0, 7.071, 40.0),
        outcome(1, 5, 190.0, 9.999, 80.0),
        outcome(2, 5, 150.0, 10.5, 10.0),
        outcome(3, 5, 230.0, 9.0, 10.0),
        outcome(frames, 1000, 1000.0, 9.9, 1.0),
    ];
    let found = answer(&methods, &all, 10.0);
    let able: Vec<usize> = found
        .candidates
        .iter()
        .map(|choice| choice.method)
        .collect();
    assert_eq!(able, [1, 0, 3]);
    let taken = found.best.unwrap();
    assert_eq!((taken.method, taken.effort), (0, 10));
    assert!((taken.cycles - 200.0).abs() < 0.1 && (taken.error_mm - 10.0).abs() < 0.01);
    // A tenth slower is too slow.
    let found = answer(&methods, &all, 9.95);
    assert_eq!(found.best.unwrap().method, 0);
    // One that is often wrong is not exact.
    let mut wrong = all.clone();
    wrong[1].figures.wrong = 0.03;
    let found = answer(&methods, &wrong, 10.0);
    assert_eq!(found.best.unwrap().method, 1);
    // Unless frames are wrong as often.
    wrong[5].figures.wrong = 0.03;
    assert_eq!(answer(&methods, &wrong, 10.0).best.unwrap().method, 0);
    assert_eq!(answer(&methods, &all, 1.0).best, None);
}

/// Methods that leave a tenth of the pixels more silent than the best full-resolution trial are not taken.
#[test]
fn a_method_that_leaves_pixels_silent_is_not_taken() {
    let methods = Method::all(U8F8::ONE, 2, true, &Settings::static_scene(1));
    let blocks = methods
        .iter()
        .position(|method| !method.has_full_resolution());
    let blocks = blocks.unwrap();
    let frames = methods.len() - 1;
    let silent = |mut outcome: TrialOutcome, silent: f64| {
        outcome.figures.silent = silent;
        outcome
    };
    let taken = |all: &[TrialOutcome], within_mm: f64| {
        let choice = answer(&methods, all, within_mm).best;
        choice.map(|choice| (choice.method, choice.effort))
    };
    let all = [
        // 10 mm are reached at 10 photons, half way between the trials, with 15 % silent pixels.
        silent(outcome(0, 5, 100.0, 14.142, 50.0), 0.05),
        silent(outcome(0, 20, 400.0, 7.071, 50.0), 0.25),
        silent(outcome(1, 5, 300.0, 9.0, 50.0), 0.06),
        // Neither frames nor blocks are the best full-resolution trial.
        silent(outcome(blocks, 5, 1000.0, 9.0, 50.0), 0.0),
        silent(outcome(frames, 1000, 1000.0, 9.9, 1.0), 0.0),
    ];
    assert_eq!(taken(&all, 10.1), Some((0, 10)));
    // A few more are too many: the slower method is taken, in which they report.
    assert_eq!(taken(&all, 9.5), Some((1, 5)));
    // The first trial that is exact, with nothing before it.
    let mut first = all[1..].to_vec();
    assert_eq!(taken(&first, 10.0), Some((1, 5)));
    first[0].figures.cycles = 200.0;
    assert_eq!(taken(&first, 10.0), Some((1, 5)));
    first[0].figures.silent = 0.15;
    assert_eq!(taken(&first, 10.0), Some((0, 20)));
    // If only silent methods are exact, there is none to take.
    assert_eq!(taken(&all[..2], 8.0), None);
    // Only blocks may leave none silent.
    let found = answer(
        &methods,
        &[all[0].clone(), all[1].clone(), all[3].clone()],
        8.0,
    );
    assert_eq!((found.best, found.fastest), (None, None));
    let found = answer(
        &methods,
        &[all[0].clone(), all[1].clone(), all[3].clone()],
        9.5,
    );
    assert_eq!(found.best, None);
    assert_eq!(found.fastest.unwrap().method, blocks);
}

#[test]
fn blocks_are_an_answer_of_their_own() {
    let methods = Method::all(U8F8::ONE, 2, true, &Settings::static_scene(1));
    let number = |name: &str| {
        methods
            .iter()
            .position(|method| method.name == name)
            .unwrap()
    };
    let (window, eight, blocks) = (
        number("window of 3"),
        number("8 neighbours"),
        number("blocks of 4×4"),
    );
    let mut all = vec![
        outcome(window, 5, 300.0, 9.0, 50.0),
        outcome(eight, 5, 100.0, 9.0, 80.0),
        outcome(blocks, 5, 50.0, 9.0, 60.0),
    ];
    let taken = |all: &[TrialOutcome]| {
        let found = answer(&methods, all, 10.0);
        [found.best, found.fastest].map(|choice| choice.map(|choice| choice.method))
    };
    assert_eq!(taken(&all), [Some(eight), Some(blocks)]);
    // Only blocks are exact enough.
    assert_eq!(taken(&all[2..]), [None, Some(blocks)]);
    // Nearly as fast, but dearer.
    all[2].figures.cycles = 95.0;
    all[2].instructions = 90.0;
    assert_eq!(taken(&all), [Some(eight), None]);
    // The cheapest of those that are nearly as fast, but not faster.
    all[2].figures.cycles = 105.0;
    all[2].instructions = 60.0;
    assert_eq!(taken(&all), [Some(eight), None]);
}
