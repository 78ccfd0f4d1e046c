//! Settings from what was found: gate, window, z, L1 and L2.

use anyhow::{Result, ensure};
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{BlockLevel, CentredWindow, WindowRule};
use dtof_theory::tune::{Request, Wanted, window};

use super::false_alarms;
use super::find::pixels::Pixels;
use super::find::pulse::Pulse;
use super::spend::Spent;
use super::{Asked, Detection};
use dtof_options::Refused;

/// Laser cycles of an exposure, if the counters hold the background of so many.
const L2: u16 = 2000;
/// Laser cycles between looks.
const X: u16 = 4;
/// L1 where the signal is not known.
const L1: u16 = 40;
/// The least z that is written. Where lower ones would do, more light would bring false alarms.
const LEAST_Z: U4F12 = U4F12::lit("3");
/// Photons in the window, at least.
pub const MIN_COUNT: u16 = 5;
/// A background of so many leaves counters of 10 bits room for what it varies by.
const FULL: f64 = 860.0;

/// What there is to decide by.
pub struct Findings<'a> {
    /// Bins of a histogram.
    pub bins: usize,
    /// First and last bin of the gate.
    pub gate: (u16, u16),
    /// The pulse.
    pub pulse: &'a Pulse,
    /// The background.
    pub pixels: &'a Pixels,
    /// Whether rates are a laser cycle's.
    pub is_absolute: bool,
    /// What was found to be best, if true distances are known.
    pub spent: Option<Spent>,
    /// What is wanted.
    pub asked: &'a Asked,
}

/// Laser cycles of an exposure with this background a bin.
#[must_use]
pub fn l2(background: f64) -> u16 {
    let most = FULL / background.max(1e-9);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let most = most.min(L2.into()) as u16;
    most.max(4 * X)
}

/// The gate from bin `first` to bin `last`.
///
/// # Errors
/// If it leaves too few bins.
pub fn gate(last: usize, first: usize) -> Result<(u16, u16)> {
    let (first, last) = (u16::try_from(first)?, u16::try_from(last)?);
    ensure!(
        first + 7 <= last,
        Refused::input(format!(
            "the cover glass reaches up to bin {first}, the last bin is {last}: no gate leaves it \
             out; say `glass` no if it is none"
        ))
    );
    Ok((first, last))
}

/// A pulse as settings take it.
#[must_use]
pub fn sigma(sigma: f64) -> U8F8 {
    let sigma = U8F8::saturating_from_num(sigma);
    sigma.clamp(U8F8::DELTA, CentredWindow::WIDEST_PULSE)
}

/// The settings.
///
/// # Errors
/// If so few false alarms cannot be simulated.
pub fn detection(known: &Findings) -> Result<Detection> {
    let background = known.pixels.background;
    let l2 = l2(background);
    let sigma = sigma(known.pulse.sigma);
    let asked = known.asked;
    let spent = known.spent;
    let suits = || WindowRule::width_for_pulse(sigma);
    let x = spent.map_or(X, |spent| spent.x);
    let mut detection = Detection {
        window: spent.map_or_else(suits, |spent| spent.window),
        z: None,
        is_by_count: false,
        exposures: 0,
        false_alarm: asked.false_alarm,
        min_count: spent.map_or(MIN_COUNT, |spent| spent.min_count),
        l1: L1.min(l2 / 2),
        l2,
        x,
        sigma_bins: sigma,
        half_widths: known.pulse.suited.map(|suited| suited.window),
    };
    if !known.is_absolute {
        return Ok(detection);
    }
    let bins = u16::try_from(known.bins)?;
    let request = Request {
        background: background.max(1e-6),
        signal: known.pulse.signal,
        sigma: known.pulse.sigma.min(f64::from(bins) / 4.0),
        bins,
        minimum_count: MIN_COUNT,
        x,
        l1: None,
        l2,
        wanted: Wanted::PerExposure(asked.false_alarm),
        levels: BlockLevel::PIXEL,
        seed: asked.seed,
    };
    // A signal that is too weak for any L1 leaves it as it is.
    if let Ok(tuned) = window::tune(&request) {
        detection.l1 = tuned.l1;
    }
    let (z, exposures) = false_alarms::z(&false_alarms::Asked {
        background,
        bins: known.bins,
        gate: known.gate,
        window: detection.window,
        min_count: detection.min_count,
        looks: (detection.l1, l2, x),
        share: asked.false_alarm,
        seed: asked.seed,
    })?;
    detection.is_by_count = z < LEAST_Z;
    detection.z = Some(z.max(LEAST_Z).to_num());
    detection.exposures = exposures;
    Ok(detection)
}
