//! Tests of the engine and of sources of photons, with simulated photons.

use dtof_core::fixed::types::U8F8;
use dtof_core::neighbours::NeighbourConfig;
use dtof_core::{
    AnyRule, Array, ArrayConfig, AverageRule, BlockLevel, Count, DepthEvent, EchoNumber, Flags,
    Neighbours, PaperRule, PixelAddress, PixelArray, PixelPlace, WindowRule,
};
use dtof_data::photons::masked::Masked;
use dtof_data::photons::source::{PhotonSource, Slice};
use dtof_engine::decisions::Decision;
use dtof_engine::explain::explain_decisions;
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;

use dtof_light::demo;

const ARRAY: Array = Array::new(8, 4).unwrap();

/// Events and decisions of the demo in slices of so many laser cycles, and its photons.
fn run(settings: &Settings, length: u16) -> (Vec<DepthEvent>, Vec<Decision>, Vec<Slice>) {
    let mut photons = demo::photons(ARRAY, 3, 3000).unwrap();
    let mut engine = host_engine(settings, ARRAY, &photons.addresses()).unwrap();
    engine.keep_decisions(&|_| true);
    let (mut events, mut slices, mut done) = (Vec::new(), Vec::new(), 0);
    while done < photons.cycles() {
        let next = u16::try_from(photons.cycles() - done).map_or(length, |left| left.min(length));
        let slice = photons.next_slice(next).unwrap();
        events.extend(engine.run(&slice).unwrap());
        slices.push(slice);
        done += u64::from(next);
    }
    (events, engine.decisions(), slices)
}

fn rules() -> [AnyRule; 3] {
    let least = Count::saturating(5);
    let alpha = U8F8::lit("4");
    [
        PaperRule::new(alpha, least).into(),
        AverageRule::new(alpha, least).into(),
        WindowRule::new(3, "4.5".parse().unwrap(), least)
            .unwrap()
            .into(),
    ]
}

fn with_neighbours(neighbours: Neighbours) -> Settings {
    Settings::static_scene(0).configured(|array| {
        array.rule = rules()[2];
        array.neighbours = Some(neighbours);
    })
}

/// Settings that cover everything a decision depends on.
fn all_settings() -> Vec<Settings> {
    let plain = rules().map(|rule| Settings::static_scene(0).configured(|array| array.rule = rule));
    let window = plain[2].clone();
    let gated = plain
        .clone()
        .map(|settings| settings.configured(|array| array.gate = (30, 119)));
    let echoes = plain.clone().map(|settings| {
        settings.configured(|array| {
            array.echoes = EchoNumber::new(3).unwrap();
            array.echo_wait = 4;
        })
    });
    let tracking = window.clone().configured(|array| array.tracking = true);
    let both = echoes[2].clone().configured(|array| array.tracking = true);
    let frames = Settings {
        frame: Some(500),
        ..window
    };
    let mut all = vec![
        tracking,
        both,
        frames,
        Settings::demo(3).unwrap(),
        with_neighbours(Neighbours::Four),
        with_neighbours(Neighbours::Eight),
    ];
    all.extend(plain.into_iter().chain(gated).chain(echoes));
    all
}

#[test]
fn the_last_event_of_every_pixel_and_block_is_kept() {
    for settings in all_settings() {
        let (events, decisions, _) = run(&settings, 256);
        let mut last = std::collections::BTreeMap::new();
        for event in &events {
            last.insert((event.level, event.pixel), *event);
        }
        assert!(last.len() > 20, "{}", last.len());
        let kept = decisions.iter().map(|decision| &decision.event);
        assert!(kept.eq(last.values()), "{settings:?}");
    }
}

/// Counted from the photons, without the pixel.
#[test]
fn counts_are_the_photons_of_the_exposure() {
    for settings in all_settings() {
        let (_, decisions, slices) = run(&settings, 100);
        let mut compared = 0;
        let gate = settings.gate().unwrap_or((0, 127));
        for decision in decisions {
            let event = decision.event;
            if event.level != BlockLevel::PIXEL {
                continue;
            }
            let first = event.cycle.raw() + 1 - u64::from(event.exposure);
            let mut counts = vec![0u32; 128];
            for slice in &slices {
                for photon in &slice.pixels[usize::from(event.pixel.raw())].photons {
                    let cycle = slice.first_cycle + u64::from(photon.cycle);
                    let is_counted = (first..=event.cycle.raw()).contains(&cycle)
                        && (gate.0..=gate.1).contains(&photon.code)
                        && !decision.excluded.contains(photon.code);
                    counts[usize::from(photon.code)] += u32::from(is_counted);
                }
            }
            assert_eq!(decision.counts, counts, "{event:?} {settings:?}");
            compared += 1;
        }
        assert!(compared > 15, "{compared}");
    }
}

