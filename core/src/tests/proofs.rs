//! Neighbours: every histogram of eight bins with 0, 1, 2 or 5 photons each asks two neighbours, which have each pair of some
//! histograms; also after an echo in further bins. With up to 2 photons in its highest bin a pixel looks at all windows,
//! with more at those of that bin.

use std::sync::Mutex;

use dtof_core::neighbours::NeighbourConfig;
use dtof_core::{
    Array, AsyncPixel, Count, Count8, Count10, Count16, CounterWidth, Detection, EchoNumber,
    LaserCycle, Neighbours, PixelAddress, PixelConfig, Statistics, WindowRule,
};

use super::neighbours::formulas::{GUARD, Known, compare};
use super::parallel;
use super::small::{HISTOGRAMS, histogram};

/// Of neighbours: nothing, the same surface, light over all bins, another surface, and brighter ones.
const OTHERS: [[u32; 8]; 8] = [
    [0; 8],
    [0, 0, 0, 2, 0, 0, 0, 0],
    [0, 0, 1, 3, 1, 0, 0, 0],
    [1; 8],
    [3, 0, 0, 0, 0, 0, 1, 3],
    [2, 1, 0, 3, 1, 2, 0, 1],
    [0, 0, 0, 0, 9, 8, 0, 1],
    [0, 40, 41, 3, 0, 0, 1, 2],
];

/// The photons of a bin of the pixel that asks.
const COUNTS: [u32; 4] = [0, 1, 2, 5];

/// Where the echo is that a pixel has had before, behind the eight bins.
const ECHO: u16 = 12;
const CYCLES_OF_ECHO: u16 = 44;

/// What came of some cases.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    cases: u64,
    alone: u64,
    confirmed: u64,
    /// Rounding decides.
    close: u64,
    /// Neighbours that were left out because they are brighter.
    brighter: u64,
}

/// How a pixel looks, and at which array.
struct Rules<const BINS: usize> {
    neighbours: NeighbourConfig,
    config: PixelConfig<BINS, WindowRule>,
}

impl<const BINS: usize> Rules<BINS> {
    fn new(width: u8, z: &str, minimum: u32) -> Self {
        let rule = WindowRule::new(width, z.parse().unwrap(), Count::saturating(minimum));
        let array = Array::new(3, 1).unwrap();
        let neighbours = NeighbourConfig::new(array, Neighbours::Four, &rule.unwrap());
        let echoes = EchoNumber::new(1 + u8::from(BINS > 8)).unwrap();
        let config = PixelConfig::with_rule(*neighbours.rule().own())
            .echoes(echoes, GUARD as u8)
            .build()
            .unwrap();
        Self { neighbours, config }
    }

    /// A pixel that has counted what is known of it, and looks.
    fn pixel<W: CounterWidth>(&self, known: &Known<BINS>) -> AsyncPixel<BINS, W> {
        let mut pixel = AsyncPixel::new(PixelAddress::new(0));
        let mut statistics = Statistics::default();
        let mut cycles = known.cycles;
        for &echo in &known.echoes {
            pixel.count_batch(&self.config, &[echo; 40]);
            let last = LaserCycle::new(0);
            pixel.end_laser_cycles(&self.config, &mut statistics, last, CYCLES_OF_ECHO);
            assert_eq!(pixel.take_event().unwrap().peak_bin.raw(), echo);
            cycles -= CYCLES_OF_ECHO;
        }
        pixel.count_frame(&self.config, &known.counts.map(|count| count as u16));
        pixel.begin_look(&self.config, &mut statistics, cycles);
        pixel
    }

    fn decide<W: CounterWidth>(&self, pixels: &[AsyncPixel<BINS, W>]) -> Option<Detection> {
        self.neighbours.decide(pixels, 1, &self.config)
    }
}

/// Photons in the first eight bins, after an echo or not.
fn known<const BINS: usize>(first: [u32; 8], has_echo: bool, cycles: u16) -> Known<BINS> {
    let before = if has_echo { CYCLES_OF_ECHO } else { 0 };
    Known {
        counts: std::array::from_fn(|bin| first.get(bin).copied().unwrap_or(0)),
        echoes: if has_echo { vec![ECHO] } else { vec![] },
        cycles: before + cycles,
    }
}

