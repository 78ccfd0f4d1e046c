#![doc = include_str!("../README.md")]
//! ## From histograms to settings
//!
//! ```text
//! histograms → pile-up → background, hot and dead pixels → peaks → cover glass → pulse
//!   → offset → gate, window, z, L1
//! ```
//!
//! `docs/calibrate.md` says how each is found.

#![deny(clippy::print_stderr, clippy::print_stdout)]

mod false_alarms;
mod find;
mod remarks;
pub mod report;
mod settle;
mod spend;
mod watch;
mod written;

use anyhow::Result;
use dtof_core::CentredWindow;
use dtof_core::fixed::types::U8F8;

pub use find::glass::{Glass, Nearest};
pub use find::observed::{Length, Observed};
pub use find::offset::Offset;
pub use find::pile_up::Tdc;
pub use find::pixels::Pixels;
pub use find::pulse::Pulse;
pub use remarks::remarks;
pub use spend::Spent;
pub use watch::{Change, RunPhotons, glass_change};

use find::background::Level;
use find::common::Scene;
use find::limits::{is_less, median};
use find::observed::Trace;
use find::shape::Window;
use find::{glass, offset, peaks, pile_up, pulse};
use spend::Replay;

/// How pixels are to decide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {
    /// Bins in the window.
    pub window: u8,
    /// Standard deviations of the background, for so many false alarms; `None` where rates are
    /// not known.
    pub z: Option<f64>,
    /// Whether a lower one would do: the fewest photons alone keep false alarms down.
    pub is_by_count: bool,
    /// Exposures that were simulated for it.
    pub exposures: u64,
    /// The share of exposures without a target that may end with an event.
    pub false_alarm: f64,
    /// Photons in the window, at least.
    pub min_count: u16,
    /// L1.
    pub l1: u16,
    /// L2.
    pub l2: u16,
    /// X.
    pub x: u16,
    /// Standard deviation of the pulse that the depth is found with.
    pub sigma_bins: U8F8,
    /// How far the window that finds it reaches to either side, where that differs.
    pub half_widths: Option<CentredWindow>,
}

/// What the user says beside the recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asked {
    /// Whether the nearest peak that all pixels have is a cover glass.
    pub glass: Option<bool>,
    /// How far away the target is that most of the pixels see.
    pub target_mm: Option<f64>,
    /// The share of exposures without a target that may end with an event.
    pub false_alarm: f64,
    /// Seed of what is simulated.
    pub seed: u64,
}

impl Default for Asked {
    fn default() -> Self {
        Self {
            glass: None,
            target_mm: None,
            false_alarm: 0.01,
            seed: 1,
        }
    }
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// How long captures lasted.
    pub length: Length,
    /// Bins of a histogram.
    pub bins: usize,
    /// Picoseconds a bin: fitted, or as they were given.
    pub bin_width_ps: f64,
    /// Background, hot and dead pixels.
    pub pixels: Pixels,
    /// The TDC, where laser cycles are known.
    pub tdc: Option<Tdc>,
    /// The nearest peak that all pixels have.
    pub nearest: Nearest,
    /// The pulse, if a peak is bright enough.
    pub pulse: Option<Pulse>,
    /// How far away the target is, as the user says.
    pub target_mm: Option<f64>,
    /// The range offset, if a distance is known.
    pub offset: Option<Offset>,
    /// First and last bin that may hold a peak.
    pub gate: (u16, u16),
    /// How pixels are to decide, if the pulse is known.
    pub detection: Option<Detection>,
    /// What events of the recording come to, where true distances are known.
    pub spent: Option<Spent>,
    /// Photons a laser cycle of each bin, the mean over all good pixels and captures.
    pub mean: Vec<f64>,
    /// Captures and pixels.
    pub looked_at: (usize, usize),
}

/// The histograms of a recording, and what their pixels are like.
struct Seen {
    traces: Vec<Trace>,
    levels: Vec<Level>,
    pixels: Pixels,
    /// The last bin that was measured.
    last: usize,
    tdc: Option<Tdc>,
}

