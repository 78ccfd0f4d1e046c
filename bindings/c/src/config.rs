//! Settings, and the configuration built from them.

use core::mem::MaybeUninit;

use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::paper::Threshold;
use dtof_core::{
    AnyRule, AverageRule, CentredWindow, Count, DepthEstimator, EchoNumber, PaperRule, PixelConfig,
    RangeGate, WindowRule, z_for,
};
use dtof_link::Configuration;

use crate::memory::{data_ref, initialise, object, put, status};
use crate::status::dtof_status_t;
use crate::status::dtof_status_t::{
    DTOF_ERROR_ECHOES, DTOF_ERROR_ESTIMATOR, DTOF_ERROR_HALF_WIDTH, DTOF_ERROR_MINIMUM_COUNT,
    DTOF_ERROR_RULE, DTOF_ERROR_ZERO_X,
};
use crate::version::DTOF_BINS;

/// The paper's rule: the highest bin against the background and its square root.
pub const DTOF_RULE_PAPER: u8 = 0;
/// A window around the peak against all other photons: a CFAR test.
pub const DTOF_RULE_WINDOW: u8 = 1;
/// The paper's threshold over the average of all bins.
pub const DTOF_RULE_AVERAGE: u8 = 2;

/// The paper's depth: the centroid of three bins.
pub const DTOF_ESTIMATOR_CENTROID: u8 = 0;
/// The centroid of a window centred on the pulse.
pub const DTOF_ESTIMATOR_CENTRED_WINDOW: u8 = 1;

/// The settings of pixels. Fill them in with dtof_config_paper, change some, and check them with
/// dtof_config_check. Fields of a rule or estimator that is not selected are ignored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct dtof_config_t {
    /// The fewest photons in a reported peak (window rule: in its window): 1 to 16,777,215. The
    /// counters of pixels hold 1023.
    pub minimum_count: u32,
    /// Standard deviations above the background, in 1/256. For the rules paper and average.
    pub alpha_q8: u16,
    /// Standard deviations above the background, in 1/4096. For the window rule.
    pub z_q12: u16,
    /// Laser cycles between looks: at least 1.
    pub x: u16,
    /// The exposure that a decision must exceed, in laser cycles: at least X.
    pub l1: u16,
    /// The exposure at which a pixel starts over, in laser cycles: above L1, with a multiple of X
    /// strictly between the two.
    pub l2: u16,
    /// The first bin that may hold the peak.
    pub gate_first: u16,
    /// The last bin that may hold the peak: at least gate_first + 7, below DTOF_BINS.
    pub gate_last: u16,
    /// How far the centred window reaches before its centre, in 1/256 bin: 256 to 1024.
    pub before_q8: u16,
    /// How far the centred window reaches after its centre, in 1/256 bin: 256 to 1024.
    pub after_q8: u16,
    /// Bins for which the TDC is blind after a photon; 0: it never is. With DTOF_BINS or more, only
    /// the first photon of a laser cycle counts. The window rule weighs bins by it. The other rules
    /// take only 0 and DTOF_BINS or more, which sets DTOF_FLAG_PILE_UP at high rates.
    pub dead_time: u16,
    /// DTOF_RULE_...
    pub rule: u8,
    /// The window of the window rule, in bins: 1 to 7.
    pub window: u8,
    /// DTOF_ESTIMATOR_...
    pub estimator: u8,
    /// Not 0: pixels expect the next event at the bin of the last. Needs the window rule.
    pub tracking: u8,
    /// The last echo that a pixel reports in an exposure: 1 to 4.
    pub echoes: u8,
    /// Bins excluded to either side of a reported echo's peak: 0 to 255.
    pub peel_reach: u8,
    /// An exposure ends once it is this many times as long as at its last echo; 255: at L2.
    pub echo_wait: u8,
}

/// Bytes of a dtof_checked_config_t.
pub const DTOF_CHECKED_CONFIG_SIZE: usize = 136;
/// The same in words of 64 bits.
pub const DTOF_CHECKED_CONFIG_WORDS: usize = DTOF_CHECKED_CONFIG_SIZE / 8;
/// Its alignment.
pub const DTOF_CHECKED_CONFIG_ALIGN: usize = 8;