/// Every `step`-th histogram with each of the pairs of neighbours, at each of the rules. `echoes` says which of
/// the three pixels have had one.
fn all<const BINS: usize>(name: &str, step: u64, levels: &[(&str, u32)], echoes: &[[bool; 3]]) {
    let mut jobs = Vec::new();
    for width in 1..=3 {
        for &(z, minimum) in levels {
            for &echoes in echoes {
                // As long as the pixel that asks; so long and so short that others are brighter.
                for cycles in [[44, 44], [400, 20]] {
                    for left in 0..OTHERS.len() {
                        for right in left..OTHERS.len() {
                            jobs.push((width, z, minimum, echoes, cycles, [left, right]));
                        }
                    }
                }
            }
        }
    }
    let seen = Mutex::new(Seen::default());
    parallel::for_each(jobs.len() as u64, |number| {
        let (width, z, minimum, echoes, cycles, pair) = jobs[number as usize];
        let rules = Rules::<BINS>::new(width, z, minimum);
        let other =
            |at: usize, place: usize| known::<BINS>(OTHERS[pair[at]], echoes[place], cycles[at]);
        let others = [other(0, 0), other(1, 2)];
        let mut narrow = [0, 0, 1].map(|other| rules.pixel::<Count8>(&others[other]));
        let mut usual = [0, 0, 1].map(|other| rules.pixel::<Count10>(&others[other]));
        let mut wide = [0, 0, 1].map(|other| rules.pixel::<Count16>(&others[other]));
        let mut here = Seen::default();
        // Another start in each job, so that a share of the histograms is not always the same.
        for histogram in (number % step..HISTOGRAMS)
            .step_by(step as usize)
            .map(histogram)
        {
            let histogram = histogram.map(|count| COUNTS[count as usize]);
            let own = known(histogram, echoes[1], 44);
            narrow[1] = rules.pixel(&own);
            usual[1] = rules.pixel(&own);
            wide[1] = rules.pixel(&own);
            let detection = rules.decide(&usual);
            assert_eq!(detection, rules.decide(&narrow));
            assert_eq!(detection, rules.decide(&wide));
            let found = compare(detection, &own, &others, &rules.config, &rules.neighbours);
            here.cases += 1;
            here.alone += u64::from(found.is_alone);
            here.confirmed += u64::from(found.is_confirmed);
            here.close += u64::from(found.is_close);
            here.brighter += u64::from(found.brighter);
        }
        let mut seen = seen.lock().unwrap();
        seen.cases += here.cases;
        seen.alone += here.alone;
        seen.confirmed += here.confirmed;
        seen.close += here.close;
        seen.brighter += here.brighter;
    });
    let seen = seen.into_inner().unwrap();
    let Seen { cases, close, .. } = seen;
    println!("proofs: {name}: {cases} cases, {close} within rounding; {seen:?}");
    assert!(seen.confirmed * 100 > cases && seen.alone * 50 > cases && seen.brighter > 0);
    assert!(close * 50 < cases);
}

const LEVELS: [(&str, u32); 3] = [("2.7", 0), ("3.3", 9), ("4", 3)];
/// No pixel, the one that asks, a neighbour.
const ECHOES: [[bool; 3]; 3] = [[false; 3], [false, true, false], [true, false, false]];

#[test]
fn small_histograms_are_confirmed_by_the_formula() {
    all::<8>("neighbours", 397, &LEVELS, &[[false; 3]]);
    all::<16>("neighbours after an echo", 797, &LEVELS[..1], &ECHOES);
}

#[test]
#[ignore = "takes minutes: `.ci/long proofs`"]
fn all_small_histograms_are_confirmed_by_the_formula() {
    all::<8>("neighbours", 1, &LEVELS, &[[false; 3]]);
    all::<16>("neighbours after an echo", 1, &LEVELS[..1], &ECHOES);
}
