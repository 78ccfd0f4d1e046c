//! The whole pixel, redrawn as plainly as it can be: all rules, echoes and tracking. Its
//! arithmetic is that of wide integers. Bins that are held are a set.

use std::collections::BTreeSet;

use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{
    AnyRule, AverageRule, BinIndex, BlockLevel, Count, DepthEvent, EchoNumber, Flags, LaserCycle,
    Look, PaperRule, PixelAddress, PixelConfig, RangeGate, SubBinOffset, WindowRule,
};

use super::counted::Counted;

/// A rule and its number: α in 1/256, or width and z in 1/4096.
#[derive(Clone, Copy, Debug)]
pub enum Rule {
    Paper(u16),
    Average(u16),
    Window(u8, u16),
}

#[derive(Clone, Copy, Debug)]
pub struct Settings {
    pub x: u16,
    pub l1: u16,
    pub l2: u16,
    pub first: usize,
    pub last: usize,
    pub rule: Rule,
    pub minimum: u32,
    pub is_one_hit: bool,
    pub echoes: u8,
    pub reach: u8,
    pub wait: u8,
    /// z near the last event and elsewhere, for a window rule.
    pub tracks: bool,
}

impl Settings {
    pub fn config<const BINS: usize>(&self) -> PixelConfig<BINS, AnyRule> {
        let minimum = Count::new(self.minimum).unwrap();
        let rule: AnyRule = match self.rule {
            Rule::Paper(alpha) => PaperRule::new(U8F8::from_bits(alpha), minimum).into(),
            Rule::Average(alpha) => AverageRule::new(U8F8::from_bits(alpha), minimum).into(),
            Rule::Window(width, z) => WindowRule::new(width, U4F12::from_bits(z), minimum)
                .unwrap()
                .into(),
        };
        let gate = RangeGate::new(self.first as u16, self.last as u16).unwrap();
        let tracking = rule.tracking(&gate).filter(|_| self.tracks);
        let config = PixelConfig::with_rule(rule)
            .gate(gate)
            .x(self.x)
            .l1(self.l1);
        let config = config
            .l2(self.l2)
            .dead_time(if self.flags_pile_up() { u16::MAX } else { 0 })
            .tracking(tracking);
        let echoes = EchoNumber::new(self.echoes).unwrap();
        let config = config.echoes(echoes, self.reach).echo_wait(self.wait);
        config.build().unwrap()
    }

    /// The window rule weighs bins instead: `dead_time` tests that.
    fn flags_pile_up(&self) -> bool {
        self.is_one_hit && !matches!(self.rule, Rule::Window(..))
    }

    /// z near the last event, and elsewhere: what the configuration says.
    fn shares<const BINS: usize>(&self) -> Option<(u16, u16)> {
        let config = self.config::<BINS>();
        let tracking = config.tracking()?;
        let z = |rule: &AnyRule| match rule {
            AnyRule::Window(rule) => rule.z().to_bits(),
            _ => unreachable!("only windows track"),
        };
        Some((z(tracking.near()), z(tracking.far())))
    }
}

/// A peak that stands clear, and the background in 1/256.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Found {
    pub bin: usize,
    pub background: u32,
    pub is_expected: bool,
}

pub struct Pixel {
    settings: Settings,
    shares: Option<(u16, u16)>,
    pub now: Counted,
    /// The peaks of the echoes of this exposure, but for its last.
    pub peaks: Vec<usize>,
    /// The bins around them.
    pub held: BTreeSet<usize>,
    /// N at the last of them.
    echo_at: u32,
    /// Where the last event was, if the last exposure had one.
    expected: Option<usize>,
    pub waiting: Option<DepthEvent>,
    /// Events of the rule near the last event; exposures that ended with too few bins left.
    pub near: u32,
    pub cramped: u32,
}

impl Pixel {
    pub fn new<const BINS: usize>(settings: Settings) -> Self {
        Self {
            settings,
            shares: settings.shares::<BINS>(),
            now: Counted::new(BINS, settings.first..=settings.last),
            peaks: Vec::new(),
            held: BTreeSet::new(),
            echo_at: 0,
            expected: None,
            waiting: None,
            near: 0,
            cramped: 0,
        }
    }

