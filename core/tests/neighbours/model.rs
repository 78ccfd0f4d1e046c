//! The decision against a float model, written from the formulas of the documentation.

use dtof_core::fixed::types::{U4F12, U8F8, U24F8};
use dtof_core::neighbours::NeighbourConfig;
use dtof_core::{
    Array, AsyncPixel, CentredWindow, Count, Count10, Count16, CounterWidth, DepthEstimator,
    Detection, EchoNumber, Flags, Histogram, LaserCycle, Neighbours, Peak, PixelAddress,
    PixelConfig, RangeGate, Statistics, WindowRule,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

const BINS: usize = 32;
const SIDE: usize = 4;
const GUARD: u16 = 3;

/// What a pixel knows: its photons, and the peaks of its echoes.
#[derive(Clone)]
struct Known {
    counts: [u32; BINS],
    echoes: Vec<u16>,
    cycles: u16,
}

impl Known {
    /// Whether a bin up to `beside` from `bin` is left out.
    fn leaves_out(&self, bin: usize, beside: u16) -> bool {
        let reach = GUARD + beside;
        self.echoes
            .iter()
            .any(|&peak| peak.abs_diff(bin as u16) <= reach)
    }

    fn sum(&self, start: usize, width: usize) -> u32 {
        self.counts[start..start + width].iter().sum()
    }
}

/// Whether `inside` of `total` photons in `bins` bins are a detection of the window rule.
fn fires(inside: f64, total: u32, width: usize, bins: usize, z: f64) -> bool {
    let share = width as f64 / bins as f64;
    let mean = f64::from(total) * share;
    let variance = mean * (1.0 - share);
    let skew = (z * z / 6.0 * (1.0 - 2.0 * share)).max(0.0);
    inside > mean + z * variance / (variance + z * z / 36.0).sqrt().max(1e-9) + skew
}

/// The same, or `None` if it is so close that the rounding of integers decides.
fn surely(inside: u32, total: u32, width: usize, bins: usize, z: f64) -> Option<bool> {
    let inside = f64::from(inside);
    let [low, high] = [-1.0, 1.0].map(|side| {
        // z²/6 is rounded down to 1/16.
        fires(
            inside + side / 16.0,
            total,
            width,
            bins,
            z * (1.0 - side * 0.002),
        )
    });
    (low == high).then_some(low)
}

/// A confirmed window: where it begins, the photons of the pixel and of all there, and of all in how many bins.
struct Confirmed {
    start: usize,
    own: u32,
    all: u32,
    total: u32,
    bins: usize,
    asked: Vec<Known>,
    /// How many neighbours were left out because they are brighter.
    brighter: u32,
}

/// The window that the neighbours confirm; the outer `None` if it is too close.
fn confirms(
    own: &Known,
    others: &[Known],
    width: usize,
    gate: &RangeGate<BINS>,
    reach: u16,
    rule: &NeighbourConfig,
) -> Option<Option<Confirmed>> {
    let gated = usize::from(gate.first())..usize::from(gate.last()) + 1;
    let left = |pixels: &[&Known]| -> Vec<usize> {
        let is_left = |bin: &usize| pixels.iter().all(|pixel| !pixel.leaves_out(*bin, 0));
        gated.clone().filter(is_left).collect()
    };
    let own_left = left(&[own]);
    let own_total: u32 = own.counts.iter().sum();
    let highest = *own.counts.iter().max()?;
    let peak = own.counts.iter().position(|&count| count == highest)?;
    let gated_starts: Vec<usize> = (gated.start..=gated.end - width).collect();
    let starts: Vec<usize> = gated_starts
        .iter()
        .copied()
        .filter(|&start| highest <= 2 || (start..start + width).contains(&peak))
        .collect();
    let most = starts.iter().map(|&start| own.sum(start, width)).max()?;
    if most < 2 || own_left.len() < 8 || !surely(most, own_total, width, own_left.len(), 2.5)? {
        return Some(None);
    }
    let first = *starts
        .iter()
        .find(|&&start| own.sum(start, width) == most)?;
    let run: Vec<usize> = (first..first + width)
        .take_while(|start| gated_starts.contains(start) && own.sum(*start, width) == most)
        .collect();
    let end = run.last()? + width;
    let mut asked = Vec::new();
    let (mut bins, mut total, mut brighter) = (own_left.len(), own_total, 0);
    // Photons above the background in the bins of these windows, times the bins left; and laser cycles times those.
    let bright = |counts: &[u32; BINS], left: &[usize], cycles: u16| {
        let there = (first..end).filter(|&bin| !own.leaves_out(bin, 0));
        let (inside, wide) = (
            there.clone().map(|bin| counts[bin]).sum::<u32>(),
            there.count(),
        );
        let all = left.iter().map(|&bin| counts[bin]).sum::<u32>();
        let above =
            (i128::from(inside) * left.len() as i128 - i128::from(all) * wide as i128).max(0);
        (inside, above, i128::from(cycles) * left.len() as i128)
    };
    let (_, own_above, own_cycles) = bright(&own.counts, &own_left, own.cycles);
    for other in others {
        let knows = !(first..end).any(|bin| other.leaves_out(bin, reach));
        let both = left(&[own, other]);
        if !knows || both.len() < 8 {
            continue;
        }
        let (inside, above, cycles) = bright(&other.counts, &both, other.cycles);
        if inside >= 2 && above * own_cycles > 2 * own_above * cycles {
            brighter += 1;
            continue;
        }
        bins = bins.min(both.len());
        total += both.iter().map(|&bin| other.counts[bin]).sum::<u32>();
        let mut other = other.clone();
        for bin in (0..BINS).filter(|&bin| own.leaves_out(bin, 0)) {
            other.counts[bin] = 0;
        }
        asked.push(other);
    }
    let all = |start: usize| {
        most + asked
            .iter()
            .map(|other| other.sum(start, width))
            .sum::<u32>()
    };
    let highest = run.iter().map(|&start| all(start)).max()?;
    let start = *run.iter().find(|&&start| all(start) == highest)?;
    let z = rule.rule().z(own_total, total).to_num();
    let is_confirmed = highest > most
        && highest >= rule.rule().own().minimum_count().raw()
        && surely(highest, total, width, bins, z)?;
    let window = Confirmed {
        start,
        own: most,
        all: highest,
        total,
        bins,
        asked,
        brighter,
    };
    Some(is_confirmed.then_some(window))
}

/// Checks the detection of `own` in the window that the model found.
fn check(
    detection: &Detection,
    own: &Known,
    window: &Confirmed,
    config: &PixelConfig<BINS, WindowRule>,
) {
    let width = usize::from(config.rule().width());
    let mut sum = own.counts;
    for other in &window.asked {
        for (sum, count) in sum.iter_mut().zip(other.counts) {
            *sum += count;
        }
    }
    let bins = window.start..window.start + width;
    let highest = bins.clone().map(|bin| sum[bin]).max().unwrap();
    let peak = bins.clone().find(|&bin| sum[bin] == highest).unwrap();
    assert_eq!(usize::from(detection.peak.bin.raw()), peak);
    assert_eq!(detection.peak.count.raw(), window.own);
    let outside = f64::from(own.counts.iter().sum::<u32>() - window.own);
    let left = (usize::from(config.gate().first())..=usize::from(config.gate().last()))
        .filter(|&bin| !own.leaves_out(bin, 0))
        .count();
    let background = outside * width as f64 / (left - width) as f64;
    assert!((f64::from(detection.background.raw()) - background).abs() <= 0.51);
    assert!(detection.depth.flags.contains(Flags::CONFIRMED));
    if own.echoes.is_empty() {
        // That of one histogram with the photons of all.
        let mut all = Histogram::<BINS, Count16>::new();
        all.add_frame(&sum.map(|count| count as u16), config.gate());
        let outside =
            U24F8::from_bits(((window.total - window.all) << 8) / (window.bins - width) as u32);
        let peak = Peak {
            bin: detection.peak.bin,
            count: Count::saturating(highest),
        };
        let expected = config
            .estimator()
            .estimate(&all, config.gate(), peak, outside);
        assert_eq!(detection.depth.offset, expected.offset);
        assert_eq!(detection.depth.flags, expected.flags | Flags::CONFIRMED);
    }
}

/// An array whose pixels have photons of one exposure, some after an echo, and the peaks of their echoes.
fn exposed<W: CounterWidth>(
    config: &PixelConfig<BINS, WindowRule>,
    trial: u32,
) -> (Vec<AsyncPixel<BINS, W>>, Vec<Vec<u16>>) {
    let mut rng = Pcg64Mcg::seed_from_u64(trial.into());
    // From almost no photons to a hundred a bin, of exposures of different lengths, with a target.
    let light = 1 << (trial % 8);
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
            pixel.count(config, if is_target { 12 + at % 3 } else { at % 32 });
        }
        let cycles = [44, 60, 100, 400][rng.next_u32() as usize % 4];
        pixel.begin_look(config, &mut statistics, cycles);
        (pixel, echoes)
    };
    (0..16).map(pixel).unzip()
}