impl Seen {
    fn new(observed: &Observed, hot: &[usize]) -> Result<Self> {
        let mut traces = observed.traces(hot)?;
        let last = leave_out_unmeasured(&mut traces);
        let tdc = observed.length.is_known().then(|| pile_up::tdc(&traces));
        if let Some(Tdc::OneHit(_)) = tdc {
            for trace in &mut traces {
                trace.counts = pile_up::coates(&trace.counts, trace.cycles).0;
            }
        }
        let levels: Vec<Level> = traces
            .iter()
            .map(|trace| Level::of(&trace.counts))
            .collect();
        Ok(Self {
            pixels: Pixels::new(observed.array.pixels() as usize, &traces, &levels),
            traces,
            levels,
            last,
            tdc,
        })
    }
}

/// Calibrates by a recording.
///
/// # Errors
/// What is wrong with the recording, or with what was asked.
pub fn calibrate(observed: &Observed, asked: &Asked) -> Result<Calibration> {
    let mut seen = Seen::new(observed, &[])?;
    if !seen.pixels.hot.is_empty() && !observed.length.is_known() {
        // A hot pixel is the brightest, and no measure of how long the recording lasted.
        seen = Seen::new(observed, &seen.pixels.hot)?;
    }
    let Seen {
        traces,
        levels,
        pixels,
        last,
        tdc,
    } = seen;
    let truth = observed.truth_mm.unwrap_or_default();
    let good = traces.into_iter().zip(levels).enumerate();
    let good = good.filter(|(_, (trace, _))| pixels.is_good(trace.pixel));
    let (numbers, (traces, levels)): (Vec<usize>, (Vec<_>, Vec<_>)) = good.unzip();
    anyhow::ensure!(!traces.is_empty(), "every pixel is dead or hot");
    let scene = Scene::new(observed.array, pixels.background, traces, levels);

    let l2 = settle::l2(pixels.background);
    let nearest = glass::nearest(&scene, asked.glass, l2.into());
    let found = match &nearest {
        Nearest::Glass(glass) => Some(glass),
        _ => None,
    };
    let bins = observed.bins();
    let gate = settle::gate(last, found.map_or(0, |glass| glass.end))?;
    let pulse = pulse::pulse(&windows(&scene, gate.0, found), asked.seed);
    let window = window_of(pulse.as_ref());
    let mut offset = offset_of(&scene, &numbers, truth, gate, window, observed, asked);
    let cycles = scene.cycles();
    let (counts, _) = scene.pooled();
    let known = |spent| {
        pulse.as_ref().map(|pulse| settle::Findings {
            bins,
            gate,
            pulse,
            pixels: &pixels,
            is_absolute: observed.length != Length::Unknown,
            spent,
            asked,
        })
    };
    let decide = |spent| known(spent).map(|known| settle::detection(&known));
    let mut detection = decide(None).transpose()?;
    let mut spent = None;
    let bin_width_ps = offset
        .and_then(|offset| offset.bin_width_ps)
        .unwrap_or(observed.bin_width_ps);
    if let (Some(of), Some(offset)) = (&detection, &mut offset) {
        let scale = (gate, bin_width_ps, offset.mm);
        if let Some(replay) = Replay::new(observed, of, &pixels.hot, scale, asked.seed)? {
            spent = replay.best()?;
        }
        if let Some(spent) = spent {
            offset.mm += spent.offset_mm;
            detection = decide(Some(spent)).transpose()?;
        }
    }
    Ok(Calibration {
        length: observed.length,
        bins,
        bin_width_ps,
        tdc,
        nearest,
        pulse,
        target_mm: asked.target_mm,
        offset,
        gate,
        detection,
        spent,
        mean: counts.iter().map(|count| count / cycles).collect(),
        looked_at: (observed.captures.len(), observed.array.pixels() as usize),
        pixels,
    })
}

/// The last bin before those that were not measured is left out if it has less than this share of
/// the photons of the others.
const PARTLY: f64 = 0.8;

