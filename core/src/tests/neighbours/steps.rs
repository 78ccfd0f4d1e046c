//! What a look of an array does: edges, pixels that are left out, order, losses.

use crate::tests::neighbours::end_laser_cycles_of_array;
use dtof_core::fixed::types::U4F12;
use dtof_core::neighbours::{ArrayPixel, NeighbourConfig};
use dtof_core::{
    Array, AsyncPixel, Count, Count8, Count10, Count16, CounterWidth, DepthEvent, EchoNumber,
    Flags, LaserCycle, Look, Neighbours, PixelAddress, PixelConfig, RangeGate, Statistics,
    WindowRule,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

type Config = PixelConfig<64, WindowRule>;

fn rule() -> WindowRule {
    WindowRule::new(3, U4F12::lit("4.2"), Count::saturating(4)).unwrap()
}

fn neighbours(columns: u32, rows: u32, number: Neighbours) -> NeighbourConfig {
    NeighbourConfig::new(Array::new(columns, rows).unwrap(), number, &rule())
}

fn config(neighbours: &NeighbourConfig) -> Config {
    PixelConfig::with_rule(*neighbours.rule().own())
        .l1(8)
        .l2(400)
        .build()
        .unwrap()
}

fn pixels(number: u16) -> Vec<AsyncPixel<64>> {
    (0..number)
        .map(|pixel| AsyncPixel::new(PixelAddress::new(pixel)))
        .collect()
}

/// Ends 12 laser cycles, and returns the events.
fn end(
    pixels: &mut [impl ArrayPixel<64, Count10>],
    config: &Config,
    neighbours: &NeighbourConfig,
    statistics: &mut Statistics,
) -> Vec<DepthEvent> {
    let last = LaserCycle::new(99);
    let fired = end_laser_cycles_of_array(pixels, config, neighbours, statistics, last, 12);
    let pixels = pixels.iter_mut().filter_map(ArrayPixel::pixel_mut);
    let events: Vec<_> = pixels.filter_map(AsyncPixel::take_event).collect();
    assert_eq!(fired, !events.is_empty());
    events
}

/// A pixel with three photons in bin 30, and background in others.
fn dim(pixel: &mut AsyncPixel<64>, config: &Config) {
    pixel.count_batch(config, &[30, 30, 30, 5, 50]);
}

/// Those of the neighbours that exist are asked, and no others.
#[test]
fn pixels_ask_the_neighbours_that_exist() {
    for number in [Neighbours::Four, Neighbours::Eight] {
        let rule = neighbours(5, 4, number);
        let config = config(&rule);
        for asking in 0..20u16 {
            let (row, column) = (asking / 5, asking % 5);
            for other in 0..20u16 {
                let apart = [(other / 5).abs_diff(row), (other % 5).abs_diff(column)];
                let is_neighbour = match number {
                    Neighbours::Four => apart[0] + apart[1] == 1,
                    Neighbours::Eight => apart[0].max(apart[1]) == 1,
                };
                let mut pixels = pixels(20);
                dim(&mut pixels[usize::from(asking)], &config);
                if other != asking {
                    // Too few photons to ask, but enough to confirm.
                    pixels[usize::from(other)]
                        .count_batch(&config, &[30, 31, 30, 29, 30, 2, 60, 40, 13, 33, 44, 55]);
                }
                let mut statistics = Statistics::default();
                let events = end(&mut pixels, &config, &rule, &mut statistics);
                let mine = events.iter().find(|event| event.pixel.raw() == asking);
                assert_eq!(mine.is_some(), is_neighbour, "{number:?} {asking} {other}");
            }
        }
    }
}

#[test]
fn an_event_that_neighbours_confirm_is_the_pixels_own() {
    let rule = neighbours(3, 3, Neighbours::Eight);
    let config = config(&rule);
    let mut pixels = pixels(9);
    for pixel in &mut pixels {
        dim(pixel, &config);
    }
    let mut statistics = Statistics::default();
    let events = end(&mut pixels, &config, &rule, &mut statistics);
    assert_eq!(events.len(), 9);
    for (event, pixel) in events.iter().zip(0..) {
        assert_eq!(event.pixel.raw(), pixel);
        assert_eq!((event.exposure, event.cycle.raw()), (12, 99));
        assert_eq!((event.peak_bin.raw(), event.offset.raw()), (30, 128));
        // Three of five photons, so 2 in the 61 bins outside.
        assert_eq!((event.peak_count.raw(), event.background.raw()), (3, 0));
        assert_eq!(event.flags, Flags::CONFIRMED);
    }
    // Each pixel has started over.
    assert!(pixels.iter().all(|pixel| pixel.histogram().total() == 0));
    assert_eq!((statistics.events, statistics.photons()), (9, 45));
    // One pixel alone is not enough.
    let rule = neighbours(1, 1, Neighbours::Eight);
    let mut pixels = self::pixels(1);
    dim(&mut pixels[0], &config);
    assert_eq!(end(&mut pixels, &config, &rule, &mut statistics), []);
}

/// The depth is that of all photons.
#[test]
fn the_depth_is_that_of_all_photons() {
    let rule = neighbours(3, 1, Neighbours::Four);
    let config = config(&rule);
    let mut pixels = pixels(3);
    pixels[1].count_batch(&config, &[30, 30, 31, 5, 50]);
    pixels[0].count_batch(&config, &[31, 31, 30, 7, 40]);
    pixels[2].count_batch(&config, &[31, 31, 32, 9, 60]);
    let events = end(&mut pixels, &config, &rule, &mut Statistics::default());
    let event = events.iter().find(|event| event.pixel.raw() == 1).unwrap();
    // Bins 30, 31 and 32 have 3, 5 and 1 photons.
    assert_eq!((event.peak_bin.raw(), event.peak_count.raw()), (31, 3));
    let middle = event.position().raw();
    assert!((31 * 256..31 * 256 + 128).contains(&middle), "{middle}");
}

struct LeftOut(Option<AsyncPixel<64>>);

impl ArrayPixel<64, Count10> for LeftOut {
    fn pixel(&self) -> Option<&AsyncPixel<64>> {
        self.0.as_ref()
    }

    fn pixel_mut(&mut self) -> Option<&mut AsyncPixel<64>> {
        self.0.as_mut()
    }
}

#[test]
fn a_place_without_a_pixel_confirms_nothing() {
    let rule = neighbours(3, 1, Neighbours::Eight);
    let config = config(&rule);
    for left_out in [None, Some(0)] {
        let mut pixels: Vec<_> = pixels(3)
            .into_iter()
            .map(|pixel| LeftOut(Some(pixel)))
            .collect();
        for pixel in pixels.iter_mut().filter_map(ArrayPixel::pixel_mut) {
            dim(pixel, &config);
            if pixel.address().raw() != 1 {
                // One of these is not enough for another pixel.
                pixel.count_batch(&config, &[2, 7, 11, 16, 20, 38, 43, 57, 61]);
            }
        }
        if let Some(number) = left_out {
            pixels[number] = LeftOut(None);
        }
        let events = end(&mut pixels, &config, &rule, &mut Statistics::default());
        let confirmed: Vec<u16> = events.iter().map(|event| event.pixel.raw()).collect();
        assert_eq!(confirmed, if left_out.is_some() { vec![] } else { vec![1] });
    }
}

/// With a dead time that the rule weighs, each pixel decides alone, as it does without an array.
#[test]
fn a_dead_time_is_decided_alone() {
    let rule = neighbours(3, 3, Neighbours::Eight);
    let plain = config(&rule);
    let config = plain.with_dead_time(5);
    let mut pixels = pixels(9);
    for pixel in &mut pixels {
        dim(pixel, &config);
    }
    assert_eq!(
        end(&mut pixels, &config, &rule, &mut Statistics::default()),
        []
    );
    pixels[4].count_batch(&config, &[30; 6]);
    let mut alone = pixels[4].clone();
    let mut statistics = Statistics::default();
    let look = alone.end_laser_cycles(&config, &mut statistics, LaserCycle::new(99), 12);
    assert_eq!(look, Look::Event);
    let events = end(&mut pixels, &config, &rule, &mut Statistics::default());
    assert_eq!(events, [alone.take_event().unwrap()]);
}

/// Random photons: whatever order the pixels of a step come in, the events, pixels and counts are the same; every photon
/// is counted; nothing is decided twice.
#[test]
fn order_does_not_matter_and_nothing_is_lost() {
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    let (mut confirmed, mut deferred) = (0, 0);
    for trial in 0..30 {
        let number = [Neighbours::Four, Neighbours::Eight][trial % 2];
        let rule = neighbours(6, 5, number);
        let gate = RangeGate::new(trial as u16 % 7, 63 - trial as u16 % 5).unwrap();
        let echoes = EchoNumber::new(1 + trial as u8 % 3).unwrap();
        let config = PixelConfig::with_rule(*rule.rule().own())
            .l1(8)
            .l2(120)
            .gate(gate)
            .echoes(echoes, 3)
            .tracking((trial % 4 == 3).then(|| rule.rule().own().tracking(&gate)))
            .build()
            .unwrap();
        let (mut together, mut apart) = (pixels(30), pixels(30));
        let (mut counts, mut others) = (Statistics::default(), Statistics::default());
        let mut sent = 0;
        for cycle in 0..600u64 {
            for number in 0..30 {
                let codes: Vec<u16> = (0..rng.next_u32() % 3)
                    .map(|_| {
                        let code = rng.next_u32();
                        if code.is_multiple_of(9) {
                            40 + (code >> 8) as u16 % 2
                        } else {
                            (code >> 8) as u16 % 66
                        }
                    })
                    .collect();
                sent += codes.len() as u64;
                together[number].count_batch(&config, &codes);
                apart[number].count_batch(&config, &codes);
            }
            let last = LaserCycle::new(cycle);
            end_laser_cycles_of_array(&mut together, &config, &rule, &mut counts, last, 1);
            for pixel in apart.iter_mut().rev() {
                pixel.begin_look(&config, &mut others, 1);
            }
            let decide = |number: usize| rule.decide(&apart, number, &config);
            let mut detections: Vec<_> = (0..30)
                .rev()
                .map(|number| (number, decide(number)))
                .collect();
            detections.rotate_left(11);
            for (number, detection) in detections {
                if let Some(detection) = detection {
                    apart[number].keep_detection(last, &detection);
                }
                apart[number].end_look(&config, &mut others, last, |_| ());
            }
            // Some links are slow.
            for number in 0..30 {
                if !(number + cycle as usize / 40).is_multiple_of(3) {
                    let event = together[number].take_event();
                    assert_eq!(event, apart[number].take_event());
                    confirmed += u32::from(
                        event.is_some_and(|event| event.flags.contains(Flags::CONFIRMED)),
                    );
                }
            }
            assert_eq!(counts, others);
        }
        deferred += counts.deferred;
        for pixel in &together {
            pixel.add_photons_to(&mut counts);
        }
        assert_eq!(counts.photons(), sent);
    }
    assert!(confirmed > 500 && deferred > 500, "{confirmed} {deferred}");
}

/// A detection that is kept at the wrong time is no event, and none is lost by it.
#[test]
fn a_detection_is_kept_only_while_a_look_decides() {
    let rule = neighbours(1, 1, Neighbours::Four);
    let config = config(&rule);
    let mut statistics = Statistics::default();
    let mut pixel = AsyncPixel::<64>::new(PixelAddress::new(3));
    pixel.count_batch(&config, &[20; 9]);
    let detection = config.detect(pixel.histogram()).unwrap();
    let (now, late) = (LaserCycle::new(5), LaserCycle::new(6));
    let decides = |pixel: &AsyncPixel<64>| {
        let found = pixel.decide(&config, rule.rule(), std::iter::empty());
        found.is_some()
    };
    assert!(!decides(&pixel));
    pixel.keep_detection(now, &detection);
    assert_eq!(
        pixel.end_look(&config, &mut statistics, now, |_| ()),
        Look::TooEarly
    );
    assert!(!pixel.begin_look(&config, &mut statistics, 3));
    assert_eq!(
        pixel.end_look(&config, &mut statistics, now, |_| ()),
        Look::NotDue
    );
    assert!(pixel.begin_look(&config, &mut statistics, 9));
    assert!(decides(&pixel));
    pixel.keep_detection(now, &detection);
    assert_eq!(
        pixel.end_look(&config, &mut statistics, now, |_| ()),
        Look::Event
    );
    // It waits. The next one does not take its place.
    pixel.count_batch(&config, &[40; 9]);
    assert!(pixel.begin_look(&config, &mut statistics, 12));
    assert!(!decides(&pixel));
    let next = config.detect(pixel.histogram()).unwrap();
    pixel.keep_detection(late, &next);
    assert_eq!(
        pixel.end_look(&config, &mut statistics, late, |_| ()),
        Look::Deferred
    );
    let event = pixel.take_event().unwrap();
    assert_eq!((event.cycle, event.peak_bin.raw()), (now, 20));
}

/// Every address outside the array has none.
#[test]
fn a_pixel_outside_the_array_has_no_neighbours() {
    for (columns, rows) in [(1, 1), (5, 4), (1, 7), (300, 2), (65_536, 1), (256, 256)] {
        let array = Array::new(columns, rows).unwrap();
        for pixel in 0..=u16::MAX {
            let neighbours = array.neighbours(PixelAddress::new(pixel), Neighbours::Eight);
            let is_inside = u32::from(pixel) < array.pixels();
            assert_eq!(neighbours.count() > 0, is_inside && array.pixels() > 1);
        }
    }
}

/// A pixel without neighbours decides as it does without an array: events, ends and counts.
#[test]
fn a_pixel_without_neighbours_is_one_without_an_array() {
    let mut rng = Pcg64Mcg::seed_from_u64(17);
    let mut counts = [Statistics::default(); 2];
    for trial in 0..40u8 {
        let rule = neighbours(1, 1, Neighbours::Eight);
        let gate = RangeGate::new(2, 60).unwrap();
        let config = PixelConfig::with_rule(*rule.rule().own())
            .x(1 + u16::from(trial) % 5)
            .l1(8)
            .l2(60 + u16::from(trial))
            .gate(gate)
            .echoes(EchoNumber::new(1 + trial % 3).unwrap(), 3)
            .tracking((trial % 4 == 3).then(|| rule.rule().own().tracking(&gate)))
            .build()
            .unwrap();
        let has_dead_time = trial % 7 == 6;
        let config = if has_dead_time {
            config.with_dead_time(5)
        } else {
            config
        };
        let (mut array, mut alone) = (pixels(1), pixels(1).remove(0));
        let (mut statistics, mut others) = (Statistics::default(), Statistics::default());
        for look in 0..2000u64 {
            let mut codes: Vec<u16> = (0..rng.next_u32() % 4)
                .map(|_| match rng.next_u32() {
                    code if code % 12 == 0 => 40 + (code >> 8) as u16 % 2,
                    code => (code >> 8) as u16 % 66,
                })
                .collect();
            // Now and then 20 photons come at once, which a dead time does not allow.
            if !has_dead_time && rng.next_u32().is_multiple_of(64) {
                codes.extend([30; 20]);
            }
            array[0].count_batch(&config, &codes);
            alone.count_batch(&config, &codes);
            let (last, cycles) = (LaserCycle::new(look), 1 + trial as u16 % 2);
            end_laser_cycles_of_array(&mut array, &config, &rule, &mut statistics, last, cycles);
            alone.end_laser_cycles(&config, &mut others, last, cycles);
            if look % 64 < 48 {
                assert_eq!(array[0].take_event(), alone.take_event());
            }
            assert_eq!(statistics, others);
        }
        counts[usize::from(has_dead_time)] += statistics;
    }
    for (counts, least) in counts.iter().zip([100, 30]) {
        let seen = [counts.events, counts.expired, counts.deferred];
        assert!(seen.iter().all(|&seen| seen > least), "{counts:?}");
    }
}

/// Whether eight neighbours with so many photons in so many laser cycles confirm a pixel with `own` photons in 44, which are
/// one too few.
fn confirms<W: CounterWidth>(own: u16, [photons, cycles]: [u16; 2]) -> bool {
    let minimum = Count::saturating(u32::from(own) + 1);
    let rule = WindowRule::new(3, U4F12::lit("4.2"), minimum).unwrap();
    let array = Array::new(3, 3).unwrap();
    let rule = NeighbourConfig::new(array, Neighbours::Eight, &rule);
    let config = PixelConfig::<1024, _>::with_rule(*rule.rule().own())
        .build()
        .unwrap();
    let mut pixels: Vec<AsyncPixel<1024, W>> = (0..9)
        .map(|pixel| AsyncPixel::new(PixelAddress::new(pixel)))
        .collect();
    for (pixel, number) in pixels.iter_mut().zip(0..) {
        let (photons, cycles) = if number == 4 {
            (own, 44)
        } else {
            (photons, cycles)
        };
        (0..photons).for_each(|_| pixel.count(&config, 503));
        pixel.begin_look(&config, &mut Statistics::default(), cycles);
    }
    rule.decide(&pixels, 4, &config).is_some()
}

/// A neighbour twice as bright confirms, a brighter one does not. Of one photon the brightness is not known.
#[test]
fn neighbours_more_than_twice_as_bright_do_not_confirm() {
    for (neighbours, expected) in [
        ([24, 44], true),
        ([25, 44], false),
        ([24, 43], false),
        ([48, 88], true),
        ([49, 88], false),
    ] {
        assert_eq!(
            confirms::<Count10>(12, neighbours),
            expected,
            "{neighbours:?}"
        );
        assert_eq!(
            confirms::<Count16>(12, neighbours),
            expected,
            "{neighbours:?}"
        );
    }
    for (neighbours, expected) in [([1, 4], true), ([2, 4], false)] {
        assert_eq!(
            confirms::<Count8>(4, neighbours),
            expected,
            "{neighbours:?}"
        );
    }
    // The longest exposure of the fullest counter: 44 photons in 44 laser cycles are as bright.
    assert!(confirms::<Count16>(22, [u16::MAX, u16::MAX]));
    assert!(!confirms::<Count16>(21, [u16::MAX, u16::MAX]));
}

/// The fullest counters, of the most bins and the widest window, in all neighbours.
#[test]
fn full_counters_do_not_overflow() {
    let rule = WindowRule::new(7, U4F12::MAX, Count::saturating(5)).unwrap();
    let array = Array::new(3, 3).unwrap();
    let rule = NeighbourConfig::new(array, Neighbours::Eight, &rule);
    let config = PixelConfig::<1024, _>::with_rule(*rule.rule().own())
        .build()
        .unwrap();
    let decide = |bins: core::ops::Range<u16>| {
        let mut pixels: Vec<AsyncPixel<1024>> = (0..9)
            .map(|pixel| AsyncPixel::new(PixelAddress::new(pixel)))
            .collect();
        for (pixel, number) in pixels.iter_mut().zip(0..) {
            let codes: Vec<u16> = bins.clone().collect();
            let times = if number == 4 { 0 } else { 1023 };
            (0..times).for_each(|_| pixel.count_batch(&config, &codes));
        }
        pixels[4].count_batch(&config, &[503; 40]);
        // The neighbours have theirs from longer exposures, and so are no brighter.
        for (pixel, number) in pixels.iter_mut().zip(0..) {
            let cycles = if number == 4 { 44 } else { 10_000 };
            pixel.begin_look(&config, &mut Statistics::default(), cycles);
        }
        rule.decide(&pixels, 4, &config)
    };
    // A window, and all windows that hold the pixel's photons.
    for bins in [500..507, 497..510] {
        let detection = decide(bins).unwrap();
        let full = Flags::CONFIRMED | Flags::SATURATED;
        assert_eq!(
            (detection.peak.count.raw(), detection.depth.flags),
            (40, full)
        );
    }
    assert_eq!(decide(0..1024), None);
}

/// Of windows with as many photons, the first is taken: its highest bin is another one than that of the last.
#[test]
fn the_first_of_windows_that_are_equal_is_confirmed() {
    let rule = neighbours(3, 3, Neighbours::Eight);
    let config = config(&rule);
    let mut pixels = pixels(9);
    for (pixel, number) in pixels.iter_mut().zip(0..) {
        // All together: 6, 3, 4 and 6 photons in bins 30 to 33.
        let codes: &[u16] = match number {
            4 => &[30, 32, 33],
            0..4 | 8 => &[30, 33],
            _ => &[31, 32],
        };
        pixel.count_batch(&config, codes);
    }
    let events = end(&mut pixels, &config, &rule, &mut Statistics::default());
    let event = events.iter().find(|event| event.pixel.raw() == 4).unwrap();
    assert_eq!((event.peak_bin.raw(), event.peak_count.raw()), (30, 2));
}

/// A window that is full in all nine pixels has the photons of all nine: those of eight would not do.
#[test]
fn windows_that_are_full_count_for_all_pixels() {
    let rule = WindowRule::new(3, U4F12::MAX, Count::saturating(5)).unwrap();
    let rule = NeighbourConfig::new(Array::new(3, 3).unwrap(), Neighbours::Eight, &rule);
    let config = config(&rule);
    let mut pixels: Vec<AsyncPixel<64, Count8>> = (0..9)
        .map(|pixel| AsyncPixel::new(PixelAddress::new(pixel)))
        .collect();
    let codes: Vec<u16> = (0..64).collect();
    for pixel in &mut pixels {
        // 765 photons in the window, where 608 are expected: 6.5 standard deviations in each, 19.6 in all. Eight of them
        // have 9.0 where nine are expected.
        (0..200).for_each(|_| pixel.count_batch(&config, &codes));
        (0..55).for_each(|_| pixel.count_batch(&config, &[30, 31, 32]));
        assert!(pixel.begin_look(&config, &mut Statistics::default(), 300));
    }
    let detection = rule.decide(&pixels, 4, &config).unwrap();
    let full = Flags::CONFIRMED | Flags::SATURATED;
    assert!(detection.depth.flags.contains(full));
    assert_eq!(detection.peak.count.raw(), 765);
}
