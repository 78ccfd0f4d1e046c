use dtof_core::Array;
use dtof_data::photons::source::{Photon, PixelPhotons};
use dtof_data::random::pixel_rng;
use proptest::prelude::*;
use rand_distr::{Distribution, Poisson};

use super::*;

const CYCLES: u16 = 1000;
const PIXELS: usize = 8;

/// The settings of window, z and echoes that a run would have.
fn input(more: &str) -> MapInput {
    let text = format!("[sensor]\nsigma_bins = 1\n[detection]\nrule = \"window\"\nz = 4\n{more}");
    let requested = SettingsFile::parse(&text).unwrap();
    let settings = requested.settings(128).unwrap();
    MapInput::new(&requested, &settings, None, &requested)
        .unwrap()
        .unwrap()
}

/// Photons of pixels with a background and two surfaces, in bins 40 and 90, of so many photons in each half.
fn run(seed: u64, surfaces: [[f64; 2]; 2]) -> RunCounts {
    let pulse = |code: u16, at: u16| match code.abs_diff(at) {
        0 => 0.4,
        1 => 0.3,
        _ => 0.0,
    };
    run_with(seed, &|half, code| {
        let surfaces = surfaces[half];
        5.0 + surfaces[0] * pulse(code, 40) + surfaces[1] * pulse(code, 90)
    })
}

/// Photons of pixels with these means in each half.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a number of photons"
)]
fn run_with(seed: u64, means: &dyn Fn(usize, u16) -> f64) -> RunCounts {
    let mut counts = RunCounts::new(PIXELS, 128, u64::from(CYCLES) * 2);
    for half in 0..2 {
        let pixels = (0..PIXELS).map(|pixel| {
            let address = u16::try_from(pixel).unwrap();
            let mut random = pixel_rng(seed * 2 + half, PixelAddress::new(address));
            let mut photons = Vec::new();
            for code in 0..128_u16 {
                let mean = Poisson::new(means(half as usize, code)).unwrap();
                let number = mean.sample(&mut random) as u32;
                photons.extend((0..number).map(|_| Photon { cycle: 0, code }));
            }
            PixelPhotons {
                cycles: CYCLES,
                photons,
            }
        });
        counts.add(&Slice {
            first_cycle: half * u64::from(CYCLES),
            pixels: pixels.collect(),
        });
    }
    counts
}

fn all(run: &RunCounts) -> PixelCounts {
    let [first, second] = &run.halves;
    first.clone().with(second)
}

fn decide(input: &MapInput, run: &RunCounts) -> DepthMap {
    let array = Array::new(8, 1).unwrap();
    let addresses: Vec<_> = (0..8).map(PixelAddress::new).collect();
    let contradictions = run.contradictions(input, array, &addresses).unwrap();
    DepthMap::decide(input, Some(&all(run)), &contradictions, array, &addresses)
        .unwrap()
        .unwrap()
}

#[test]
fn a_surface_that_moves_is_told() {
    for more in ["", "neighbours = 8", "binning = 2", "echoes = 2"] {
        let map = decide(&input(more), &run(1, [[600.0, 0.0], [0.0, 200.0]]));
        // The depth is that of the stronger one, which is not there any more.
        assert!(map.positions.iter().all(|at| at.unwrap().raw() / 256 == 40));
        assert_eq!(map.flags, [SECOND_SURFACE | CONTRADICTION; 8], "{more}");
        let warning = map.warning(true).unwrap();
        assert!(
            warning.starts_with("8 of 8 pixels see one surface"),
            "{warning}"
        );
        assert_eq!(map.pixels_with_depth(), 8);
        assert_eq!(map.echoes_mm.is_some(), more.starts_with("echoes"));
    }
}

/// An echo on the tail of the first is no surface: the farthest is the first, or what lies behind.
#[test]
fn a_tail_is_no_farthest_surface() {
    let input = input("echoes = 3");
    for (behind, expected) in [(0.0, 41), (400.0, 90)] {
        let map = decide(
            &input,
            &run_with(3, &|_, code| {
                let tail = |code: u16| 900.0 * (-f64::from(code - 40) / 2.5).exp();
                let first = if code < 40 { 0.0 } else { tail(code) };
                5.0 + first + if code == 90 { behind } else { 0.0 }
            }),
        );
        let [nearest, farthest] = map.echoes_mm.as_ref().unwrap();
        assert_eq!(nearest, &map.depth_mm);
        let mm = f64::from(expected) * 250.0 * 0.149_896_229;
        let is_expected = |depth: &f64| (depth - mm).abs() < 100.0;
        assert!(farthest.iter().all(is_expected), "{farthest:?}");
        let flag = if behind > 0.0 { SECOND_SURFACE } else { 0 };
        assert_eq!(map.flags, [flag; 8]);
    }
}

