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

mod audit;
mod false_alarms;
mod find;
mod photon_budget;
mod remarks;
mod settle;
mod used_pulse;
mod watch;
mod written;

use std::collections::BTreeSet;
use std::ops::RangeInclusive;

use anyhow::Result;
use dtof_core::CentredWindow;
use dtof_core::fixed::types::U8F8;
use dtof_data::photons::MM_PER_PS;
use dtof_data::photons::list_checks::ListChecks;
use dtof_engine::settings::SettingsFile;
use dtof_light::progress::{self, Progress};
use rayon::prelude::*;

pub use audit::{Audit, Scatter};
pub use find::glass::{Glass, Layer, Nearest};
pub use find::observed::{Length, Observed};
pub use find::offset::Offset;
pub use find::pile_up::Tdc;
pub use find::pixel_offsets::PixelOffsets;
pub use find::pixels::Pixels;
pub use find::pulse::Pulse;
pub use photon_budget::PhotonBudget;
pub use remarks::remarks;
pub use used_pulse::{KnownPulse, PulseSource};
pub use watch::{Change, RunPhotons, glass_change};

use find::background::Level;
use find::good_histograms::GoodHistograms;
use find::observed::Trace;
use find::pixel_offsets::{LARGEST_MM, Measured, pixel_offsets};
use find::shape::Window;
use find::significance::median;
use find::{glass, offset, peaks, pile_up, pulse};
use photon_budget::Replay;
use used_pulse::UsedPulse;

/// Settings of the window rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindowDetection {
    /// Bins in the window.
    pub window: u8,
    /// Standard deviations of the background; `None` where rates are not known.
    pub z: Option<f64>,
    /// Whether the minimum count alone keeps false alarms down, so that a lower z would do.
    pub is_by_count: bool,
    /// Exposures that were simulated to find z.
    pub exposures: u64,
    /// The share of exposures without a target that may end with an event.
    pub false_alarm: f64,
    /// The fewest photons in the window.
    pub min_count: u16,
    /// L1 in laser cycles.
    pub l1: u16,
    /// L2 in laser cycles.
    pub l2: u16,
    /// X in laser cycles.
    pub x: u16,
    /// Standard deviation of the pulse in bins, for the depth estimator.
    pub sigma_bins: U8F8,
    /// Half widths of the depth estimator, where its window is asymmetric.
    pub half_widths: Option<CentredWindow>,
    /// Where the pulse comes from.
    pub pulse_source: PulseSource,
}

/// What the user knows beside the recording, and asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationOptions {
    /// Whether the nearest peak that all pixels share is crosstalk of a cover glass.
    pub glass: Option<bool>,
    /// Bins for which the TDC is dead after a photon, if the user knows; 0 if it takes all.
    pub dead_time: Option<u16>,
    /// First and last bin of the gate, if the user gives one, in place of that which is found.
    pub gate: Option<(u16, u16)>,
    /// Distance in millimetres, straight ahead, of a flat target that most of the pixels see. If the rays of the pixels are
    /// not known, the median pixel is taken to see it at this range.
    pub target_mm: Option<f64>,
    /// The share of exposures without a target that may end with an event.
    pub false_alarm: f64,
    /// The pulse, if it is known.
    pub known_pulse: KnownPulse,
    /// Seed of the simulations.
    pub seed: u64,
}

impl CalibrationOptions {
    /// These options with the pulse of `settings`. If it `is_given` by the user, it holds whatever the recording
    /// shows; that of older settings holds where no peak is bright enough.
    #[must_use]
    pub const fn with_pulse_of(mut self, settings: &SettingsFile, is_given: bool) -> Self {
        self.known_pulse = KnownPulse::of(settings, is_given);
        self
    }
}