/// A checked configuration: dtof_config_check makes it. Other functions only read it, so any number
/// of threads may use it at once. It may be copied.
#[repr(C)]
pub struct dtof_checked_config_t {
    opaque: [MaybeUninit<u64>; DTOF_CHECKED_CONFIG_WORDS],
}

/// The configuration of this library's pixels.
pub(crate) type Config = PixelConfig<DTOF_BINS, AnyRule>;

object!(dtof_checked_config_t, Config, tag 0xd6,
    size DTOF_CHECKED_CONFIG_SIZE, align DTOF_CHECKED_CONFIG_ALIGN, unused_below 8);

/// Fills in the paper's settings: its rule with an alpha of 4 and at least 5 photons, its depth
/// estimator, X = 4, L1 = 40, L2 = 2000, all bins, no dead time, one echo. The window rule gets
/// z = 4.504, with which one in 100 exposures of 128 bins has a false alarm, and a window of 3 bins, and the
/// centred window 2.5 bins to either side.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// Threads: no other thread uses `config` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_config_paper(config: *mut dtof_config_t) -> dtof_status_t {
    #[allow(clippy::cast_possible_truncation, reason = "at most 256")]
    let settings = dtof_config_t {
        minimum_count: 5,
        alpha_q8: const { U8F8::lit("4").to_bits() },
        z_q12: const { U4F12::lit("4.504").to_bits() },
        x: Configuration::DEFAULT.x,
        l1: Configuration::DEFAULT.l1,
        l2: Configuration::DEFAULT.l2,
        gate_first: 0,
        gate_last: DTOF_BINS as u16 - 1,
        before_q8: const { U8F8::lit("2.5").to_bits() },
        after_q8: const { U8F8::lit("2.5").to_bits() },
        dead_time: 0,
        rule: DTOF_RULE_PAPER,
        window: 3,
        estimator: DTOF_ESTIMATOR_CENTROID,
        tracking: 0,
        echoes: 1,
        peel_reach: 0,
        echo_wait: Configuration::DEFAULT.echo_wait,
    };
    // SAFETY: the caller's promise, see the crate.
    status(|| unsafe { put(config, settings) })
}

/// Fits the window rule's width and the centred window to a pulse with a standard deviation of
/// `sigma_q8`, in 1/256 bin, best 0.4 to 1.75 bins. It does not select the rule or the estimator.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// Threads: no other thread uses `config` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_config_for_pulse(
    config: *mut dtof_config_t,
    sigma_q8: u16,
) -> dtof_status_t {
    status(|| {
        let sigma = U8F8::from_bits(sigma_q8);
        let window = CentredWindow::for_pulse(sigma);
        // SAFETY: the caller's promise, see the crate.
        let settings = *unsafe { data_ref(config)? };
        let settings = dtof_config_t {
            window: WindowRule::width_for_pulse(sigma),
            before_q8: window.before().to_bits(),
            after_q8: window.after().to_bits(),
            ..settings
        };
        // SAFETY: the same promise.
        unsafe { put(config, settings) }
    })
}

/// Sets the window rule's z for one false alarm in `one_in` exposures without a target: 100 for
/// 1 %. z depends on the gate, X, L1 and L2 of `config`, so set these before. z is 2.15 to 6.44. It is for
/// pixels alone or with neighbours; blocks of pixels need a higher one: see dtof_array_configure_layout.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_ZERO_X,
/// DTOF_ERROR_GATE_PAST_LAST_BIN, DTOF_ERROR_GATE_TOO_NARROW.
/// Threads: no other thread uses `config` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_config_false_alarms(
    config: *mut dtof_config_t,
    one_in: u32,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let settings = *unsafe { data_ref(config)? };
        if settings.x == 0 {
            return Err(DTOF_ERROR_ZERO_X);
        }
        let gate = RangeGate::<DTOF_BINS>::new(settings.gate_first, settings.gate_last)?;
        let z = z_for(one_in, &gate, settings.x, settings.l1, settings.l2);
        let z_q12 = z.to_bits();
        // SAFETY: the same promise.
        unsafe { put(config, dtof_config_t { z_q12, ..settings }) }
    })
}