/// Bins at the end that hold no photon where others surely have some were not measured: they are
/// cut off. Gives the last one that is left.
fn leave_out_unmeasured(traces: &mut [Trace]) -> usize {
    let bins = traces.first().map_or(0, |trace| trace.counts.len());
    let sum = |bin: usize| traces.iter().map(|trace| trace.counts[bin]).sum::<f64>();
    let sums: Vec<f64> = (0..bins).map(sum).collect();
    let end = sums.iter().rposition(|&sum| sum > 0.0);
    let end = end.map_or(bins, |last| last + 1);
    let usual = median(sums[..end].iter().copied());
    if !is_less(0.0, usual, 1e6) {
        return bins.saturating_sub(1);
    }
    let is_cut = end < bins && is_less(sums[end - 1], PARTLY * usual, 1e6);
    let end = end - usize::from(is_cut);
    for trace in traces {
        trace.counts.truncate(end);
    }
    end - 1
}

/// One window for each histogram: its strongest peak behind the gate's first bin. Without any the
/// glass has to do, which is a pulse of the same laser.
fn windows(scene: &Scene, first: u16, glass: Option<&Glass>) -> Vec<Window> {
    let first = usize::from(first);
    let of = |wanted: &dyn Fn(&peaks::Peak) -> bool| -> Vec<Window> {
        let all = scene.traces.iter().zip(&scene.peaks).enumerate();
        all.filter_map(|(index, (trace, peaks))| {
            let strongest = (0..peaks.len())
                .filter(|&at| wanted(&peaks[at]))
                .max_by(|&one, &other| peaks[one].photons.total_cmp(&peaks[other].photons))?;
            let before = strongest.checked_sub(1).map_or(0, |at| peaks[at].last + 1);
            let behind = peaks.get(strongest + 1);
            let behind = behind.map_or(scene.bins() - 1, |peak| peak.first - 1);
            let peak = peaks[strongest];
            let background = scene.background(index, peak.top);
            let bins = (before.min(peak.first), peak.top, behind.max(peak.last));
            Some(Window::new(&trace.counts, background, trace.cycles, bins))
        })
        .collect()
    };
    let behind =
        of(&|peak| peak.top >= first && glass.is_none_or(|glass| peak.top > glass.top + 1));
    if behind.is_empty() {
        of(&|_| true)
    } else {
        behind
    }
}

/// The window of the depth that events will have; without a pulse one for a bin of deviation.
fn window_of(pulse: Option<&Pulse>) -> CentredWindow {
    let suited = pulse.and_then(|pulse| pulse.suited);
    let sigma = pulse.map_or(1.0, |pulse| pulse.sigma);
    suited.map_or_else(
        || CentredWindow::for_pulse(settle::sigma(sigma)),
        |suited| suited.window,
    )
}

fn offset_of(
    scene: &Scene,
    numbers: &[usize],
    truth: &[Option<f64>],
    gate: (u16, u16),
    window: CentredWindow,
    observed: &Observed,
    asked: &Asked,
) -> Option<Offset> {
    let stands = |index: usize| {
        let peaks = scene.peaks[index].iter();
        peaks
            .into_iter()
            .any(|peak| peak.top >= usize::from(gate.0))
    };
    let placed = (0..numbers.len()).filter(|&index| stands(index));
    let placed = placed.filter_map(|index| {
        let position = offset::position(&scene.traces[index], observed.bins(), gate, window)?;
        Some((numbers[index], position))
    });
    let placed: Vec<(usize, f64)> = placed.collect();
    if let Some(distance) = asked.target_mm {
        let positions: Vec<f64> = placed.iter().map(|placed| placed.1).collect();
        return offset::from_target(&positions, distance, observed.bin_width_ps);
    }
    let pairs: Vec<(f64, f64)> = placed
        .iter()
        .filter_map(|&(number, position)| Some((position, (*truth.get(number)?)?)))
        .collect();
    offset::from_distances(&pairs, observed.bin_width_ps)
}