    pub fn end(&mut self, last_cycle: u64, cycles: u32) -> Look {
        let Settings { x, l1, l2, .. } = self.settings;
        if let Some(look) = self.now.end(cycles, x, l1) {
            return look;
        }
        self.empty_held();
        let had_event = !self.peaks.is_empty();
        let wait = self.settings.wait;
        let has_waited = wait < 255 && self.now.exposure >= self.echo_at * u32::from(wait);
        if self.now.exposure >= u32::from(l2) || had_event && has_waited {
            self.now.statistics.expired += u64::from(!had_event);
            self.now.statistics.expired_deferred += u64::from(!had_event && self.now.put_off);
            self.begin(self.peaks.last().copied());
            return if had_event {
                Look::Ended
            } else {
                Look::Expired
            };
        }
        if self.waiting.is_some() {
            self.now.statistics.deferred += 1;
            self.now.put_off = true;
            return Look::Deferred;
        }
        let Some(found) = self.decide() else {
            return Look::NoPeak;
        };
        self.waiting = Some(self.event(found, last_cycle));
        self.near += u32::from(found.is_expected);
        self.now.statistics.events += 1;
        self.echo_at = self.now.exposure;
        let is_last = self.peaks.len() + 1 == usize::from(self.settings.echoes);
        if is_last || !self.hold(found.bin) {
            self.cramped += u32::from(!is_last);
            self.begin(Some(found.bin));
        } else {
            self.now.put_off = false;
            self.empty_held();
        }
        Look::Event
    }

    /// Leaves out the bins around an echo: whether enough are left.
    pub fn hold(&mut self, bin: usize) -> bool {
        let reach = usize::from(self.settings.reach);
        self.peaks.push(bin);
        self.held.extend(bin.saturating_sub(reach)..=bin + reach);
        self.left().len() >= 8
    }

    pub fn empty_held(&mut self) {
        for (bin, count) in self.now.counts.iter_mut().enumerate() {
            if self.held.contains(&bin) {
                self.now.statistics.counted -= u64::from(*count);
                self.now.statistics.excluded += u64::from(*count);
                *count = 0;
            }
        }
    }

    /// A new exposure.
    fn begin(&mut self, last_event: Option<usize>) {
        self.now.begin();
        self.peaks.clear();
        self.held.clear();
        self.expected = last_event.filter(|_| self.shares.is_some());
    }

    /// The bins that may hold the peak.
    fn left(&self) -> Vec<usize> {
        let gate = self.settings.first..=self.settings.last;
        gate.filter(|bin| !self.held.contains(bin)).collect()
    }

    /// The first of the highest of these bins.
    fn highest(&self, bins: impl Iterator<Item = usize>) -> usize {
        bins.min_by_key(|&bin| (std::cmp::Reverse(self.now.counts[bin]), bin))
            .unwrap()
    }

    pub fn decide(&self) -> Option<Found> {
        let Settings { first, last, .. } = self.settings;
        let bin = self.highest(first..=last);
        let peak = self.now.counts[bin];
        let elsewhere = |background| Found {
            bin,
            background,
            is_expected: false,
        };
        match self.settings.rule {
            Rule::Paper(alpha) => {
                let background = self.quadrants(bin)?;
                let level = f64::from(background)
                    + f64::from(alpha) / 256.0 * f64::from(background).sqrt().floor();
                let fires = f64::from(peak) > level && peak >= self.settings.minimum;
                fires.then_some(elsewhere(256 * background))
            }
            Rule::Average(alpha) => {
                let (bins, total) = (self.left().len() as u128, u128::from(self.total()));
                let above = (bins * u128::from(peak)).saturating_sub(total);
                let fires = (256 * above).pow(2) > u128::from(alpha).pow(2) * bins * total;
                let fires = fires && peak >= self.settings.minimum;
                fires.then_some(elsewhere((256 * total / bins) as u32))
            }
            Rule::Window(width, z) => {
                let width = usize::from(width);
                if let (Some(expected), Some((near, _))) = (self.expected, self.shares)
                    && let Some(background) = self.window(expected, width, near)
                {
                    // One of the bins of the windows that hold the expected one.
                    let around = (expected + 1).saturating_sub(width).max(first)
                        ..=(expected + width - 1).min(last);
                    let bin = self.highest(around);
                    return Some(Found {
                        bin,
                        background,
                        is_expected: true,
                    });
                }
                let far = self.shares.filter(|_| self.expected.is_some());
                let z = far.map_or(z, |(_, far)| far);
                self.window(bin, width, z).map(elsewhere)
            }
        }
    }

