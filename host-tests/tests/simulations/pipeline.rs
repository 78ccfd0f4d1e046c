//! Compares the integer pipeline with the float reference, laser cycle by laser cycle, on the same
//! photons.
//!
//! Both must agree on every decision: its time, peak, background and result. With the quadrants one
//! difference is allowed: the integer square root is rounded down, which lowers the threshold by less
//! than α, so a peak between the two thresholds causes an event in integers only. The test verifies
//! each such case from the counts. With the average there is no root and no difference.

use dtof_core::fixed::types::U8F8;
use dtof_core::{
    AnyRule, AsyncPixel, AverageRule, Count, LaserCycle, Look, PaperRule, PixelAddress,
    PixelConfig, RangeGate, Statistics,
};
use dtof_data::random::pixel_rng;
use dtof_host_tests::reference::{self, Background};
use dtof_light::SimulatedPixel;
use dtof_light::rates::Rates;
use rand_core::Rng;

/// The counts of one run.
#[derive(Debug, Default)]
struct Tally {
    exposures: u32,
    events: u32,
    expired: u32,
    saturated: u32,
    decisions: u32,
    explained_by_floor: u32,
}

/// Random settings for one simulated pixel.
struct Draw {
    x: u16,
    l1: u16,
    l2: u16,
    alpha: U8F8,
    minimum_count: u16,
    first: u16,
    last: u16,
    rates: Rates,
}

/// A number from 0 to 1.
fn unit(rng: &mut impl Rng) -> f64 {
    f64::from(rng.next_u32()) / f64::from(u32::MAX)
}

fn one_of<T: Copy>(rng: &mut impl Rng, values: &[T]) -> T {
    values[rng.next_u32() as usize % values.len()]
}

fn draw<const BINS: usize>(rng: &mut impl Rng) -> Draw {
    let bins = u16::try_from(BINS).unwrap();
    // One in four has a gate, if there is room for one.
    let (first, last) = if BINS > 8 && rng.next_u32().is_multiple_of(4) {
        let first = one_of(rng, &[1, 17, 20, 63]);
        (first, one_of(rng, &[first + 7, first + 30, 100, bins - 1]))
    } else {
        (0, bins - 1)
    };
    let background = 10f64.powf(-2.0 + 2.0 * unit(rng)); // 0.01 to 1
    // Zero, or from a hundredth of the background of all bins to a rate that fills a counter in about
    // ten laser cycles.
    let signal = one_of(rng, &[0.0, 0.02, 0.1, 0.3, 1.0, 3.0, 30.0]);
    Draw {
        x: one_of(rng, &[1, 4, 10]),
        l1: one_of(rng, &[10, 20, 40, 100]),
        l2: one_of(rng, &[120, 203, 400, 2000]),
        alpha: U8F8::from_bits(one_of(rng, &[0x0100, 0x0280, 0x0333, 0x0400, 0x0800])),
        minimum_count: one_of(rng, &[1, 3, 5]),
        first,
        last,
        rates: Rates {
            background,
            signal: signal * one_of(rng, &[1.0, background]),
            position: f64::from(bins) * unit(rng),
            sigma: one_of(rng, &[0.4, 1.0, 1.5]),
        },
    }
}

