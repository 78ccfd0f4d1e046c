//! The decision against a float model, written from the formulas of the documentation. `core/src/tests/proofs.rs` has
//! all small histograms.

use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::neighbours::NeighbourConfig;
use dtof_core::{
    Array, AsyncPixel, CentredWindow, Count, Count10, Count16, CounterWidth, DepthEstimator,
    EchoNumber, LaserCycle, Neighbours, PixelAddress, PixelConfig, RangeGate, Statistics,
    WindowRule,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::formulas::{GUARD, Known, compare};

const BINS: usize = 32;
const SIDE: usize = 4;

/// An array whose pixels have photons of one exposure, some after an echo, and the peaks of their echoes.
fn exposed<W: CounterWidth>(
    config: &PixelConfig<BINS, WindowRule>,
    trial: u32,
) -> (Vec<AsyncPixel<BINS, W>>, Vec<Vec<u16>>) {
    let mut rng = Pcg64Mcg::seed_from_u64(trial.into());
    // From almost no photons to a hundred a bin, of exposures of different lengths, with a target somewhere.
    let light = 1 << (trial % 8);
    let target_bin = (trial / 8 % 30) as u16;
    let pixel = |address| {
        let mut pixel = AsyncPixel::<BINS, W>::new(PixelAddress::new(address));
        let mut statistics = Statistics::default();
        let mut echoes = Vec::new();
        if config.echoes() > EchoNumber::FIRST && rng.next_u32().is_multiple_of(2) {
            let bin = 4 + (rng.next_u32() % 3 + 8 * (rng.next_u32() % 3)) as u16;
            pixel.count_batch(config, &[bin; 40]);
            pixel.end_laser_cycles(config, &mut statistics, LaserCycle::new(43), 44);
            echoes.extend(pixel.take_event().map(|event| event.peak_bin.raw()));
        }
        let photons = rng.next_u32() % (8 * light);
        let target = rng.next_u32() % 5;
        for _ in 0..photons {
            let code = rng.next_u32();
            let at = (code >> 8) as u16;
            let is_target = code % 16 < target;
            pixel.count(
                config,
                if is_target {
                    target_bin + at % 3
                } else {
                    at % 32
                },
            );
        }
        let cycles = [44, 60, 100, 400][rng.next_u32() as usize % 4];
        pixel.begin_look(config, &mut statistics, cycles);
        (pixel, echoes)
    };
    (0..16).map(pixel).unzip()
}

#[test]
fn random_arrays_decide_as_the_formulas_say() {
    let (mut alone, mut confirmed, mut refused, mut close) = (0, 0, 0, 0);
    let (mut further, mut brighter) = (0, 0);
    for trial in 0..6000u32 {
        let width = 1 + trial as usize % 7;
        let z = U4F12::from_num(3.0 + f64::from(trial % 11) / 4.0);
        let rule = WindowRule::new(width as u8, z, Count::saturating(trial % 6)).unwrap();
        let number = [Neighbours::Four, Neighbours::Eight][trial as usize / 5 % 2];
        let array = Array::new(SIDE as u32, SIDE as u32).unwrap();
        let rule = NeighbourConfig::new(array, number, &rule);
        let estimator = match trial / 7 % 4 {
            0 => DepthEstimator::Centroid3,
            half => {
                let half = U8F8::from_num(1.0 + f64::from(half));
                DepthEstimator::CentredWindow(CentredWindow::new(half).unwrap())
            }
        };
        let gate = RangeGate::new(trial as u16 / 3 % 6, 31 - trial as u16 / 2 % 6).unwrap();
        let echoes = EchoNumber::new(1 + (trial / 4 % 2) as u8).unwrap();
        let config = PixelConfig::<BINS, _>::with_rule(*rule.rule().own())
            .gate(gate)
            .estimator(estimator)
            .echoes(echoes, GUARD as u8)
            .build()
            .unwrap();
        let (pixels, peaks) = exposed::<Count10>(&config, trial);
        let (wider, _) = exposed::<Count16>(&config, trial);
        let known = |number: usize| Known::<BINS> {
            counts: pixels[number].histogram().counts().map(u32::from),
            echoes: peaks[number].clone(),
            cycles: pixels[number].exposure(),
        };
        for asking in 0..16 {
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
            let detection = rule.decide(&pixels, asking, &config);
            assert_eq!(detection, rule.decide(&wider, asking, &config));
            let own = known(asking);
            let others: Vec<_> = around.map(known).collect();
            let found = compare(detection, &own, &others, &config, &rule);
            alone += u32::from(found.is_alone);
            confirmed += u32::from(found.is_confirmed);
            refused += u32::from(detection.is_none());
            further += u32::from(found.is_confirmed && !own.echoes.is_empty());
            close += u32::from(found.is_close);
            brighter += found.brighter;
        }
    }
    println!(
        "{alone} alone, {confirmed} confirmed, {further} after an echo, {refused} not, {close} too close"
    );
    assert!(alone > 1000 && confirmed > 1000 && further > 300 && refused > 1000);
    assert!(brighter > 300 && close * 10 < confirmed + refused);
}