    fn total(&self) -> u32 {
        self.now.counts.iter().sum()
    }

    /// The smaller of the maxima of the two quadrants without the peak, of those of which at
    /// most half is held.
    fn quadrants(&self, peak: usize) -> Option<u32> {
        let Settings { first, last, .. } = self.settings;
        let n = last + 1 - first;
        let [a, b, c, d, e] = [0, n / 4, n / 2, n * 3 / 4, n].map(|start| first + start);
        let pair = if peak < c { [c..d, d..e] } else { [a..b, b..c] };
        let kept = pair.into_iter().filter(|quadrant| {
            let held = quadrant
                .clone()
                .filter(|bin| self.held.contains(bin))
                .count();
            2 * held <= quadrant.len()
        });
        kept.map(|quadrant| self.now.counts[quadrant].iter().copied().max().unwrap())
            .min()
    }

    /// The background, if the best window around `bin` stands `z` clear of it.
    fn window(&self, bin: usize, width: usize, z: u16) -> Option<u32> {
        let Settings { first, last, .. } = self.settings;
        let starts = first.max((bin + 1).saturating_sub(width))..=bin.min(last + 1 - width);
        let sums = starts.map(|start| self.now.counts[start..start + width].iter().sum::<u32>());
        let inside = sums.max().unwrap();
        let z = i128::from(z).pow(2); // in 1/2²⁴
        let (b, w) = (self.left().len() as i128, width as i128);
        let (s, t, n) = (i128::from(inside), i128::from(self.total()), b - w);
        // In 1/16. z² and what it is multiplied with are rounded down.
        let above = 16 * (b * s - w * t) - (n - w).max(0) * ((z / 6) >> 20);
        let spread = n * w * t;
        let sum = spread + b.pow(2) * (z >> 20) / (36 * 16);
        let shift = (0..).find(|&shift| sum >> shift < 1 << 16).unwrap();
        let part = ((spread >> shift) << 16)
            .checked_div(sum >> shift)
            .unwrap_or(0);
        let clear = above > 0 && 16 * above.pow(2) > (z >> 16) * ((spread * part) >> 12);
        let fires = clear && inside >= self.settings.minimum;
        fires.then(|| (256 * (t - s) / n) as u32)
    }

    fn event(&self, found: Found, cycle: u64) -> DepthEvent {
        let Found {
            bin, background, ..
        } = found;
        let (first, last) = (self.settings.first, self.settings.last);
        let peak = self.now.counts[bin];
        let reach = usize::from(self.settings.reach);
        let beside_held = (bin.saturating_sub(1)..=bin + 1).any(|bin| self.held.contains(&bin));
        let behind = |&echo: &usize| (echo + reach + 1..=echo + 2 * reach).contains(&bin);
        let flags = [
            peak == 1023,
            bin == first || bin == last || beside_held,
            self.now.put_off,
            self.settings.flags_pile_up() && 2 * self.now.in_bins > self.now.exposure,
            self.peaks.iter().any(behind),
        ];
        let flags = (0..)
            .zip(flags)
            .map(|(bit, is_set)| u8::from(is_set) << bit);
        let above =
            |bin: usize| (256.0 * f64::from(self.now.counts[bin]) - f64::from(background)).max(0.0);
        let left = if bin > first { above(bin - 1) } else { 0.0 };
        let right = if bin < last { above(bin + 1) } else { 0.0 };
        // 0 of 0 is none.
        let shift = 256.0 * (right - left) / (left + above(bin) + right);
        DepthEvent {
            pixel: PixelAddress::new(77),
            level: BlockLevel::PIXEL,
            echo: EchoNumber::new(self.peaks.len() as u8 + 1).unwrap(),
            cycle: LaserCycle::new(cycle),
            exposure: self.now.exposure as u16,
            peak_bin: BinIndex::new(bin as u16).unwrap(),
            offset: SubBinOffset::new(128 + shift.round() as i16).unwrap(),
            peak_count: Count::new(peak).unwrap(),
            background: Count::new((background + 128) >> 8).unwrap(),
            flags: Flags::from_bits(flags.sum()).unwrap(),
        }
    }
}
