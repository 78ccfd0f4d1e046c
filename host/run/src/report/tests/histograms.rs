use super::*;
use dtof_core::BinIndex;
use dtof_core::rule::ExcludedBins;
use dtof_data::photons::source::PhotonSource;
use dtof_engine::decisions::{Decision, KeptPixels};
use dtof_engine::explain::explain_decisions;
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_light::demo;

/// Runs the demo: its last decisions, the data for the script in at most `room` bytes, and their size.
fn decisions_and_data(array: Array, room: usize) -> (Vec<Decision>, serde_json::Value, usize) {
    let settings = Settings::demo(1).unwrap();
    let mut photons = demo::photons(array, 1, 2000).unwrap();
    let mut engine = host_engine(&settings, array, &photons.addresses()).unwrap();
    engine.keep_decisions(&|_| true);
    engine.run(&photons.next_slice(2000).unwrap()).unwrap();
    let all = engine.decisions();
    let decisions = Decisions {
        settings: &settings,
        kept: KeptPixels::new(array, 128),
        all: &all,
        array,
    };
    let (data, bytes) = decisions.data(room);
    (all, data, bytes)
}

/// Each pixel has the exact histogram of its last event, or that of its block, and there are no others.
#[test]
fn the_histogram_of_the_last_event_of_each_pixel_is_in_the_data() {
    let array = Array::new(16, 8).unwrap();
    let (all, data, bytes) = decisions_and_data(array, usize::MAX);
    let settings = Settings::demo(1).unwrap();
    let explanations = explain_decisions(&settings, &all);
    assert_eq!(data["every"], 1);
    assert_eq!(data["gate"], serde_json::json!([0, 127]));
    let text = data["packed"].as_str().unwrap();
    assert_eq!(text.len(), bytes);
    let mut reader = Reader::new(text);
    let mut covered = vec![None; array.pixels() as usize];
    for _ in 0..data["count"].as_u64().unwrap() {
        let [pixel, kind, cycle, exposure] = [(); 4].map(|()| reader.number());
        let of = |decision: &Decision| {
            let event = decision.event;
            let place = (u64::from(event.pixel.raw()), u64::from(event.level.raw()));
            place == (pixel, kind >> 2 & 3)
        };
        let at = all.iter().position(of).unwrap();
        let (
            Decision {
                event,
                counts,
                excluded,
                ..
            },
            explanation,
        ) = (&all[at], &explanations[at]);
        assert_eq!(
            (event.cycle.raw(), u64::from(event.exposure)),
            (cycle, exposure)
        );
        assert_eq!(
            reader.range(),
            range_mm(event, &settings.ranges(array).unwrap())
        );
        assert_eq!(reader.number(), u64::from(event.peak_bin.raw()));
        assert_eq!(reader.number(), u64::from(explanation.needed.unwrap()) + 1);
        assert!((reader.range() - explanation.background.unwrap()).abs() < 1e-9);
        let width = reader.number();
        let first = reader.number();
        assert_eq!(
            explanation
                .window
                .map(|(first, last)| (u64::from(first), u64::from(last))),
            Some((first, first + width - 1))
        );
        let mut is_excluded = [false; 128];
        for _ in 0..reader.number() {
            let [first, last] = [(); 2].map(|()| usize::try_from(reader.number()).unwrap());
            is_excluded[first..=last].fill(true);
        }
        assert!((0..128u16).all(|bin| is_excluded[usize::from(bin)] == excluded.contains(bin)));
        for &count in counts {
            assert_eq!(reader.number(), u64::from(count));
        }
        for pixel in array.pixels_of(event.pixel, event.level) {
            let place = &mut covered[usize::from(pixel.raw())];
            *place = (*place).max(Some(cycle));
        }
    }
    assert!(reader.is_at_end());
    // The latest of each pixel is there.
    for (pixel, covered) in (0u16..).zip(covered) {
        let of = |decision: &&Decision| {
            let Decision { event, .. } = decision;
            array
                .pixels_of(event.pixel, event.level)
                .any(|one| one.raw() == pixel)
        };
        let latest = all
            .iter()
            .filter(of)
            .map(|decision| decision.event.cycle.raw())
            .max();
        assert_eq!(covered, latest, "{pixel}");
    }
}

#[test]
fn histograms_are_thinned_until_there_is_room() {
    let array = Array::new(16, 8).unwrap();
    let (_, whole, bytes) = decisions_and_data(array, usize::MAX);
    let (_, part, fewer) = decisions_and_data(array, bytes / 3);
    assert!(fewer <= bytes / 3 && fewer > 0);
    assert!(whole["count"].as_u64() > part["count"].as_u64());
    assert!(part["every"] == 2 || part["every"] == 4, "{part}");
    let (_, none, bytes) = decisions_and_data(array, 0);
    assert_eq!((&none["count"], bytes), (&0.into(), 0));
}

#[test]
fn a_large_array_of_bright_pixels_stays_below_the_documented_size() {
    let array = Array::new(64, 64).unwrap();
    let settings = Settings::static_scene(0);
    let counts: Vec<u32> = (0..128)
        .map(|bin| if bin == 10 { 1023 } else { 800 + bin })
        .collect();
    let decision = |pixel| Decision {
        event: event(pixel, 1 << 40, 10),
        counts: counts.clone(),
        cycles: 10,
        expected: Some(BinIndex::saturating(3)),
        excluded: ExcludedBins::NONE,
    };
    let all: Vec<Decision> = (0..64 * 64).map(decision).collect();
    let mut sample = sample(Sample::LIMIT, 1 << 18);
    let events = Cloud {
        array,
        decisions: Some(Decisions {
            settings: &settings,
            kept: KeptPixels::new(array, 128),
            all: &all,
            array,
        }),
        ..cloud(&mut sample, 1 << 41, ["event", "events"])
    };
    let page = html("t", "l", &[], &[], events);
    assert!(page.len() < MAX_PAGE, "{}", page.len());
    assert_eq!(data(&page)["histograms"]["count"], 64 * 64);
}

/// Events hold at most 65,535 laser cycles of exposure.
#[test]
fn a_histogram_has_all_laser_cycles_of_a_long_exposure() {
    let array = Array::new(2, 1).unwrap();
    let (mut all, ..) = decisions_and_data(array, usize::MAX);
    let settings = Settings::demo(1).unwrap();
    all.truncate(1);
    all[0].cycles = 200_000;
    all[0].event.exposure = u16::MAX;
    let decisions = Decisions {
        settings: &settings,
        kept: KeptPixels::new(array, 128),
        all: &all,
        array,
    };
    let (data, _) = decisions.data(usize::MAX);
    let mut reader = Reader::new(data["packed"].as_str().unwrap());
    let [_, _, _, cycles] = [(); 4].map(|()| reader.number());
    assert_eq!(cycles, 200_000);
}
