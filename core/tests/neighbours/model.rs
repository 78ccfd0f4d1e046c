//! The decision against a float model, written from the formulas of the documentation.

use dtof_core::fixed::types::U4F12;
use dtof_core::neighbours::NeighbourConfig;
use dtof_core::{
    Array, AsyncPixel, Count, Flags, Neighbours, PixelAddress, PixelConfig, Statistics, WindowRule,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

const BINS: usize = 32;
const SIDE: usize = 4;

type Counts = [u32; BINS];

/// Whether `inside` of `total` photons are a detection of the window rule.
fn fires(inside: f64, total: u32, width: usize, z: f64) -> bool {
    let share = width as f64 / BINS as f64;
    let mean = f64::from(total) * share;
    let variance = mean * (1.0 - share);
    let skew = (z * z / 6.0 * (1.0 - 2.0 * share)).max(0.0);
    inside > mean + z * variance / (variance + z * z / 36.0).sqrt().max(1e-9) + skew
}

/// The same, or `None` if it is so close that the rounding of integers decides.
fn surely(inside: u32, total: u32, width: usize, z: f64) -> Option<bool> {
    let inside = f64::from(inside);
    let [low, high] = [-1.0, 1.0].map(|side| {
        // z²/6 is rounded down to 1/16.
        fires(inside + side / 16.0, total, width, z * (1.0 - side * 0.002))
    });
    (low == high).then_some(low)
}

fn sum(counts: &Counts, start: usize, width: usize) -> u32 {
    counts[start..start + width].iter().sum()
}

/// Whether the neighbours confirm; `None` if it is too close.
fn confirms(
    own: &Counts,
    others: &[&Counts],
    width: usize,
    rule: &NeighbourConfig,
) -> Option<bool> {
    let total = |counts: &Counts| counts.iter().sum::<u32>();
    let (peak, highest) = own
        .iter()
        .enumerate()
        .rev()
        .max_by_key(|&(_, count)| count)?;
    let starts: Vec<usize> = (0..=BINS - width)
        .filter(|&start| *highest <= 3 || (start..start + width).contains(&peak))
        .collect();
    let most = starts.iter().map(|&start| sum(own, start, width)).max()?;
    if most < 2 || !surely(most, total(own), width, 2.0)? {
        return Some(false);
    }
    let first = *starts
        .iter()
        .find(|&&start| sum(own, start, width) == most)?;
    let run = (first..(first + width).min(BINS + 1 - width))
        .take_while(|&start| sum(own, start, width) == most);
    let inside = run
        .map(|start| {
            most + others
                .iter()
                .map(|other| sum(other, start, width))
                .sum::<u32>()
        })
        .max()?;
    let all = total(own) + others.iter().map(|other| total(other)).sum::<u32>();
    let z = rule.rule().z(total(own), all).to_num();
    Some(inside >= rule.rule().own().minimum_count().raw() && surely(inside, all, width, z)?)
}

#[test]
fn random_arrays_decide_as_the_formulas_say() {
    let mut rng = Pcg64Mcg::seed_from_u64(11);
    let (mut confirmed, mut refused, mut close) = (0, 0, 0);
    for trial in 0..3000u32 {
        let width = 1 + trial as usize % 5;
        let z = U4F12::from_num(3.0 + f64::from(trial % 7) / 4.0);
        let rule = WindowRule::new(width as u8, z, Count::saturating(trial % 6)).unwrap();
        let number = [Neighbours::Four, Neighbours::Eight][trial as usize / 5 % 2];
        let array = Array::new(SIDE as u32, SIDE as u32).unwrap();
        let rule = NeighbourConfig::new(array, number, &rule);
        let config = PixelConfig::<BINS, _>::with_rule(*rule.rule().own())
            .build()
            .unwrap();
        // From almost no photons to a hundred a bin, of exposures of different lengths, with a target.
        let light = 1 << (trial % 8);
        let mut pixels: Vec<AsyncPixel<BINS>> = (0..16)
            .map(|pixel| AsyncPixel::new(PixelAddress::new(pixel)))
            .collect();
        for pixel in &mut pixels {
            let photons = rng.next_u32() % (8 * light);
            let target = rng.next_u32() % 5;
            for _ in 0..photons {
                let code = rng.next_u32();
                let is_target = code % 16 < target;
                pixel.count(
                    &config,
                    if is_target {
                        12 + (code >> 8) as u16 % 3
                    } else {
                        (code >> 8) as u16 % 32
                    },
                );
            }
            assert!(pixel.begin_look(&config, &mut Statistics::default(), 44));
        }
        for asking in 0..16 {
            let counts = |number: usize| pixels[number].histogram().counts().map(u32::from);
            let around = (0..16usize).filter(|&other| {
                let apart = [
                    (other / SIDE).abs_diff(asking / SIDE),
                    (other % SIDE).abs_diff(asking % SIDE),
                ];
                match number {
                    Neighbours::Four => apart[0] + apart[1] == 1,
                    Neighbours::Eight => apart[0].max(apart[1]) == 1,
                }
            });
            let others: Vec<Counts> = around.map(counts).collect();
            let others: Vec<&Counts> = others.iter().collect();
            let detection = rule.decide(&pixels, asking, &config);
            let alone = config.detect(pixels[asking].histogram());
            if alone.is_some() {
                assert_eq!(detection, alone);
                continue;
            }
            let is_confirmed = detection.is_some();
            match confirms(&counts(asking), &others, width, &rule) {
                Some(expected) => assert_eq!(is_confirmed, expected, "trial {trial} {asking}"),
                None => close += 1,
            }
            if let Some(detection) = detection {
                assert!(detection.depth.flags.contains(Flags::CONFIRMED));
                assert!(detection.peak.count.raw() >= 2);
            }
            confirmed += u32::from(is_confirmed);
            refused += u32::from(!is_confirmed);
        }
    }
    println!("{confirmed} confirmed, {refused} not, {close} too close");
    assert!(confirmed > 1000 && refused > 1000 && close * 10 < confirmed + refused);
}