/// A block counts photons of silent pixels only.
#[test]
fn counts_of_a_block_are_those_its_event_tells() {
    let settings = Settings::demo(3).unwrap();
    let (_, decisions, _) = run(&settings, 256);
    let blocks = decisions
        .iter()
        .filter(|decision| decision.event.level > BlockLevel::PIXEL);
    assert!(blocks.count() > 3);
    for Decision { event, counts, .. } in decisions {
        let peak = counts[usize::from(event.peak_bin.raw())];
        assert_eq!(peak, event.peak_count.raw());
    }
}

#[test]
fn decisions_do_not_depend_on_slices_or_threads() {
    let neighbours = with_neighbours(Neighbours::Eight);
    for settings in [
        Settings::demo(3).unwrap(),
        Settings::static_scene(0),
        neighbours,
    ] {
        let (_, all, _) = run(&settings, 256);
        let one = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .unwrap();
        for length in [1, 37, 255] {
            assert_eq!(one.install(|| run(&settings, length)).1, all);
        }
    }
}

/// With every rule, the photons needed are at most those of the peak, and the background is the
/// event's.
#[test]
fn an_explanation_agrees_with_the_event() {
    for settings in all_settings() {
        let (_, decisions, _) = run(&settings, 256);
        let explanations = explain_decisions(&settings, &decisions);
        assert_eq!(explanations.len(), decisions.len());
        let mut exactly = 0;
        for (explained, Decision { event, counts, .. }) in explanations.iter().zip(&decisions) {
            if event.flags.contains(Flags::CONFIRMED) {
                continue;
            }
            let bin = event.peak_bin.raw();
            assert_eq!(explained.peak, (bin, event.peak_count.raw()));
            assert!(!explained.depends);
            let needed = explained.needed.unwrap();
            assert!(needed <= explained.peak.1, "{event:?} {settings:?}");
            exactly += usize::from(needed == explained.peak.1);
            let background = explained.background.unwrap();
            let reported = f64::from(event.background.raw());
            assert!(
                (background - reported).abs() <= 0.5,
                "{background} {event:?} {settings:?}"
            );
            let is_window = matches!(settings.configuration.rule, AnyRule::Window(_))
                && settings.frame.is_none();
            assert_eq!(explained.window.is_some(), is_window);
            if let (Some((first, last)), false) =
                (explained.window, settings.configuration.tracking)
            {
                assert!((first..=last).contains(&bin));
            }
            assert_eq!(counts.len(), 128);
        }
        // Most events come as soon as possible, except in frames.
        assert!(exactly > 0 || settings.frame.is_some(), "{settings:?}");
    }
}

#[test]
fn decisions_are_kept_only_on_request() {
    let mut photons = demo::photons(ARRAY, 3, 2000).unwrap();
    let mut engine = host_engine(&Settings::static_scene(0), ARRAY, &photons.addresses()).unwrap();
    engine.run(&photons.next_slice(256).unwrap()).unwrap();
    assert!(engine.decisions().is_empty());
    engine.keep_decisions(&|pixel| pixel.raw() == 5);
    engine.run(&photons.next_slice(1744).unwrap()).unwrap();
    let kept = engine.decisions();
    assert!(
        kept.iter()
            .map(|decision| decision.event.pixel.raw())
            .eq([5])
    );
}

#[test]
fn only_masked_pixels_lose_their_photons_and_they_are_counted() {
    let array = Array::new(4, 2).unwrap();
    let photons = || Box::new(demo::photons(array, 1, 100).unwrap());
    let all = photons().next_slice(100).unwrap();
    let mut masked = Masked::new(photons(), &[1, 6, 6]).unwrap();
    let part = masked.next_slice(100).unwrap();
    let mut lost = 0;
    for (pixel, (all, part)) in all.pixels.iter().zip(&part.pixels).enumerate() {
        if [1, 6].contains(&pixel) {
            assert!(part.photons.is_empty() && !all.photons.is_empty());
            lost += all.photons.len() as u64;
        } else {
            assert_eq!(all, part);
        }
    }
    assert_eq!(masked.masked(), lost);
    let refused = Masked::new(photons(), &[8]).err().unwrap();
    assert_eq!(refused.to_string(), "masked 8: there are 8 pixels");
}