/// Its old place is taken for a cover glass, and gated away.
#[test]
fn what_moves_before_a_gate_that_was_found_is_told() {
    let moves = run(1, [[600.0, 0.0], [0.0, 200.0]]);
    let still = run(2, [[600.0, 200.0]; 2]);
    let mut input = input("");
    input.settings.configuration.gate = (60, 127);
    for (given_gate, expected) in [(None, 8), (Some((60, 127)), 0)] {
        input.given_gate = given_gate;
        let map = decide(&input, &moves);
        assert!(map.positions.iter().all(|at| at.unwrap().raw() / 256 == 90));
        let flags = map.flags.iter();
        let told = flags.filter(|&&flags| flags & CONTRADICTION != 0);
        assert_eq!(told.count(), expected);
        assert_eq!(decide(&input, &still).warning(true), None);
    }
}

#[test]
fn frames_have_no_map() {
    let requested = SettingsFile::parse("[run]\nframe = 100\n").unwrap();
    let settings = requested.settings(128).unwrap();
    assert!(
        MapInput::new(&requested, &settings, None, &requested)
            .unwrap()
            .is_none()
    );
}

/// A z of a file with looks is not for a single decision. One of an option holds.
#[test]
fn z_is_that_of_a_single_decision() {
    let file = "[detection]\nrule = \"window\"\nwindow = 3\nz = 5\n";
    let file = SettingsFile::parse_as(std::path::Path::new("a.toml"), file).unwrap();
    let once = SettingsFile::parse(
        "[detection]\nrule = \"window\"\nwindow = 3\n[run]\ndecide_once = true\n",
    );
    let once = once.unwrap().settings(128).unwrap();
    let of = |requested: &SettingsFile, false_alarm| {
        let settings = requested.settings(128).unwrap();
        let mut given = SettingsFile::default();
        given.detection.false_alarm = false_alarm;
        let map = MapInput::new(requested, &settings, None, &given).unwrap();
        map.unwrap().settings.configuration.rule
    };
    assert_eq!(of(&file, None), once.configuration.rule);
    assert_ne!(of(&file, Some(0.0001)), once.configuration.rule);
    let option = SettingsFile::parse("[detection]\nz = 5\n").unwrap();
    let merged = option.or(file);
    assert_eq!(
        of(&merged, None),
        merged.settings(128).unwrap().configuration.rule
    );
}

/// 8,000 pixels with two surfaces that stay, of any brightness: at most one in 1,000 recordings is flagged as moved.
#[test]
fn still_surfaces_do_not_contradict_themselves() {
    let input = input("");
    let mut told = 0;
    for seed in 0..1000 {
        let light = 40.0 + seed as f64 % 50.0 * 20.0;
        // As bright, and a little less.
        let surfaces = [light, light * (1.0 - seed as f64 % 3.0 * 0.05)];
        let map = decide(&input, &run(seed, [surfaces, surfaces]));
        told += u32::from(map.warning(true).is_some());
    }
    assert!(told <= 1, "{told}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(30))]
    /// The map is that of a decision on all photons, whatever the halves have.
    #[test]
    fn the_map_is_decided_on_all(seed in 0_u64..1000, a in 0.0..300.0, b in 0.0..300.0) {
        let (input, run) = (input(""), run(seed, [[a, b], [b, a]]));
        let map = decide(&input, &run);
        let addresses: Vec<_> = (0..8).map(PixelAddress::new).collect();
        let array = Array::new(8, 1).unwrap();
        let decided = decide_once(&input.settings, array, &addresses, &all(&run), |_| false).unwrap();
        for (place, decided) in decided.iter().enumerate() {
            let first = decided.echoes.first().map(|(_, echo)| echo.position());
            prop_assert_eq!(map.positions[place], first);
            prop_assert_eq!(map.depth_mm[place].is_nan(), first.is_none());
            prop_assert!(map.best_mm[place] > 0.0);
            prop_assert!(first.is_none() || map.best_mm[place] == map.depth_mm[place]);
            prop_assert!(first.is_some() || map.flags[place] == 0);
        }
    }
}
