//! Compares the engine of this computer with the float reference, event by event, on simulated
//! scenes: window rule, tracking, echoes and blocks.
//!
//! One difference is allowed: the window rule in integers rounds down z² to 1/256, its sixth to
//! 1/16, its 36th to 1/576 and a quotient to 16 bits. If a window lies within that rounding, the
//! reference takes the engine's answer. Such windows are counted.

use std::collections::BTreeMap;

use dtof_core::fixed::types::U4F12;
use dtof_core::rule::z_for_levels;
use dtof_core::{
    AnyRule, BlockLevel, Count, DepthEvent, EchoNumber, Flags, PixelConfig, RangeGate, WindowRule,
};
use dtof_data::photons::source::PhotonSource as _;
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_host_tests::reference::{BinnedArray, EchoConfig, Reporter, Window};
use dtof_light::scene::Scene;
use dtof_link::AdaptiveBinning;

const BINS: usize = 128;

/// A dim wall with a matt and a bright box in front of it, and a second echo of each.
const SCENE: &str = r#"
columns = 11
rows = 9
background = 0.02
pulse_sigma_bins = 0.9

[[surface]]
name = "wall"
range_mm = 2600
signal = 0.05

[[surface]]
name = "matt box"
range_mm = 2200
signal = 0.3
rectangle = { columns = [2, 6], rows = [1, 6] }

[[surface]]
name = "bright box"
range_mm = 1500
signal = 1.5
rectangle = { columns = [7, 10], rows = [3, 8] }

[second_echo]
share = 0.3
behind_mm = 400
"#;

/// The counts of a run.
#[derive(Debug, Default)]
struct Tally {
    decisions: u32,
    /// Windows within the rounding, and how many of them the engine and the formula decided
    /// differently.
    close: u32,
    explained: u32,
    levels: [u32; 4],
    echoes: [u32; 4],
    expected: u32,
    tails: u32,
}

/// The range of photons in which integers may decide either way.
fn rounding(window: &Window) -> (f64, f64) {
    let (z, variance) = (window.z, window.variance());
    let (c, unit) = (z * z / 36.0, 1.0 / (window.bins * window.bins));
    let level = |z: f64, c: f64, part: f64| {
        let spread = if variance > 0.0 {
            variance * variance / (variance + c)
        } else {
            0.0
        };
        let spread = (spread + part).max(0.0).sqrt();
        window.total * window.share() + window.skew() + z * spread
    };
    let z_low = (z * z - 1.0 / 256.0).max(0.0).sqrt();
    let part = variance / 32_768.0;
    let low = level(z_low, c, -part - unit / 16.0) - 0.0626;
    let high = level(z, (c - 1.0 / 576.0 - unit).max(0.0), part);
    (low * (1.0 - 1e-6), high * (1.0 + 1e-6))
}

fn reference_config(config: &PixelConfig<BINS, AnyRule>) -> EchoConfig {
    let window = |rule: &AnyRule| match rule {
        AnyRule::Window(rule) => *rule,
        _ => unreachable!("only the window rule"),
    };
    let (rule, z) = (window(config.rule()), |rule: &AnyRule| {
        window(rule).z().to_num()
    });
    EchoConfig {
        x: config.x().into(),
        l1: config.l1().into(),
        l2: config.l2().into(),
        width: rule.width().into(),
        z: rule.z().to_num(),
        tracking: config
            .tracking()
            .map(|tracking| (z(tracking.near()), z(tracking.far()))),
        minimum_count: rule.minimum_count().raw().into(),
        first: config.gate().first().into(),
        last: config.gate().last().into(),
        echoes: config.echoes().raw().into(),
        reach: config.echo_guard_bins().into(),
        wait: Some(config.echo_wait().into()).filter(|&times| times < 255),
    }
}

