//! Echoes and tracking, with all rules: a pixel beside its model, laser cycle by laser cycle.

use dtof_core::{Flags, Histogram, Look};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::model::{Cycle, Lone, cycle, random_cycles};
use super::whole::{Pixel, Rule, Settings};

/// What came of some runs.
#[derive(Debug, Default)]
struct Seen {
    /// Events by their echo, from 1 on.
    echoes: [u32; 4],
    /// Events by flag.
    flags: [u32; 5],
    ended: u32,
    expired: u32,
    near: u32,
    cramped: u32,
    held: u64,
}

/// Runs both and compares them after each laser cycle. No photon is lost.
fn compare<const BINS: usize>(settings: Settings, cycles: &[Cycle], seen: &mut Seen) {
    let config = settings.config::<BINS>();
    let mut lone = Lone::<BINS>::new(77);
    let mut model = Pixel::new::<BINS>(settings);
    let mut offered = 0;
    for (number, cycle) in (0..).zip(cycles) {
        // In turns one by one, and as a frame.
        let mut frame = [0u32; BINS];
        for &(code, times) in &cycle.photons {
            offered += u64::from(times);
            (0..times).for_each(|_| model.now.count(code.into()));
            match frame.get_mut(usize::from(code)).filter(|_| number % 3 == 0) {
                Some(photons) => *photons += u32::from(times),
                None => (0..times).for_each(|_| lone.pixel.count(&config, code)),
            }
        }
        lone.pixel.count_frame(&config, &frame);
        let was_waiting = lone.pixel.has_event();
        let look = lone.end(&config, number, 1);
        assert_eq!(look, model.end(number, 1), "laser cycle {number}");
        assert!(!(was_waiting && look == Look::Event));
        seen.ended += u32::from(look == Look::Ended);
        seen.expired += u32::from(look == Look::Expired);
        assert_eq!(u32::from(lone.pixel.exposure()), model.now.exposure);
        assert_eq!(
            lone.pixel.histogram().counts().map(u32::from),
            *model.now.counts
        );
        assert_eq!(lone.pixel.has_event(), model.waiting.is_some());
        assert_eq!(lone.statistics(), model.now.statistics);
        assert_eq!(lone.statistics().photons(), offered);
        if cycle.acknowledge {
            let event = lone.pixel.take_event();
            assert_eq!(event, model.waiting.take(), "laser cycle {number}");
            if let Some(event) = event {
                seen.echoes[usize::from(event.echo.raw()) - 1] += 1;
                for (bit, count) in seen.flags.iter_mut().enumerate() {
                    *count += u32::from(event.flags.bits() >> bit & 1);
                }
            }
        }
    }
    assert_eq!(lone.pixel.take_event(), model.waiting);
    seen.near += model.near;
    seen.cramped += model.cramped;
    seen.held += model.now.statistics.excluded;
}

pub fn random_settings(rng: &mut Pcg32, bins: usize) -> Settings {
    let x = 1 + (rng.next_u32() % 8) as u16;
    let l1 = x + (rng.next_u32() % 40) as u16;
    let alpha = (rng.next_u32() % (5 * 256)) as u16;
    let rule = match rng.next_u32() % 4 {
        0 => Rule::Paper(alpha),
        1 => Rule::Average(alpha),
        _ => Rule::Window(
            1 + (rng.next_u32() % 7) as u8,
            (rng.next_u32() % 24_000) as u16,
        ),
    };
    Settings {
        x,
        l1,
        l2: l1 + x + 1 + (rng.next_u32() % 300) as u16,
        first: (rng.next_u32() % 4) as usize,
        last: bins - 1 - (rng.next_u32() % 4) as usize,
        rule,
        minimum: rng.next_u32() % 8,
        is_one_hit: rng.next_u32().is_multiple_of(2),
        echoes: 1 + (rng.next_u32() % 4) as u8,
        reach: (rng.next_u32() % 5) as u8,
        wait: (rng.next_u32() % 12) as u8,
        tracks: rng.next_u32().is_multiple_of(2),
    }
}

#[test]
fn random_pixels_are_as_described() {
    let mut rng = Pcg32::seed_from_u64(1);
    let mut seen = Seen::default();
    for round in 0..2000 {
        let patience = 1 + rng.next_u32() % 30;
        if round % 2 == 0 {
            let settings = random_settings(&mut rng, 16);
            let cycles = random_cycles(16, 800, patience, &mut rng);
            compare::<16>(settings, &cycles, &mut seen);
        } else {
            let settings = random_settings(&mut rng, 64);
            // Two surfaces.
            let mut cycles = random_cycles(64, 800, patience, &mut rng);
            let other = random_cycles(64, 800, patience, &mut rng);
            for (cycle, other) in cycles.iter_mut().zip(other) {
                cycle.photons.extend(other.photons);
            }
            compare::<64>(settings, &cycles, &mut seen);
        }
    }
    println!("{seen:?}");
    assert!(seen.echoes.iter().all(|&events| events > 500), "{seen:?}");
    assert!(seen.flags.iter().all(|&events| events > 50), "{seen:?}");
    assert!(seen.ended > 1000 && seen.expired > 1000, "{seen:?}");
    assert!(
        seen.near > 1000 && seen.cramped > 100 && seen.held > 100_000,
        "{seen:?}"
    );
}

