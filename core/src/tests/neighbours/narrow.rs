//! Counters of 8 bits beside those of 10, in pixels that confirm each other.

use crate::tests::neighbours::end_laser_cycles_of_array;
use dtof_core::fixed::types::U4F12;
use dtof_core::neighbours::NeighbourConfig;
use dtof_core::{
    Array, AsyncPixel, Count, Count8, Count10, CounterWidth, EchoNumber, Flags, LaserCycle,
    Neighbours, PixelAddress, PixelConfig, Statistics, WindowRule,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

const PIXELS: u16 = 12;

fn pixels<W: CounterWidth>() -> Vec<AsyncPixel<32, W>> {
    (0..PIXELS)
        .map(|pixel| AsyncPixel::new(PixelAddress::new(pixel)))
        .collect()
}

#[test]
fn arrays_of_eight_bits_decide_as_those_of_ten_until_a_counter_overflows() {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let (mut events, mut confirmed, mut lost) = (0, 0, 0);
    for trial in 0..300u32 {
        let rule = WindowRule::new(3, U4F12::lit("4"), Count::saturating(4)).unwrap();
        let number = [Neighbours::Four, Neighbours::Eight][trial as usize % 2];
        let neighbours = NeighbourConfig::new(Array::new(4, 3).unwrap(), number, &rule);
        let config = PixelConfig::with_rule(*neighbours.rule().own())
            .l1(8)
            .l2(200 + trial as u16)
            .echoes(EchoNumber::new(1 + trial as u8 % 3).unwrap(), 3)
            .build()
            .unwrap();
        let (mut narrow, mut wide) = (pixels::<Count8>(), pixels::<Count10>());
        let [mut of_narrow, mut of_wide] = [Statistics::new(); 2];
        let light = 1 + rng.next_u32() % (1 << (trial % 7));
        'run: for cycle in 0..400 {
            for (narrow, wide) in narrow.iter_mut().zip(&mut wide) {
                for _ in 0..rng.next_u32() % (2 * light) {
                    let is_target = rng.next_u32().is_multiple_of(16);
                    let among = if is_target { 2 } else { 32 };
                    let code = (12 + rng.next_u32() % among) as u16 % 32;
                    narrow.count(&config, code);
                    wide.count(&config, code);
                }
            }
            if narrow.iter().any(|pixel| pixel.histogram().saturated() > 0) {
                lost += 1;
                break 'run;
            }
            let last = LaserCycle::new(cycle);
            end_laser_cycles_of_array(&mut narrow, &config, &neighbours, &mut of_narrow, last, 1);
            end_laser_cycles_of_array(&mut wide, &config, &neighbours, &mut of_wide, last, 1);
            assert_eq!(of_narrow, of_wide);
            if rng.next_u32().is_multiple_of(4) {
                for (narrow, wide) in narrow.iter_mut().zip(&mut wide) {
                    let event = narrow.take_event();
                    assert_eq!(event, wide.take_event());
                    let flags = event.map_or(Flags::NONE, |event| event.flags);
                    events += u32::from(event.is_some());
                    confirmed += u32::from(flags.contains(Flags::CONFIRMED));
                }
            }
        }
    }
    println!("{events} events, {confirmed} confirmed; {lost} runs until a counter overflowed");
    assert!(events > 3000 && confirmed > 300 && lost > 20);
}

/// The pixel in the middle is promising. Of its neighbours one that has lost photons confirms nothing, and begins
/// anew.
#[test]
fn a_pixel_that_has_lost_photons_confirms_nothing() {
    let rule = WindowRule::new(3, U4F12::lit("4.2"), Count::saturating(5)).unwrap();
    let array = Array::new(3, 1).unwrap();
    let neighbours = NeighbourConfig::new(array, Neighbours::Four, &rule);
    let config = PixelConfig::<32, _>::with_rule(*neighbours.rule().own())
        .l1(8)
        .build()
        .unwrap();
    for (photons, is_confirmed) in [(255, true), (256, false)] {
        let mut pixels: Vec<_> = pixels::<Count8>().into_iter().take(3).collect();
        pixels[1].count_batch(&config, &[12, 12, 13, 13, 5, 29]);
        let mut bright = vec![12; photons];
        bright.extend([2; 200]);
        pixels[2].count_batch(&config, &bright);
        let mut statistics = Statistics::new();
        // It has them from a longer exposure, and so is no brighter.
        pixels[2].begin_look(&config, &mut statistics, 600);
        let last = LaserCycle::new(11);
        end_laser_cycles_of_array(&mut pixels, &config, &neighbours, &mut statistics, last, 12);
        let events: Vec<_> = pixels.iter().map(AsyncPixel::has_event).collect();
        assert_eq!(events, [false, is_confirmed, is_confirmed]);
        assert_eq!(statistics.ended_full, u64::from(!is_confirmed));
        assert_eq!(pixels[2].exposure(), 0);
    }
}