/// Those of the core's array, whose pixels all end each laser cycle together. With more pixels than one thread gets.
#[test]
fn neighbours_confirm_as_in_the_core() {
    const LARGE: Array = Array::new(40, 20).unwrap();
    for neighbours in [Neighbours::Four, Neighbours::Eight] {
        let settings = with_neighbours(neighbours);
        let mut photons = demo::photons(LARGE, 3, 1000).unwrap();
        let addresses = photons.addresses();
        let mut engine = host_engine(&settings, LARGE, &addresses).unwrap();
        let slices = [100, 250, 650].map(|cycles| photons.next_slice(cycles).unwrap());
        let events: Vec<DepthEvent> = slices
            .iter()
            .flat_map(|slice| engine.run(slice).unwrap())
            .collect();
        let AnyRule::Window(rule) = &settings.configuration.rule else {
            panic!("{settings:?}");
        };
        let rule = NeighbourConfig::new(LARGE, neighbours, rule);
        let config = settings.config::<128>().unwrap();
        let config = ArrayConfig::new(LARGE, config).neighbours(rule).unwrap();
        let mut places: Vec<PixelPlace<128>> = Vec::new();
        places.resize_with(addresses.len(), PixelPlace::new);
        let mut array = PixelArray::new(&mut places, &mut []);
        array.configure(&config).unwrap();
        let mut expected = Vec::new();
        for slice in &slices {
            for cycle in 0..slice.pixels[0].cycles {
                for (number, received) in slice.pixels.iter().enumerate() {
                    let photons = received.photons.iter();
                    let now = photons.filter(|photon| photon.cycle == cycle);
                    now.for_each(|photon| array.photon(number, photon.code));
                }
                array.end_laser_cycle();
                expected.extend(std::iter::from_fn(|| array.next_event()));
            }
        }
        assert!(events == expected);
        assert_eq!(engine.statistics(), array.statistics());
        let confirmed = events
            .iter()
            .filter(|event| event.flags.contains(Flags::CONFIRMED));
        assert!(confirmed.count() > 10);
    }
}

/// The threshold of such an event is not one of the pixel's own photons.
#[test]
fn a_confirmed_event_depends_on_neighbours() {
    let settings = with_neighbours(Neighbours::Eight);
    let (_, decisions, _) = run(&settings, 256);
    let explanations = explain_decisions(&settings, &decisions);
    let mut confirmed = 0;
    for (decision, explanation) in decisions.iter().zip(&explanations) {
        let is_confirmed = decision.event.flags.contains(Flags::CONFIRMED);
        assert_eq!(explanation.depends, is_confirmed);
        assert_eq!(explanation.needed.is_none(), is_confirmed);
        confirmed += u32::from(is_confirmed);
    }
    assert!(confirmed > 0);
}

/// What it cannot be used with is refused.
#[test]
fn neighbours_need_the_window_rule_and_no_dead_time() {
    let good = with_neighbours(Neighbours::Eight);
    let refused = |settings: &Settings| {
        let addresses = [PixelAddress::new(0)];
        let engine = host_engine(settings, ARRAY, &addresses);
        engine.map(|_| ()).map_err(|error| format!("{error:#}"))
    };
    assert_eq!(refused(&good), Ok(()));
    let paper = good.clone().configured(|array| array.rule = rules()[0]);
    let reason = refused(&paper).unwrap_err();
    assert!(reason.contains("is for"), "{reason}");
    let blocks = good
        .clone()
        .configured(|array| array.binning = Settings::demo(3).unwrap().configuration.binning);
    let reason = refused(&blocks).unwrap_err();
    assert!(reason.contains("cannot be used with binning"), "{reason}");
    let dead = good.configured(|array| array.dead_time = Some(128));
    assert!(
        refused(&dead)
            .unwrap_err()
            .contains("cannot be used with a dead time")
    );
}