/// Settings of which a look exists; 32 bins.
pub fn settings() -> impl Strategy<Value = Settings> {
    let exposures = (1u16..=6, 0u16..10, 1u16..60);
    let gate = (0usize..=8, 8usize..=32);
    let rule = prop_oneof![
        1 => (0u16..1024).prop_map(Rule::Paper),
        1 => (0u16..1024).prop_map(Rule::Average),
        2 => (1u8..=7, 0u16..24_000).prop_map(|(width, z)| Rule::Window(width, z)),
        1 => (1u8..=7, any::<u16>()).prop_map(|(width, z)| Rule::Window(width, z)),
    ];
    let further = (
        1u8..=4,
        prop_oneof![4 => 0u8..6, 1 => any::<u8>()],
        any::<(u8, bool)>(),
    );
    (exposures, gate, rule, 0u32..6, any::<bool>(), further)
        .prop_map(
            |(
                (x, more, beyond),
                (first, width),
                rule,
                minimum,
                is_one_hit,
                (echoes, reach, (wait, tracks)),
            )| {
                Settings {
                    x,
                    l1: x + more,
                    l2: x + more + beyond,
                    first,
                    last: (first + width - 1).min(31),
                    rule,
                    minimum,
                    is_one_hit,
                    echoes,
                    reach,
                    wait,
                    tracks,
                }
            },
        )
        .prop_filter("no look", |s| (s.l1 + 1..s.l2).any(|n| n % s.x == 0))
}

proptest! {
    #[test]
    fn any_photons_and_acknowledge_times(
        settings in settings(),
        cycles in prop::collection::vec(cycle(), 0..300),
    ) {
        compare::<32>(settings, &cycles, &mut Seen::default());
    }

    /// The echoes of a whole histogram are those of a pixel that looks once and then at the
    /// same photons again.
    #[test]
    fn the_echoes_of_a_whole_histogram(
        settings in settings(),
        frame in prop::array::uniform32(prop_oneof![6 => 0u16..4, 1 => 0u16..60, 1 => Just(2000)]),
    ) {
        let settings = Settings { tracks: false, ..settings };
        let config = settings.config::<32>();
        let mut histogram = Histogram::<32>::new();
        histogram.add_frame(&frame, config.gate());
        let mut model = Pixel::new::<32>(settings);
        for (bin, &photons) in frame.iter().enumerate() {
            (0..photons).for_each(|_| model.now.count(bin));
        }
        let mut expected = Vec::new();
        while let Some(found) = model.decide() {
            expected.push((expected.len() as u8 + 1, found.bin, (found.background + 128) >> 8));
            if expected.len() == usize::from(settings.echoes) || !model.hold(found.bin) {
                break;
            }
            model.empty_held();
        }
        let mut echoes = Vec::new();
        config.detect_echoes(&mut histogram, 1, |number, found| {
            let bin = usize::from(found.peak.bin.raw());
            echoes.push((number.raw(), bin, found.background.raw()));
        });
        prop_assert_eq!(echoes, expected);
        // The last is not emptied.
        prop_assert_eq!(histogram.counts().map(u32::from).to_vec(), model.now.counts);
    }
}

/// The longest wait is no multiple: 2 laser cycles for the first echo, and 600 until L2.
#[test]
fn the_longest_wait_is_until_l2() {
    for (wait, end) in [(254, 508), (255, 600)] {
        let settings = Settings {
            x: 1,
            l1: 1,
            l2: 600,
            first: 0,
            last: 63,
            rule: Rule::Paper(4 * 256),
            minimum: 5,
            is_one_hit: false,
            echoes: 2,
            reach: 4,
            wait,
            tracks: false,
        };
        let config = settings.config::<64>();
        let mut lone = Lone::<64>::new(0);
        let mut looks = (0..end).map(|cycle| {
            (0..5).for_each(|_| lone.pixel.count(&config, 20));
            lone.end(&config, cycle, 1)
        });
        assert_eq!(looks.nth(1), Some(Look::Event));
        assert_eq!(
            looks.position(|look| look == Look::Ended),
            Some(end as usize - 3)
        );
    }
}

/// By hand: 5 photons a laser cycle in bin 20, 3 in bin 32, 1 in bin 26. The first look above
/// L1 finds bin 20, the next bin 32, the third bin 26, right behind the bins around bin 20.
#[test]
fn three_echoes_by_hand() {
    let settings = Settings {
        x: 4,
        l1: 4,
        l2: 40,
        first: 0,
        last: 63,
        rule: Rule::Paper(4 * 256),
        minimum: 5,
        is_one_hit: false,
        echoes: 4,
        reach: 4,
        wait: 2,
        tracks: false,
    };
    let config = settings.config::<64>();
    let mut lone = Lone::<64>::new(0);
    let mut events = Vec::new();
    for cycle in 0..32 {
        for (code, times) in [(20, 5), (26, 1), (32, 3)] {
            (0..times).for_each(|_| lone.pixel.count(&config, code));
        }
        let look = lone.end(&config, cycle, 1);
        assert_eq!(look == Look::Ended, cycle == 31);
        if let Some(event) = lone.pixel.take_event() {
            let (bin, count) = (event.peak_bin.raw(), event.peak_count.raw());
            events.push((cycle, event.echo.raw(), bin, count, event.flags));
        }
    }
    let expected = [
        (7, 1, 20, 40, Flags::NONE),
        (11, 2, 32, 36, Flags::NONE),
        (15, 3, 26, 16, Flags::TAIL),
    ];
    assert_eq!(events, expected);
    // The third took 16 laser cycles, and the exposure ended after 32. All but its photons are around the others. Bin 26 is 6 bins from either.
    let statistics = lone.statistics();
    assert_eq!((statistics.excluded, statistics.counted), (9 * 32, 0));
    assert_eq!((statistics.events, statistics.expired), (3, 0));
}