#[test]
fn random_arrays_decide_as_the_formulas_say() {
    let (mut confirmed, mut refused, mut close, mut further, mut brighter) = (0, 0, 0, 0, 0);
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
        let known = |number: usize| Known {
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
            let is_confirmed = |found: Detection| found.depth.flags.contains(Flags::CONFIRMED);
            let alone = config.detect(pixels[asking].histogram());
            let own = known(asking);
            if own.echoes.is_empty() && alone.is_some() {
                assert_eq!(detection, alone);
            }
            if detection.is_some_and(|found| !is_confirmed(found)) {
                continue;
            }
            let others: Vec<Known> = around.map(known).collect();
            let reach = estimator.reach();
            match confirms(&own, &others, width, &gate, reach, &rule) {
                Some(expected) => {
                    brighter += expected.as_ref().map_or(0, |window| window.brighter);
                    assert_eq!(detection.is_some(), expected.is_some(), "{trial} {asking}");
                    if let (Some(found), Some(window)) = (&detection, &expected) {
                        check(found, &own, window, &config);
                    }
                }
                None => close += 1,
            }
            let found = u32::from(detection.is_some());
            confirmed += found;
            refused += 1 - found;
            further += found * u32::from(!own.echoes.is_empty());
        }
    }
    println!("{confirmed} confirmed, {further} after an echo, {refused} not, {close} too close");
    assert!(
        confirmed > 1000 && further > 300 && refused > 1000 && brighter > 300,
        "{brighter}"
    );
    assert!(close * 10 < confirmed + refused);
}
