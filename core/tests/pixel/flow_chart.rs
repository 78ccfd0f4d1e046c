//! Whatever comes, a pixel follows the flow chart.

use dtof_core::{Look, PixelConfig, Statistics};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::model::{Lone, Model, Settings, compare, cycle, random_cycles, settings};

/// Section III-B.
const PAPER: Settings = Settings {
    x: 10,
    l1: 100,
    l2: 2000,
    first: 0,
    last: 127,
    alpha: 8 * 256,
    minimum: 5,
    is_one_hit: false,
};

#[test]
fn random_pixels_follow_the_flow_chart() {
    let mut rng = Pcg32::seed_from_u64(1);
    let mut seen = Statistics::default();
    for _ in 0..600 {
        let x = 1 + (rng.next_u32() % 8) as u16;
        let l1 = x + (rng.next_u32() % 40) as u16;
        let settings = Settings {
            x,
            l1,
            l2: l1 + x + 1 + (rng.next_u32() % 200) as u16,
            first: (rng.next_u32() % 4) as usize,
            last: 15 - (rng.next_u32() % 4) as usize,
            alpha: (rng.next_u32() % (8 * 256)) as u16,
            minimum: rng.next_u32() % 10,
            is_one_hit: rng.next_u32().is_multiple_of(2),
        };
        let patience = 1 + rng.next_u32() % 100;
        let cycles = random_cycles(16, 1000, patience, &mut rng);
        seen += compare::<16>(settings, &cycles);
    }
    for number in [seen.saturated, seen.rejected, seen.gated_out] {
        assert!(number > 1000, "{seen:?}");
    }
    for number in [seen.events, seen.deferred, seen.expired] {
        assert!(number > 1000, "{seen:?}");
    }
}

#[test]
fn the_paper_s_settings_on_128_bins() {
    let mut rng = Pcg32::seed_from_u64(2);
    let mut seen = Statistics::default();
    // Section III-B, and section IV with X = 4 and L1 = 40.
    for (x, l1) in [(10, 100), (4, 40)] {
        let settings = Settings { x, l1, ..PAPER };
        for _ in 0..10 {
            let cycles = random_cycles(128, 10_000, 60, &mut rng);
            seen += compare::<128>(settings, &cycles);
        }
    }
    assert!(
        seen.events > 100 && seen.deferred > 100 && seen.expired > 5,
        "{seen:?}"
    );
}

proptest! {
    #[test]
    fn any_photons_and_acknowledge_times_follow_the_flow_chart(
        settings in settings(),
        cycles in prop::collection::vec(cycle(), 0..300),
    ) {
        compare::<16>(settings, &cycles);
    }

    /// Batches of any length, some of them long enough to fill a counter.
    #[test]
    fn a_batch_is_its_photons_one_at_a_time(
        settings in settings(),
        batches in prop::collection::vec(prop::collection::vec((0u16..20, 1usize..200), 0..30), 0..10),
    ) {
        let config = settings.config::<16>();
        let mut single = Lone::<16>::new(77);
        let mut batched = Lone::<16>::new(77);
        let mut model = Model::new(16, settings);
        for runs in batches {
            let runs = runs.into_iter().map(|(code, times)| vec![code; times]);
            let codes: Vec<u16> = runs.flatten().collect();
            batched.pixel.count_batch(&config, &codes);
            for code in codes {
                single.pixel.count(&config, code);
                model.now.count(code.into());
            }
            for pixel in [&single, &batched] {
                prop_assert_eq!(pixel.statistics(), model.now.statistics);
                prop_assert_eq!(&pixel.pixel.histogram().counts().map(u32::from)[..], &model.now.counts[..]);
            }
            prop_assert_eq!(batched.pixel.histogram().peak(), single.pixel.histogram().peak());
        }
    }

    /// Frames of any length, which need not divide X: the look falls on the
    /// first frame boundary after X laser cycles or more.
    #[test]
    fn any_frames_follow_the_flow_chart(
        settings in settings(),
        frames in prop::collection::vec((prop::array::uniform16(0u8..4), 0u16..9, any::<bool>()), 0..200),
    ) {
        let config = settings.config::<16>();
        let mut pixel = Lone::<16>::new(77);
        let mut model = Model::new(16, settings);
        let mut cycles = 0;
        for (frame, length, acknowledge) in frames {
            pixel.pixel.count_frame(&config, &frame);
            for (code, &photons) in frame.iter().enumerate() {
                for _ in 0..photons {
                    model.now.count(code);
                }
            }
            cycles += u64::from(length);
            let look = pixel.end(&config, cycles, length);
            prop_assert_eq!(look, model.end(cycles, length.into()));
            if acknowledge {
                prop_assert_eq!(pixel.pixel.take_event(), model.waiting.take());
            }
            prop_assert_eq!(pixel.statistics(), model.now.statistics);
        }
    }
}