/// Checks settings and builds the configuration from them.
///
/// Errors: each of DTOF_ERROR_RULE to DTOF_ERROR_DEAD_TIME, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// After an error `checked` is unchanged.
/// Threads: no other thread uses `checked` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_config_check(
    config: *const dtof_config_t,
    checked: *mut dtof_checked_config_t,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let settings = unsafe { data_ref(config)? };
        let config = alone(settings)?;
        // SAFETY: the same promise.
        unsafe { initialise(checked, DTOF_CHECKED_CONFIG_SIZE, config) }
    })
}

/// The settings of pixels that decide alone, as a host would ask for them.
#[allow(
    clippy::inline_always,
    reason = "300 bytes less in a program of lone pixels"
)]
#[inline(always)]
pub(crate) fn requested(settings: &dtof_config_t) -> Result<Configuration, dtof_status_t> {
    let count = Count::new(settings.minimum_count).filter(|count| count.raw() > 0);
    let count = count.ok_or(DTOF_ERROR_MINIMUM_COUNT)?;
    let alpha = U8F8::from_bits(settings.alpha_q8);
    let rule = match settings.rule {
        DTOF_RULE_PAPER => PaperRule::new(alpha, count).into(),
        DTOF_RULE_AVERAGE => AverageRule::new(alpha, count).into(),
        DTOF_RULE_WINDOW => {
            let z = U4F12::from_bits(settings.z_q12);
            WindowRule::new(settings.window, z, count)?.into()
        }
        _ => return Err(DTOF_ERROR_RULE),
    };
    let estimator = match settings.estimator {
        DTOF_ESTIMATOR_CENTROID => DepthEstimator::Centroid3,
        DTOF_ESTIMATOR_CENTRED_WINDOW => {
            let [before, after] = [settings.before_q8, settings.after_q8].map(U8F8::from_bits);
            let window = CentredWindow::with_sides(before, after);
            DepthEstimator::CentredWindow(window.ok_or(DTOF_ERROR_HALF_WIDTH)?)
        }
        _ => return Err(DTOF_ERROR_ESTIMATOR),
    };
    Ok(Configuration {
        rule,
        estimator,
        x: settings.x,
        l1: settings.l1,
        l2: settings.l2,
        gate: (settings.gate_first, settings.gate_last),
        dead_time: Some(settings.dead_time),
        tracking: settings.tracking != 0,
        echoes: EchoNumber::new(settings.echoes).ok_or(DTOF_ERROR_ECHOES)?,
        echo_guard_bins: settings.peel_reach,
        echo_wait: settings.echo_wait,
        ..Configuration::DEFAULT
    })
}

/// The settings of the pixels in a configuration.
pub(crate) fn settings_of(requested: &Configuration, dead_time: u16) -> dtof_config_t {
    let mut settings = dtof_config_t {
        x: requested.x,
        l1: requested.l1,
        l2: requested.l2,
        gate_first: requested.gate.0,
        gate_last: requested.gate.1,
        estimator: DTOF_ESTIMATOR_CENTROID,
        dead_time,
        tracking: requested.tracking.into(),
        echoes: requested.echoes.raw(),
        peel_reach: requested.echo_guard_bins,
        echo_wait: requested.echo_wait,
        ..dtof_config_t::default()
    };
    let mut with_alpha = |rule, threshold: &Threshold| {
        settings.rule = rule;
        settings.alpha_q8 = threshold.alpha().to_bits();
        settings.minimum_count = threshold.minimum_count().raw();
    };
    match &requested.rule {
        AnyRule::Paper(rule) => with_alpha(DTOF_RULE_PAPER, rule.threshold()),
        AnyRule::Average(rule) => with_alpha(DTOF_RULE_AVERAGE, rule.threshold()),
        AnyRule::Window(rule) => {
            settings.rule = DTOF_RULE_WINDOW;
            settings.window = rule.width();
            settings.z_q12 = rule.z().to_bits();
            settings.minimum_count = rule.minimum_count().raw();
        }
    }
    if let DepthEstimator::CentredWindow(window) = &requested.estimator {
        settings.estimator = DTOF_ESTIMATOR_CENTRED_WINDOW;
        settings.before_q8 = window.before().to_bits();
        settings.after_q8 = window.after().to_bits();
    }
    settings
}

/// The configuration of pixels that decide alone.
pub(crate) fn alone(settings: &dtof_config_t) -> Result<Config, dtof_status_t> {
    Ok(requested(settings)?.lone_config(0)?)
}
