//! The bodies of messages: configuration, sensor, statistics.

use dtof_core::Statistics;
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_link::{Configuration, Refusal, Report, SensorRecord, Source};

use crate::array::{dtof_layout_t, layout_of};
use crate::config::{dtof_config_t, settings_of};
use crate::link::dtof_link_t;
use crate::memory::{array_mut, data_ref, data_slice, object_ref, put, status};
use crate::statistics::dtof_statistics_t;
use crate::status::dtof_status_t;
use crate::status::dtof_status_t::DTOF_ERROR_DITHER;
use crate::version::{DTOF_BINS, dtof_counter_bits};

/// Bytes of the body of SENSOR.
pub const DTOF_SENSOR_BYTES: usize = 24;
const _: () = assert!(DTOF_SENSOR_BYTES == SensorRecord::BYTES);
/// Bytes of the body of STATISTICS.
pub const DTOF_REPORT_BYTES: usize = 234;
const _: () = assert!(DTOF_REPORT_BYTES == Report::BYTES);

/// The largest range of a dither in bins.
const MOST_DITHER: u16 = 254;

/// Photons come over the link.
pub const DTOF_SOURCE_LINK: u8 = 0;
/// Photons come from the sensor.
pub const DTOF_SOURCE_SENSOR: u8 = 1;

/// The configuration that the host requests. Give `pixel` and `layout` to dtof_array_configure_layout, and compare
/// the other fields with your device. If your firmware has single pixels instead of an array, check `pixel` with
/// dtof_config_check, and refuse block_levels, neighbours and once_per_bin other than 0 with DTOF_ERROR_BLOCKS,
/// DTOF_ERROR_NEIGHBOURS and DTOF_ERROR_ONCE_PER_BIN. If your sensor gives histograms, refuse the last two.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct dtof_device_config_t {
    /// The settings of the pixels.
    pub pixel: dtof_config_t,
    /// The width of a bin, in 1/65536 ps, for dtof_scale_init.
    pub bin_width_ps_q16: u32,
    /// The offset added to every range, in 1/256 mm.
    pub offset_mm_q8: i32,
    /// The pixels, and how they work together.
    pub layout: dtof_layout_t,
    /// Switch the laser off after the host has been silent for this many milliseconds: 200 to
    /// 60,000. 0 means never: refuse it with DTOF_ERROR_HOST_TIMEOUT, unless your laser may run
    /// without a host.
    pub host_timeout_ms: u16,
    /// DTOF_SOURCE_...
    pub source: u8,
    /// The range S of the laser's dither, an even number of bins up to 254; 0 for none. Each laser cycle lasts
    /// P - S/2 + s bins, where P is the mean and s a random number from 0 to S. Refuse it with DTOF_ERROR_DITHER
    /// if it is more than your laser can.
    pub dither_bins: u16,
    /// The seed of the random numbers s. docs/link-format.md says how they are made, and has the first ones.
    pub dither_seed: u64,
}

/// Reads the body of CONFIGURE. Dynamic depth is refused, as this library has none. `sensor_dead_time` is
/// that of dtof_sensor_write. The settings get it if the host leaves the dead time to the sensor and the
/// rule can use it.
///
/// Errors: DTOF_ERROR_CONFIGURATION if the library does not know it, DTOF_ERROR_DITHER if its range is odd,
/// above 254 bins, or not 0 for photons of the link, DTOF_ERROR_MINIMUM_COUNT, DTOF_ERROR_WINDOW_WIDTH, DTOF_ERROR_HALF_WIDTH,
/// DTOF_ERROR_DEAD_TIME, DTOF_ERROR_PATIENCE, DTOF_ERROR_HOST_TIMEOUT,
/// DTOF_ERROR_RESERVED_FIELD, DTOF_ERROR_LENGTH, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// dtof_refusal_of gives the answer to the host for each.
/// Threads: no other thread uses `config` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_device_config_read(
    body: *const u8,
    length: usize,
    sensor_dead_time: u16,
    config: *mut dtof_device_config_t,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let body = unsafe { data_slice(body, length)? };
        let requested = Configuration::from_le_bytes(body)?;
        let range = requested.dither_bins;
        let is_of_sensor = requested.source == Source::Sensor;
        if range > MOST_DITHER || !range.is_multiple_of(2) || (range > 0 && !is_of_sensor) {
            return Err(DTOF_ERROR_DITHER);
        }
        if requested.dynamic_depth.is_some() {
            return Err(Refusal::Unknown.into());
        }
        #[allow(clippy::cast_possible_truncation, reason = "at most 256")]
        let dead_time = requested.dead_time_in_force(sensor_dead_time, DTOF_BINS as u16)?;
        let read = dtof_device_config_t {
            pixel: settings_of(&requested, dead_time),
            bin_width_ps_q16: requested.bin_width_ps.to_bits(),
            offset_mm_q8: requested.offset_mm.to_bits(),
            layout: layout_of(&requested),
            host_timeout_ms: requested.host_timeout_ms,
            source: match requested.source {
                Source::Link => DTOF_SOURCE_LINK,
                Source::Sensor => DTOF_SOURCE_SENSOR,
            },
            dither_bins: requested.dither_bins,
            dither_seed: requested.dither_seed,
        };
        // SAFETY: the same promise.
        unsafe { put(config, read) }
    })
}

