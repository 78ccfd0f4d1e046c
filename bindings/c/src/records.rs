//! The bodies of messages: configuration, sensor, statistics.

use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{AnyRule, DepthEstimator, Threshold};
use dtof_link::{Configuration, Refusal, Report, SensorRecord, Source};

use crate::config::{
    DTOF_ESTIMATOR_CENTRED_WINDOW, DTOF_ESTIMATOR_CENTROID, DTOF_RULE_AVERAGE, DTOF_RULE_PAPER,
    DTOF_RULE_WINDOW, dtof_config_t,
};
use crate::link::dtof_link_t;
use crate::memory::{all_plain, array_mut, plain, put, shared, status, tagged};
use crate::statistics::dtof_statistics_t;
use crate::status::dtof_status_t;
use crate::status::dtof_status_t::DTOF_ERROR_BLOCKS;

/// Bytes of the body of SENSOR.
pub const DTOF_SENSOR_BYTES: usize = 24;
const _: () = assert!(DTOF_SENSOR_BYTES == SensorRecord::BYTES);
/// Bytes of the body of STATISTICS.
pub const DTOF_REPORT_BYTES: usize = 210;
const _: () = assert!(DTOF_REPORT_BYTES == Report::BYTES);

/// Photons come over the link.
pub const DTOF_SOURCE_LINK: u8 = 0;
/// Photons come from the sensor.
pub const DTOF_SOURCE_SENSOR: u8 = 1;

/// What the host wants. Check `pixel` with dtof_config_check, and the rest against what your
/// device has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct dtof_device_config_t {
    /// How pixels are to operate.
    pub pixel: dtof_config_t,
    /// The width of a bin, in 1/65536 ps, for dtof_scale_init.
    pub bin_width_ps_q16: u32,
    /// Millimetres added to every range, in 1/256 mm.
    pub offset_mm_q8: i32,
    /// Pixels, with addresses from 0.
    pub pixels: u16,
    /// The laser goes off once the host has been silent for so many milliseconds: 200 to 60,000.
    /// 0 means never. Refuse that with DTOF_ERROR_HOST_TIMEOUT, unless your laser may run
    /// without a host.
    pub host_timeout_ms: u16,
    /// DTOF_SOURCE_...
    pub source: u8,
}

/// Reads the body of CONFIGURE. What this library does not have is refused: blocks of pixels
/// and dynamic depth.
///
/// Errors: DTOF_ERROR_CONFIGURATION if it is not one this library knows, DTOF_ERROR_BLOCKS,
/// DTOF_ERROR_MINIMUM_COUNT, DTOF_ERROR_WINDOW_WIDTH, DTOF_ERROR_HALF_WIDTH,
/// DTOF_ERROR_PATIENCE, DTOF_ERROR_HOST_TIMEOUT, DTOF_ERROR_RESERVED_FIELD, DTOF_ERROR_LENGTH,
/// DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT. dtof_refusal_of makes each the answer to the host.
/// Threads: nobody else uses `config` meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_device_config_read(
    body: *const u8,
    length: usize,
    config: *mut dtof_device_config_t,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let body = unsafe { all_plain(body, length)? };
        let wanted = Configuration::from_le_bytes(body)?;
        if wanted.binning.is_some() {
            return Err(DTOF_ERROR_BLOCKS);
        }
        if wanted.dynamic_depth.is_some() {
            return Err(Refusal::Unknown.into());
        }
        let read = dtof_device_config_t {
            pixel: settings_of(&wanted),
            bin_width_ps_q16: wanted.bin_width_ps.to_bits(),
            offset_mm_q8: wanted.offset_mm.to_bits(),
            pixels: wanted.pixels,
            host_timeout_ms: wanted.host_timeout_ms,
            source: match wanted.source {
                Source::Link => DTOF_SOURCE_LINK,
                Source::Sensor => DTOF_SOURCE_SENSOR,
            },
        };
        // SAFETY: the same promise.
        unsafe { put(config, read) }
    })
}