impl Default for CalibrationOptions {
    fn default() -> Self {
        Self {
            glass: None,
            dead_time: None,
            gate: None,
            target_mm: None,
            false_alarm: 0.01,
            known_pulse: KnownPulse::default(),
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
    /// What its counts say against the recording.
    pub audit: Audit,
    /// Whether the recording is known to hold something else than histograms, so that nothing here means anything.
    pub is_void: bool,
    /// Whether the user keeps hot pixels: they are left out of what is measured, not of the settings.
    pub keeps_hot: bool,
    /// Background, hot and dead pixels.
    pub pixels: Pixels,
    /// The TDC, where laser cycles are known or the background shows it.
    pub tdc: Option<Tdc>,
    /// The nearest peak that all pixels share.
    pub nearest: Nearest,
    /// The pulse, if a peak is bright enough.
    pub pulse: Option<Pulse>,
    /// Distance of the target in millimetres, as the user gives it.
    pub target_mm: Option<f64>,
    /// Whether the rays of the pixels are known.
    pub has_rays: bool,
    /// The range offset, if a distance is known.
    pub offset: Option<Offset>,
    /// By how much the pixels differ, if a distance is known to more than one.
    pub pixel_offsets: Option<PixelOffsets>,
    /// First and last bin of the range gate.
    pub gate: (u16, u16),
    /// The share of the histograms that have a surface only outside of the gate, beside the crosstalk.
    pub hidden: f64,
    /// Settings of the window rule.
    pub detection: WindowDetection,
    /// The best use of photons, where true distances are known.
    pub photon_budget: Option<PhotonBudget>,
    /// Photons a laser cycle of each bin, the mean over all good pixels and captures.
    pub mean: Vec<f64>,
    /// Number of captures.
    pub captures: usize,
    /// Pixels of a capture.
    pub array_pixels: usize,
    /// Columns of its array.
    pub columns: usize,
}

/// All histograms of a recording, corrected for pile-up, and the properties of their pixels.
struct AllHistograms {
    traces: Vec<Trace>,
    levels: Vec<Level>,
    pixels: Pixels,
    /// The first and the last bin that were measured.
    range: RangeInclusive<usize>,
    tdc: Option<Tdc>,
    audit: Audit,
}

impl AllHistograms {
    fn new(observed: &Observed, hot: &[usize], options: &CalibrationOptions) -> Result<Self> {
        let mut traces = observed.traces(hot)?;
        let mut counts = traces.iter().flat_map(|trace| &trace.counts);
        anyhow::ensure!(
            counts.any(|&count| count > 0.0),
            "no photons, so nothing can be measured: all histograms{} are empty",
            match observed.masked {
                Some([_, ..]) => " but those of pixels that are left out",
                _ => "",
            }
        );
        let has_cycles = observed.length.is_known();
        let full = audit::full_counters(&traces).or_else(|| audit::wrapped_counters(&traces));
        let (range, short) = audit::range(&traces, has_cycles);
        for trace in &mut traces {
            trace.counts.truncate(range.end() + 1);
            trace.live.truncate(range.end() + 1);
        }
        let missing = audit::fill_missing_codes(&mut traces);
        let no_counts = audit::no_counts(&traces, has_cycles, options.false_alarm);
        let dim = match observed.length {
            Length::Cycles(cycles) if observed.times.is_none() => {
                let photons = traces.iter().map(|trace| trace.counts.iter().sum());
                audit::hardly_any_light(photons.fold(0.0, f64::max), cycles)
            }
            Length::Cycles(_) => None,
            _ => audit::sets_the_length(observed, hot),
        };
        let checks = observed.times.map(|times| times.checks);
        let together = checks.and_then(ListChecks::together_warning);
        let wandering = checks.and_then(ListChecks::wandering_warning);
        let tdc = match observed.length {
            // Full counters look like a dead time.
            _ if full.is_some() && options.dead_time.is_none() => None,
            Length::Cycles(_) => Some(match options.dead_time {
                Some(bins) => pile_up::known_tdc(&traces, bins.into()),
                None => pile_up::tdc(&traces).or_by_times(&traces, observed.times),
            }),
            Length::PhotonsPerCycle(_) => None,
            Length::Unknown => pile_up::tdc_without_cycles(&traces),
        };
        if let Some(Tdc::DeadTime { bins, .. }) = tdc {
            for trace in &mut traces {
                trace.correct(trace.cycles, bins);
            }
        }
        let levels = traces.iter();
        let levels: Vec<Level> = levels
            .map(|trace| Level::of(&trace.counts, &trace.live))
            .collect();
        Ok(Self {
            pixels: Pixels::new(observed.array, &traces, &levels),
            traces,
            levels,
            range,
            tdc,
            audit: Audit {
                cause: full.or(together).or(no_counts),
                others: short
                    .filter(|_| options.gate.is_none())
                    .into_iter()
                    .chain(missing)
                    .chain(dim)
                    .chain(wandering)
                    .collect(),
            },
        })
    }
}

/// Calibrates a sensor from a recording.
///
/// # Errors
/// Fails if the recording is empty or has no photon, or its histograms differ in size; if every pixel is hot or dead; if a
/// gate is given that has fewer than 8 bins or ends past the last; if the crosstalk of the cover glass leaves no gate; or if
/// so few false alarms cannot be simulated.
pub fn calibrate(observed: &Observed, options: &CalibrationOptions) -> Result<Calibration> {
    calibrate_with(observed, options, progress::NONE)
}

/// The same with progress of the calculation.
///
/// # Errors
/// As [`calibrate`]. Also fails if `progress` ends the calculation.
pub fn calibrate_with(
    observed: &Observed,
    options: &CalibrationOptions,
    progress: Progress,
) -> Result<Calibration> {
    let mut all = AllHistograms::new(observed, &[], options)?;
    let keeps_all = observed.masked.is_some_and(<[u16]>::is_empty);
    if !all.pixels.hot.is_empty() && !observed.length.is_known() && !keeps_all {
        // A hot pixel is the brightest, but does not show how long the recording lasted.
        all = AllHistograms::new(observed, &all.pixels.hot, options)?;
    }
    let AllHistograms {
        traces,
        levels,
        pixels,
        range,
        tdc,
        mut audit,
    } = all;
    let good = traces.into_iter().zip(levels);
    let good = good.filter(|(trace, _)| pixels.is_good(trace.pixel));
    let (traces, levels): (Vec<_>, Vec<_>) = good.unzip();
    anyhow::ensure!(!traces.is_empty(), "every pixel is dead or hot");
    let good = GoodHistograms::new(observed.array, pixels.background, traces, levels);

    let seen = options.gate.map_or(0..=good.bins() - 1, |(first, last)| {
        first.into()..=last.into()
    });
    let uneven = uneven(&good, seen.clone(), tdc, observed.length, options);
    let l2 = settle::l2(pixels.background);
    let with_glass =
        |good: &GoodHistograms| glass::nearest(good, options.glass, observed.times, l2.into());
    let nearest = match tdc {
        // Near bins stand above the mean, which is no glass.
        _ if uneven.is_some() && options.glass.is_none() => Nearest::NotCommon,
        Some(Tdc::OnePhotonIn { cycles, .. }) => with_glass(&good.corrected(cycles)),
        _ => with_glass(&good),
    };
    let nearest = match nearest {
        // Beyond the gate that is given.
        Nearest::Unclear(layer) | Nearest::Passing(layer) if !seen.contains(&layer.bin) => {
            Nearest::NotCommon
        }
        nearest => nearest,
    };
    let cause = audit.cause.take();
    audit.cause = cause.or(uneven).or_else(|| audit::spike(&good, seen));
    let glass = nearest.glass();
    let bins = observed.bins();
    let gate = match options.gate {
        Some(gate) => settle::given_gate(gate, bins)?,
        None => settle::gate(
            *range.end(),
            glass.map_or(0, |glass| glass.end).max(*range.start()),
        )?,
    };
    let hidden = match options.gate {
        Some(_) => 0.0,
        None => hidden(&good, gate, glass),
    };
    let windows = match options.gate {
        Some(gate) => windows(&good, gate, None),
        // If no target stands behind the glass, the glass has the pulse of the same laser.
        None => Some(windows(&good, gate, glass))
            .filter(|windows| !windows.is_empty())
            .unwrap_or_else(|| windows(&good, (0, u16::MAX), None)),
    };
    let pulse = pulse::pulse(&windows, options.seed);
    let used = UsedPulse::new(pulse.as_ref(), &options.known_pulse);
    let found = offset_of(&good, gate, used.window(), observed, options);
    let (mut offset, pixel_offsets) = found.unzip();
    let mut pixel_offsets = pixel_offsets.flatten();
    if let (Some(offset), Some(pixels)) = (&mut offset, &pixel_offsets) {
        offset.mm += pixels.median_mm;
    }
    let counts = good.pooled().counts;
    let cycles = good.cycles();
    let findings = settle::Findings {
        bins,
        gate,
        measured: pulse.as_ref(),
        pulse: used,
        background: pixels.background,
        is_absolute: observed.length != Length::Unknown,
        options,
    };
    let mut detection = settle::detection(&findings, None, progress)?;
    let mut photon_budget = None;
    let bin_width_ps = offset
        .and_then(|offset| offset.bin_width_ps)
        .unwrap_or(observed.bin_width_ps);
    if let Some(offset) = &mut offset {
        let scale = (gate, bin_width_ps);
        let own = pixel_offsets.as_ref().map_or(&[][..], |pixels| &pixels.mm);
        let replay = Replay::new(
            observed,
            &detection,
            &pixels.hot,
            scale,
            (offset.mm, own),
            options.seed,
        )?;
        if let Some(replay) = replay {
            photon_budget = replay.best(progress)?;
        }
        if let Some(budget) = photon_budget {
            offset.mm += budget.offset_mm;
            detection = settle::detection(&findings, Some(budget), progress)?;
        }
    }
    // They were found as differences from those that the pixels have.
    let own = pixel_offsets.iter_mut().flat_map(|pixels| &mut pixels.mm);
    for (own, before) in own.zip(observed.offsets_mm) {
        *own += before;
    }
    Ok(Calibration {
        length: observed.length,
        bins,
        bin_width_ps,
        audit,
        is_void: false,
        keeps_hot: keeps_all,
        tdc,
        nearest,
        pulse,
        target_mm: options.target_mm,
        has_rays: observed.slant.is_some(),
        offset,
        pixel_offsets,
        gate,
        hidden,
        detection,
        photon_budget,
        mean: counts.iter().map(|count| count / cycles).collect(),
        captures: observed.captures(),
        array_pixels: observed.array.pixels() as usize,
        columns: observed.array.columns() as usize,
        pixels,
    })
}

/// That the background is not flat, and what helps. Pile-up is no reason, where laser cycles are known or the background
/// shows them, but a dead time that was not found is.
fn uneven(
    good: &GoodHistograms,
    gate: RangeInclusive<usize>,
    tdc: Option<Tdc>,
    length: Length,
    options: &CalibrationOptions,
) -> Option<String> {
    let text = audit::uneven_background(good, gate.clone(), options.false_alarm)?;
    let cycles = match (tdc, length) {
        (Some(Tdc::OnePhotonIn { cycles, .. }), _) => cycles,
        (Some(Tdc::DeadTime { .. }), _) => 0.0,
        (_, Length::Cycles(cycles)) => cycles as f64,
        _ => 0.0,
    };
    let has_more = |trace: &Trace| trace.counts.iter().sum::<f64>() >= cycles;
    let is_pile_up = !good.traces.iter().any(has_more)
        && audit::uneven_background(&good.corrected(cycles), gate, options.false_alarm).is_none();
    match tdc {
        Some(Tdc::OnePhotonIn { .. }) if is_pile_up => None,
        _ if is_pile_up => Some(format!(
            "{text}. It is so if the TDC takes the first photon of a laser cycle: --dead-time {} corrects that",
            good.bins()
        )),
        _ => Some(format!(
            "{text}. --gate FIRST..LAST keeps a part of the range that is flat"
        )),
    }
}

/// No pixel sees crosstalk so many times as bright as the median pixel.
const BRIGHT_GLASS: f64 = 1.5;

/// The share of the histograms that have peaks only outside of the `gate`, at least one of them beside the crosstalk.
fn hidden(good: &GoodHistograms, gate: (u16, u16), glass: Option<&Glass>) -> f64 {
    let gate = usize::from(gate.0)..=usize::from(gate.1);
    let Some(glass) = glass else { return 0.0 };
    // Crosstalk that is too dim for a peak in most histograms is in all of them.
    let crosstalk = |(index, trace): (usize, &Trace)| {
        let counts = trace.counts.iter().enumerate().take(glass.shape.len());
        counts
            .map(|(bin, count)| count - good.background(index, bin))
            .sum::<f64>()
    };
    let usual = median(good.traces.iter().enumerate().map(crosstalk)).max(0.0);
    let background = median(good.levels.iter().map(|level| level.mean));
    let noise = (usual + background * glass.shape.len() as f64)
        .max(1.0)
        .sqrt();
    // A surface may touch the crosstalk, which is then brighter than that of most.
    let most = BRIGHT_GLASS * usual + 5.0 * noise;
    let is_surface = |peak: &peaks::Peak| !peak.is_near(glass.top) || peak.photons > most;
    let is_hidden = |peaks: &&Vec<peaks::Peak>| {
        peaks.iter().any(is_surface) && !peaks.iter().any(|peak| gate.contains(&peak.top))
    };
    let hidden = good.peaks.iter().filter(is_hidden).count();
    hidden as f64 / good.peaks.len() as f64
}

/// One window for each histogram with a peak in the gate: around the strongest, behind the glass.
fn windows(good: &GoodHistograms, gate: (u16, u16), glass: Option<&Glass>) -> Vec<Window> {
    let is_used = |peak: &peaks::Peak| {
        is_in(gate, peak) && glass.is_none_or(|glass| peak.top > glass.top + 1)
    };
    let all = good.traces.iter().zip(&good.peaks).enumerate();
    all.filter_map(|(index, (trace, peaks))| {
        let strongest = (0..peaks.len())
            .filter(|&at| is_used(&peaks[at]))
            .max_by(|&one, &other| peaks[one].photons.total_cmp(&peaks[other].photons))?;
        let before = strongest.checked_sub(1).map_or(0, |at| peaks[at].last + 1);
        let after = peaks.get(strongest + 1);
        let after = after.map_or(good.bins() - 1, |peak| peak.first - 1);
        let peak = peaks[strongest];
        let background = good.background(index, peak.top);
        let bins = (before.min(peak.first), peak.top, after.max(peak.last));
        let counts = (&trace.counts[..], &trace.live[..]);
        Some(Window::new(counts, background, trace.cycles, bins))
    })
    .collect()
}

/// Whether a peak lies in a gate.
fn is_in((first, last): (u16, u16), peak: &peaks::Peak) -> bool {
    (usize::from(first)..=usize::from(last)).contains(&peak.top)
}

/// The range offset from the distance of the target, else from true distances. With it comes by how much the pixels
/// differ.
fn offset_of(
    good: &GoodHistograms,
    gate: (u16, u16),
    window: CentredWindow,
    observed: &Observed,
    options: &CalibrationOptions,
) -> Option<(Offset, Option<PixelOffsets>)> {
    let has_peak = |peaks: &[peaks::Peak]| peaks.iter().any(|peak| is_in(gate, peak));
    let all = good.traces.iter().zip(&good.peaks);
    let with_peak = all.filter(|(_, peaks)| has_peak(peaks));
    let placed = with_peak.filter_map(|(trace, _)| {
        let position = offset::position(trace, observed.bins(), gate, window)?;
        Some((trace, position))
    });
    let mut placed: Vec<(&Trace, f64, Option<f64>)> = placed
        .map(|(trace, position)| (trace, position, trace.truth_mm))
        .collect();
    let mm_per_bin = observed.bin_width_ps * MM_PER_PS;
    let offset = if let Some(distance) = options.target_mm {
        // It is farther away along a slanted ray. Without a field of view, as if all pixels looked straight ahead.
        let slant = |trace: &Trace| observed.slant.map_or(1.0, |slant| slant[trace.pixel]);
        for (trace, _, truth) in &mut placed {
            *truth = Some(distance * slant(trace) + observed.bias(trace.pixel));
        }
        // As if all pixels saw the target at that distance.
        let straight = placed.iter().map(|(_, position, truth)| {
            position - (truth.unwrap_or(distance) - distance) / mm_per_bin
        });
        let straight: Vec<f64> = straight.collect();
        // Pixels may differ only if it is known how far the target is in each.
        let reach = observed
            .slant
            .map_or(0.0, |_| 2.0 * LARGEST_MM / mm_per_bin);
        offset::from_target(&straight, distance, observed.bin_width_ps, reach)?
    } else {
        placed.retain(|(.., truth)| truth.is_some());
        let pairs = placed
            .iter()
            .filter_map(|(_, position, truth)| Some((*position, (*truth)?)));
        offset::from_distances(&pairs.collect::<Vec<_>>(), observed.bin_width_ps)?
    };
    if options.target_mm.is_none() && observed.captures() < 2 {
        // Its surfaces may differ from their true distances, and not the pixels.
        return Some((offset, None));
    }
    let mm_per_bin = offset.bin_width_ps.map_or(mm_per_bin, |ps| ps * MM_PER_PS);
    let measured = placed.par_iter().filter_map(|(trace, position, truth)| {
        Some(Measured {
            pixel: trace.pixel,
            error_mm: (*truth)? - mm_per_bin * position - offset.mm,
            noise_mm: mm_per_bin * offset::noise((trace, *position), observed.bins(), gate, window),
        })
    });
    let measured: Vec<Measured> = measured.collect();
    let has_traces = good
        .traces
        .iter()
        .map(|trace| trace.pixel)
        .collect::<BTreeSet<_>>();
    let pixels = observed.array.pixels() as usize;
    let is_good = |pixel: usize| has_traces.contains(&pixel);
    let found = pixel_offsets(&measured, pixels, is_good, mm_per_bin);
    let found = found.map(|found| match options.target_mm {
        Some(_) if observed.slant.is_none() => found.without_field_of_view(),
        _ => found,
    });
    Some((offset, found))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_core::{Array, PixelAddress};
    use dtof_data::photons::histograms::Histograms;
    use rand_distr::{Distribution, Poisson};

    /// What is found in one capture of a target at 1,200 mm, of 8x8 pixels of 56 mm a bin and these offsets, with
    /// so many photons of the target and so many a bin of the background.
    fn differences(
        offsets: &[f64; 64],
        (signal, background, sigma): (f64, f64, f64),
        seed: u64,
    ) -> PixelOffsets {
        let bin_width_ps = 373.6;
        let histogram = |pixel: usize| -> Vec<u64> {
            let address = PixelAddress::new(u16::try_from(pixel).unwrap());
            let mut rng = dtof_data::random::pixel_rng(seed, address);
            // Ranges differ by half a bin, as those of a plane.
            let mm = 1200.0 * slant(pixel) - offsets[pixel];
            let position = mm / (bin_width_ps * MM_PER_PS);
            let bins = (0..128).map(|bin| {
                let mean = background + signal * dtof_light::rates::bin_share(bin, position, sigma);
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                let count = Poisson::new(mean).unwrap().sample(&mut rng) as u64;
                count
            });
            bins.collect()
        };
        let histograms = Histograms::of((0..64).map(histogram)).unwrap();
        let slants: Vec<f64> = (0..64).map(slant).collect();
        // Without laser cycles no dead time is sought, which would take longest.
        let observed = Observed {
            bin_width_ps,
            slant: Some(&slants),
            ..Observed::plain(Array::new(8, 8).unwrap(), &histograms)
        };
        let all = AllHistograms::new(&observed, &[], &CalibrationOptions::default()).unwrap();
        let rate = all.pixels.background;
        let good = GoodHistograms::new(observed.array, rate, all.traces, all.levels);
        let options = CalibrationOptions {
            target_mm: Some(1200.0),
            ..CalibrationOptions::default()
        };
        let window = CentredWindow::for_pulse(U8F8::from_num(sigma));
        let found = offset_of(&good, (0, 127), window, &observed, &options);
        found.unwrap().1.unwrap()
    }

    fn slant(pixel: usize) -> f64 {
        1.0 + 0.03 * (pixel % 8) as f64 / 7.0 - 0.02 * (pixel / 8) as f64 / 7.0
    }

    #[test]
    fn true_distances_of_several_captures_give_offsets_without_a_field_of_view() {
        let histogram = |pixel: usize, mm: f64| -> Vec<u64> {
            let near = if pixel.is_multiple_of(2) { 40.0 } else { 0.0 };
            let position = (mm - near) / (250.0 * MM_PER_PS);
            let photons = |bin| 5.0 + 800.0 * dtof_light::rates::bin_share(bin, position, 0.9);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let counts = (0..128).map(|bin| photons(bin).round() as u64).collect();
            counts
        };
        let mm = |capture: usize, pixel: usize| 900.0 + 310.0 * capture as f64 + 7.0 * pixel as f64;
        let found = |captures: usize| {
            let truth: Vec<Option<f64>> = (0..captures * 8)
                .map(|at| Some(mm(at / 8, at % 8)))
                .collect();
            let all = (0..captures * 8).map(|at| histogram(at % 8, mm(at / 8, at % 8)));
            let histograms = Histograms::of(all).unwrap();
            let observed = Observed {
                truth_mm: Some(&truth),
                ..Observed::plain(Array::new(4, 2).unwrap(), &histograms)
            };
            calibrate(&observed, &CalibrationOptions::default()).unwrap()
        };
        // One capture does not tell pixels from surfaces.
        assert_eq!(found(1).pixel_offsets, None);
        let found = found(3);
        let (offset, pixels) = (found.offset.unwrap().mm, found.pixel_offsets.unwrap());
        for (pixel, own) in pixels.mm.iter().enumerate() {
            let expected = if pixel.is_multiple_of(2) { 40.0 } else { 0.0 };
            assert!(
                (offset + own - expected).abs() < 2.0,
                "{pixel}: {offset} {own}"
            );
        }
    }

    #[test]
    fn equal_pixels_have_no_offsets_but_for_few_of_a_thousand_recordings() {
        for (draws, most, light) in [
            (1000, 2, (200.0, 2.0, 0.8)),
            (200, 0, (1000.0, 20.0, 1.4)),
            (200, 0, (1000.0, 20.0, 0.5)),
            (200, 0, (100_000.0, 200.0, 0.8)),
        ] {
            let found: Vec<PixelOffsets> = (0..draws)
                .into_par_iter()
                .map(|seed| differences(&[0.0; 64], light, seed))
                .collect();
            let wrong = found.iter().filter(|found| !found.mm.is_empty()).count();
            assert!(wrong <= most, "{light:?}: {wrong} of {draws}");
        }
    }
}