#[test]
fn frames_of_five_laser_cycles_are_their_photons_one_cycle_at_a_time() {
    let mut rng = Pcg32::seed_from_u64(3);
    let mut events = 0;
    for _ in 0..200 {
        let settings = Settings {
            l2: 600,
            first: 1,
            last: 14,
            alpha: (rng.next_u32() % 1500) as u16,
            ..PAPER
        };
        let config = settings.config::<16>();
        let mut single = Lone::<16>::new(5);
        let mut framed = Lone::<16>::new(5);
        let mut frame = [0u16; 16];
        let cycles = random_cycles(16, 2000, 10, &mut rng);
        for (number, cycle) in (0..).zip(&cycles) {
            // A frame has no place for codes past the last bin.
            for &(code, times) in cycle.photons.iter().filter(|&&(code, _)| code < 16) {
                frame[usize::from(code)] += times;
                single.pixel.count_batch(&config, &vec![code; times.into()]);
            }
            let look = single.end(&config, number, 1);
            if number % 5 == 4 {
                framed.pixel.count_frame(&config, &frame);
                frame = [0; 16];
                let framed_look = framed.end(&config, number, 5);
                assert_eq!(framed_look, look);
                assert_eq!(framed.statistics(), single.statistics());
                if cycle.acknowledge {
                    let event = single.pixel.take_event();
                    assert_eq!(framed.pixel.take_event(), event);
                    events += u32::from(event.is_some());
                }
            } else {
                assert_eq!(look, Look::NotDue);
            }
        }
    }
    assert!(events > 1000);
}

#[test]
fn the_first_decision_is_the_first_look_above_l1_and_the_last_below_l2() {
    // Never a peak: looks at 4, 8, 12, ..., of which 12 and 16 decide.
    let config = PixelConfig::<8>::paper().x(4).l1(8).l2(20);
    let config = config.build().unwrap();
    let mut pixel = Lone::<8>::new(0);
    for round in 0..3 {
        for n in 1..=20 {
            let expected = match n {
                4 | 8 => Look::TooEarly, // 8 is not above L1
                12 | 16 => Look::NoPeak,
                20 => Look::Expired, // 20 is not below L2
                _ => Look::NotDue,
            };
            assert_eq!(pixel.end(&config, 0, 1), expected);
            assert_eq!(pixel.pixel.exposure(), n % 20);
        }
        assert_eq!(pixel.statistics().expired, round + 1);
    }
}

#[test]
fn an_exposure_longer_than_its_counter_expires() {
    let config = PixelConfig::<8>::paper().x(1).l1(65_000).l2(65_535);
    let config = config.build().unwrap();
    let mut pixel = Lone::<8>::new(0);
    pixel.pixel.count(&config, 3);
    assert_eq!(pixel.end(&config, 0, 40_000), Look::TooEarly);
    assert_eq!(pixel.end(&config, 0, 40_000), Look::Expired);
    let pixel = pixel.pixel;
    assert_eq!((pixel.exposure(), pixel.histogram().total()), (0, 0));
}