/// Runs one pixel for `exposures` exposures.
fn run<const BINS: usize>(seed: u64, background: Background, exposures: u32, tally: &mut Tally) {
    let mut rng = pixel_rng(seed, PixelAddress::new(0));
    let draw = draw::<BINS>(&mut rng);
    let gate = RangeGate::new(draw.first, draw.last).unwrap();
    let minimum_count = Count::saturating(draw.minimum_count.into());
    let rule: AnyRule = match background {
        Background::Quadrants => PaperRule::new(draw.alpha, minimum_count).into(),
        Background::Average => AverageRule::new(draw.alpha, minimum_count).into(),
    };
    let config = PixelConfig::<BINS, _>::with_rule(rule)
        .x(draw.x)
        .l1(draw.l1)
        .l2(draw.l2)
        .gate(gate)
        .build()
        .unwrap();
    let alpha: f64 = draw.alpha.to_num();
    let reference_config = reference::Config {
        x: draw.x.into(),
        l1: draw.l1.into(),
        l2: draw.l2.into(),
        background,
        alpha,
        minimum_count: draw.minimum_count.into(),
        first: draw.first.into(),
        last: draw.last.into(),
    };
    let bins = u16::try_from(BINS).unwrap();
    let mut photons = SimulatedPixel::new(&draw.rates, bins, rng).unwrap();
    let mut pixel = AsyncPixel::<BINS>::new(PixelAddress::new(3));
    let mut statistics = Statistics::new();
    let mut twin = reference::Pixel::new(BINS, 1023.0, reference_config);
    // The laser cycle in which the reference pixel started.
    let mut twin_start = 0;
    let end = tally.exposures + exposures;

    for cycle in 0.. {
        if tally.exposures == end {
            return;
        }
        photons.next_cycle(|code| {
            pixel.count(&config, code);
            twin.photon(code.into());
        });
        let exposure = pixel.exposure() + 1;
        // An event clears the counts, so they are saved for the check.
        let histogram = pixel.histogram().clone();
        let look = pixel.end_laser_cycle(&config, &mut statistics, LaserCycle::new(cycle));
        let float = twin.end_laser_cycle();
        let event = pixel.take_event();

        match look {
            Look::NotDue | Look::TooEarly | Look::Expired => {
                assert_eq!(
                    (event, float),
                    (None, None),
                    "one decides, the other does not"
                );
                tally.expired += u32::from(look == Look::Expired);
                tally.exposures += u32::from(look == Look::Expired);
                continue;
            }
            Look::Deferred | Look::Ended => {
                unreachable!("every event is taken at once, and ends its exposure")
            }
            Look::Event | Look::NoPeak => tally.decisions += 1,
        }
        let float = float.expect("both decide in the same laser cycle");
        assert_eq!(twin_start + float.cycle, cycle);
        assert_eq!(float.exposure, u32::from(exposure));
        let peak = histogram.peak();
        // An empty histogram has no highest bin.
        if peak.count.raw() > 0 {
            assert_eq!(float.peak_bin, usize::from(peak.bin.raw()));
        }
        assert_eq!(float.peak_count, f64::from(peak.count.raw()));

        let Some(event) = event else {
            assert_eq!(look, Look::NoPeak);
            assert!(
                !float.fired,
                "only the float reference has an event, which rounding down cannot explain"
            );
            continue;
        };
        tally.events += 1;
        tally.exposures += 1;
        tally.saturated += u32::from(peak.count.raw() == 1023);
        assert_eq!(
            (event.cycle, event.exposure),
            (LaserCycle::new(cycle), exposure)
        );
        assert_eq!((event.peak_bin, event.peak_count), (peak.bin, peak.count));
        // The average is rounded, to 1/256 for the depth and to whole counts in the event.
        let (rounding, shift) = match background {
            Background::Quadrants => (0.0, 0.0),
            Background::Average => {
                let above = float.peak_count - float.background;
                (0.5 + 1.0 / 256.0, 3.0 / 256.0 / above)
            }
        };
        let reported = f64::from(event.background.raw());
        assert!((float.background - reported).abs() <= rounding);
        if float.fired {
            let twin_event = twin.event().expect("a look that fired left an event");
            let position = f64::from(event.position().raw()) / 256.0;
            assert!(
                (position - twin_event.position).abs() <= 1.0 / 512.0 + shift + 1e-9,
                "{position} bins, the reference has {}",
                twin_event.position
            );
        } else {
            assert_eq!(background, Background::Quadrants);
            let background = event.background.raw();
            let root = f64::from(reference::floor_square_root(background));
            let background = f64::from(background);
            assert!(
                float.peak_count > background + alpha * root,
                "above the lower threshold"
            );
            assert!(
                float.peak_count <= reference::threshold(background, alpha),
                "and not above the upper one, which differs only by rounding the root down"
            );
            tally.explained_by_floor += 1;
            // The integer pixel starts over, and so must the reference.
            twin = reference::Pixel::new(BINS, 1023.0, reference_config);
            twin_start = cycle + 1;
        }
    }
}

fn agree<const BINS: usize>(pixels: u64, background: Background) {
    let mut tally = Tally::default();
    for seed in 0..pixels {
        run::<BINS>(seed, background, 10, &mut tally);
    }
    println!("{BINS} bins: {tally:?}");
    assert!(tally.exposures >= 10_000);
    // Every branch of the comparison was taken.
    assert!(
        tally.events > 1000 && tally.expired > 100 && tally.saturated > 10,
        "{tally:?}"
    );
    let has_root = background == Background::Quadrants;
    assert_eq!(tally.explained_by_floor > 0, has_root, "{tally:?}");
}

#[test]
fn integer_pipeline_and_float_reference_agree_on_128_bins() {
    agree::<128>(1000, Background::Quadrants);
    agree::<128>(1000, Background::Average);
}

#[test]
fn integer_pipeline_and_float_reference_agree_on_8_bins() {
    agree::<8>(1000, Background::Quadrants);
    agree::<8>(1000, Background::Average);
}