/// The settings of pixels that the host wants.
fn settings_of(wanted: &Configuration) -> dtof_config_t {
    let mut settings = dtof_config_t {
        x: wanted.x,
        l1: wanted.l1,
        l2: wanted.l2,
        gate_first: wanted.gate.0,
        gate_last: wanted.gate.1,
        estimator: DTOF_ESTIMATOR_CENTROID,
        one_hit_tdc: wanted.one_hit_tdc.into(),
        tracking: wanted.tracking.into(),
        echoes: wanted.echoes.raw(),
        peel_reach: wanted.peel_reach,
        echo_wait: wanted.echo_wait,
        ..dtof_config_t::default()
    };
    let mut with_alpha = |rule, threshold: &Threshold| {
        settings.rule = rule;
        settings.alpha_q8 = threshold.alpha().to_bits();
        settings.minimum_count = threshold.minimum_count().raw();
    };
    match &wanted.rule {
        AnyRule::Paper(rule) => with_alpha(DTOF_RULE_PAPER, rule.threshold()),
        AnyRule::Average(rule) => with_alpha(DTOF_RULE_AVERAGE, rule.threshold()),
        AnyRule::Window(rule) => {
            settings.rule = DTOF_RULE_WINDOW;
            settings.window = rule.width();
            settings.z_q12 = rule.z().to_bits();
            settings.minimum_count = rule.minimum_count().raw();
        }
    }
    if let DepthEstimator::CentredWindow(window) = &wanted.estimator {
        settings.estimator = DTOF_ESTIMATOR_CENTRED_WINDOW;
        settings.before_q8 = window.before().to_bits();
        settings.after_q8 = window.after().to_bits();
    }
    settings
}

/// Writes the body of SENSOR, DTOF_SENSOR_BYTES: the pixels of the sensor, 0 if there is none; how
/// many bins it measures, up to DTOF_BINS; the width of its bins in 1/65536 ps, 0 if as wide as the
/// host says; laser cycles a second in thousandths, 0 if not known; the range of the start of bin 0
/// in 1/256 mm.
///
/// Errors: DTOF_ERROR_NULL.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_sensor_write(
    pixels: u16,
    bins: u16,
    bin_width_ps_q16: u32,
    laser_millihertz: u64,
    offset_mm_q8: i32,
    body: *mut u8,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let body = unsafe { array_mut(body)? };
        let sensor = SensorRecord {
            pixels,
            bin_width: (bin_width_ps_q16 > 0).then_some(U16F16::from_bits(bin_width_ps_q16)),
            offset: I24F8::from_bits(offset_mm_q8),
            laser_millihertz,
            bins,
        };
        *body = SensorRecord::to_le_bytes((pixels > 0).then_some(&sensor));
        Ok(())
    })
}

/// What a device counts beside its pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct dtof_report_t {
    /// Laser cycles that have ended since the configuration.
    pub cycles: u64,
    /// Photons of pixels that the device does not have.
    pub unaddressed: u64,
    /// Bytes that were lost before dtof_link_receive got them.
    pub overrun: u32,
    /// Messages that were not understood.
    pub unknown: u32,
    /// Errors of the sensor.
    pub sensor_errors: u32,
    /// How often the sensor, and with it the laser, was started since the device was switched on.
    pub sensor_starts: u32,
    /// How often it was stopped.
    pub sensor_stops: u32,
    /// The last of its errors, as docs/link-format.md numbers them: 0 if there was none.
    pub last_sensor_error: u8,
    /// Why it stopped last: DTOF_STOP_...
    pub stop_reason: u8,
}

/// Writes the body of STATISTICS, DTOF_REPORT_BYTES. Of `statistics` the events must be those
/// that were sent before, so send all that wait first. Add the photons of present exposures with
/// dtof_pixel_add_photons to a copy.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED (of `link`).
/// Threads: nobody else uses `link` or `statistics` meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_report_write(
    report: *const dtof_report_t,
    statistics: *const dtof_statistics_t,
    link: *const dtof_link_t,
    body: *mut u8,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (report, statistics) = unsafe { (plain(report)?, shared(statistics)?) };
        // SAFETY: the same promise.
        let (link, body) = unsafe { (tagged(link)?, array_mut::<_, DTOF_REPORT_BYTES>(body)?) };
        let record = Report {
            cycles: report.cycles,
            statistics: *statistics,
            unaddressed: report.unaddressed,
            overrun: report.overrun,
            unknown: report.unknown,
            sensor_errors: report.sensor_errors,
            last_sensor_error: report.last_sensor_error,
            sensor_starts: report.sensor_starts,
            sensor_stops: report.sensor_stops,
            stop_reason: report.stop_reason,
            link: *link.endpoint.counters(),
            ..Report::default()
        };
        for (place, byte) in body.iter_mut().zip(record.to_le_bytes()) {
            *place = byte;
        }
        Ok(())
    })
}