/// Runs both on the same photons.
fn compare(settings: &Settings, cycles: u64, tally: &mut Tally) {
    let scene = Scene::parse(SCENE).unwrap();
    let mut photons = scene.photons(settings.seed, cycles).unwrap();
    let array = photons.array();
    let addresses = photons.addresses();
    let mut engine = host_engine(settings, array, &addresses).unwrap();
    let configs = (settings.config().unwrap(), settings.block_config().unwrap());
    let levels = settings
        .configuration
        .binning
        .map_or(0, |binning| binning.levels.raw());
    let patience = settings
        .configuration
        .binning
        .map_or(1, |binning| binning.patience);
    let mut array = BinnedArray::new(
        (array.columns(), array.rows()),
        levels.into(),
        patience.into(),
        (reference_config(&configs.0), reference_config(&configs.1)),
        BINS,
    );
    for _ in 0..cycles / 100 {
        let slice = photons.next_slice(100).unwrap();
        let events = engine.run(&slice).unwrap();
        let of_engine: BTreeMap<(u64, Reporter), DepthEvent> = events
            .iter()
            .map(|event| {
                let (level, first) = (event.level.raw().into(), event.pixel.raw().into());
                ((event.cycle.raw(), Reporter { level, first }), *event)
            })
            .collect();
        assert_eq!(
            of_engine.len(),
            events.len(),
            "one event each, a laser cycle"
        );
        let mut next = vec![0; slice.pixels.len()];
        let mut of_reference = 0;
        for cycle in 0..100u16 {
            for (address, (pixel, next)) in (0..).zip(slice.pixels.iter().zip(&mut next)) {
                while let Some(photon) = pixel.photons.get(*next).filter(|p| p.cycle == cycle) {
                    array.photon(address, photon.code.into());
                    *next += 1;
                }
            }
            let now = slice.first_cycle + u64::from(cycle);
            let found = array.end_laser_cycle(|reporter, window| {
                tally.decisions += 1;
                let (low, high) = rounding(window);
                assert!(
                    low <= window.level() && window.level() <= high,
                    "{window:?}"
                );
                if !(low..=high).contains(&window.inside) {
                    return window.stands_clear();
                }
                let event = of_engine.get(&(now, reporter));
                let fires =
                    event.is_some_and(|event| usize::from(event.peak_bin.raw()) == window.bin);
                tally.close += 1;
                tally.explained += u32::from(fires != window.stands_clear());
                fires
            });
            for (reporter, echo) in found {
                let context = format!("laser cycle {now}, {reporter:?}, {echo:?}");
                let event = of_engine.get(&(now, reporter)).expect(&context);
                of_reference += 1;
                assert_eq!(usize::from(event.echo.raw()), echo.number, "{context}");
                assert_eq!(u32::from(event.exposure), echo.exposure, "{context}");
                assert_eq!(
                    usize::from(event.peak_bin.raw()),
                    echo.window.bin,
                    "{context}"
                );
                assert_eq!(f64::from(event.peak_count.raw()), echo.count, "{context}");
                // Rounded to 1/256, and then to whole counts.
                let background = f64::from(event.background.raw());
                assert!((background - echo.window.background()).abs() <= 0.5 + 1.0 / 256.0);
                let above = echo.count - echo.window.background();
                let rounding = 1.0 / 512.0 + 3.0 / 256.0 / above + 1e-9;
                let position = f64::from(event.position().raw()) / 256.0;
                assert!(
                    (position - echo.position).abs() <= rounding,
                    "{context}, {position}"
                );
                assert_eq!(event.flags.contains(Flags::TAIL), echo.is_tail, "{context}");
                assert_eq!(
                    event.flags.contains(Flags::CLIPPED),
                    echo.is_clipped,
                    "{context}"
                );
                tally.levels[reporter.level as usize] += 1;
                tally.echoes[echo.number - 1] += 1;
                tally.expected += u32::from(echo.is_expected);
                tally.tails += u32::from(echo.is_tail);
            }
        }
        assert_eq!(of_reference, events.len(), "the engine reports no more");
    }
}

fn settings(levels: u8, tracking: bool, echoes: u8, seed: u64) -> Settings {
    let levels = BlockLevel::new(levels).unwrap();
    let gate = RangeGate::<BINS>::full();
    let z: U4F12 = z_for_levels(100, &gate, 4, 40, 1000, levels);
    let patience = 100;
    Settings::static_scene(seed).configured(|array| {
        array.rule = WindowRule::new(3, z, Count::saturating(5)).unwrap().into();
        array.l1 = 40;
        array.l2 = 1000;
        array.x = 4;
        array.binning =
            (levels > BlockLevel::PIXEL).then_some(AdaptiveBinning { levels, patience });
        array.tracking = tracking;
        array.echoes = EchoNumber::new(echoes).unwrap();
        array.echo_wait = if seed.is_multiple_of(2) { 5 } else { u8::MAX };
    })
}

#[test]
fn the_engine_and_the_float_reference_agree() {
    let mut all = Tally::default();
    for (seed, (levels, tracking, echoes)) in (1..).zip([
        (0, false, 1),
        (0, true, 1),
        (0, false, 4),
        (0, true, 2),
        (1, false, 1),
        (2, true, 1),
        (3, false, 1),
        (3, true, 4),
    ]) {
        let mut tally = Tally::default();
        compare(&settings(levels, tracking, echoes, seed), 6000, &mut tally);
        println!("{levels} levels, tracking {tracking}, {echoes} echoes: {tally:?}");
        assert!(
            tally.levels[..=usize::from(levels)]
                .iter()
                .all(|&events| events > 0)
        );
        assert!(
            tally.echoes[..usize::from(echoes.min(2))]
                .iter()
                .all(|&events| events > 100)
        );
        assert_eq!(tally.expected > 100, tracking);
        // The rounding affects few windows.
        assert!(tally.close * 50 < tally.decisions, "{tally:?}");
        all.decisions += tally.decisions;
        all.explained += tally.explained;
        all.tails += tally.tails;
    }
    println!("{all:?}");
    assert!(all.tails > 0);
    // One decision in 4,000.
    assert!(all.explained * 2000 < all.decisions, "{all:?}");
}