/// Writes the body of SENSOR, DTOF_SENSOR_BYTES, which also has DTOF_COUNTER_BITS:
/// - `pixels`: pixels of the sensor, 0 without a sensor
/// - `bins`: bins that the sensor measures, up to DTOF_BINS
/// - `dead_time`: bins for which its TDC is blind after a photon; 65,535 if it takes only the first
///   photon of a laser cycle, 0 if there is none or it is unknown
/// - `most_dither`: the largest range of the laser's dither in bins, 0 if it cannot
/// - `bin_width_ps_q16`: 0 if the host sets the width
/// - `laser_millihertz`: 0 if unknown
/// - `offset_mm_q8`: the range of the start of bin 0
///
/// Errors: DTOF_ERROR_NULL.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_sensor_write(
    pixels: u16,
    bins: u16,
    dead_time: u16,
    most_dither: u8,
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
            dead_time,
            most_dither,
        };
        let sensor = (pixels > 0).then_some(&sensor);
        *body = SensorRecord::to_le_bytes(sensor, dtof_counter_bits());
        Ok(())
    })
}

/// The counts that a device keeps beside its statistics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct dtof_report_t {
    /// Laser cycles that have ended since the configuration.
    pub cycles: u64,
    /// Photons of pixels that the device does not have, or that it leaves out: both of dtof_losses_t.
    pub unaddressed: u64,
    /// Bytes lost before dtof_link_receive got them.
    pub overrun: u32,
    /// Messages that the device did not understand.
    pub unknown: u32,
    /// Errors of the sensor.
    pub sensor_errors: u32,
    /// Starts of the sensor, and with it the laser, since power-on.
    pub sensor_starts: u32,
    /// Stops of the sensor since power-on.
    pub sensor_stops: u32,
    /// The last error of the sensor, by its number in docs/link-format.md: 0 without an error.
    pub last_sensor_error: u8,
    /// Why the sensor stopped last: DTOF_STOP_...
    pub stop_reason: u8,
}

/// Writes the body of STATISTICS, DTOF_REPORT_BYTES. First send all waiting events: the host
/// compares the events in `statistics` and `blocks` with those it has received. `blocks` may be null.
/// Those of dtof_array_statistics have the photons of present exposures; for single pixels add them to
/// a copy, with dtof_pixel_add_photons.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `link`, `statistics` or `blocks` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_report_write(
    report: *const dtof_report_t,
    statistics: *const dtof_statistics_t,
    blocks: *const dtof_statistics_t,
    link: *const dtof_link_t,
    body: *mut u8,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (report, statistics) = unsafe { (data_ref(report)?, object_ref(statistics)?) };
        let blocks = if blocks.is_null() {
            &Statistics::new()
        } else {
            // SAFETY: the same promise.
            unsafe { object_ref(blocks)? }
        };
        // SAFETY: the same promise.
        let (link, body) = unsafe { (object_ref(link)?, array_mut::<_, DTOF_REPORT_BYTES>(body)?) };
        let record = Report {
            cycles: report.cycles,
            statistics: *statistics,
            blocks: *blocks,
            unaddressed: report.unaddressed,
            overrun: report.overrun,
            unknown: report.unknown,
            sensor_errors: report.sensor_errors,
            last_sensor_error: report.last_sensor_error,
            sensor_starts: report.sensor_starts,
            sensor_stops: report.sensor_stops,
            stop_reason: report.stop_reason,
            link: *link.endpoint.counters(),
        };
        for (place, byte) in body.iter_mut().zip(record.to_le_bytes()) {
            *place = byte;
        }
        Ok(())
    })
}
