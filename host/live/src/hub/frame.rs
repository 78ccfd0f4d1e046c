//! A frame: the line of JSON that a page is sent ten times a second.
//!
//! Tables are records of little-endian numbers in base64: see [`PIXEL`] and [`EVENT`].

use std::fmt::Write;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde_json::json;

use super::pages::{Page, Waiting};
use super::pixels::PixelState;
use super::{Kind, State};
use dtof_data::events::aer_file::Event;
use dtof_device::PixelHistogram;
use dtof_engine::explain::Explanation;
use dtof_engine::settings::SensorSettings;

/// Most pixels in a frame. The others follow in the next.
pub const MOST_PIXELS: usize = 4096;

/// Bytes of a pixel: its number (2), level and echo (1), flags (1), events (4), range in
/// millimetres, relative reflectivity, photons of the peak (floats of 4). The last two are NaN if
/// the pixel has had changes of depth only, as these do not measure light.
const PIXEL: usize = 20;
/// Bytes of an event: laser cycle (8), range, photons of the peak (floats of 4), exposure (2),
/// level and echo (1), flags (1), background (a float of 4). Of a change of depth, photons and
/// background are NaN, and the exposure is meaningless.
const EVENT: usize = 24;

impl State {
    /// The changes since the last frame of `page`.
    pub(super) fn frame(&mut self, page: &mut Page) -> String {
        page.frames += 1;
        let rate = self.rate();
        let mut frame = json!({
            "frame": page.frames,
            "connection": self.connection,
            "events": self.events,
            "masked": self.masked,
            "rate": rate,
            "losses": self.losses,
            "recorded": self.recording,
            "playhead": self.playhead,
        });
        if page.version != self.version {
            page.version = self.version;
            page.pixels = vec![0; self.pixels.len()];
            page.next = 0;
            page.arrived = self.events;
            frame["source"] = self.source(page);
        }
        let (pixels, drawn, left) = self.changed(page);
        frame["pixels"] = pixels.into();
        frame["drawn"] = json!({
            "pixels": drawn,
            "left": left,
            "events": self.events - page.arrived,
        });
        page.arrived = self.events;
        let (pixel, waiting, arrived) = self.pages.take(page);
        frame["pixel"] = json!({
            "number": pixel,
            "events": BASE64.encode(events(&waiting)),
            "drawn": waiting.len(),
            "arrived": arrived,
        });
        let mut text = frame.to_string();
        let mut new = self
            .histograms
            .iter()
            .filter(|new| new.number > page.histogram);
        if let Some(new) = new.find(|new| new.pixel == pixel) {
            page.histogram = new.number;
            text.pop();
            // Writing into a String does not fail.
            let _ = write!(text, ",\"histogram\":{}}}", new.json);
        }
        text
    }

    /// Name, array and settings of the source.
    fn source(&self, page: &Page) -> serde_json::Value {
        let header = self.header.as_ref();
        let bins = header.map_or(0, |header| header.bins);
        let mut source = json!({
            "page": page.number,
            "name": self.name,
            "kind": self.kind,
            "columns": header.map_or(0, |header| header.array.columns()),
            "rows": header.map_or(0, |header| header.array.rows()),
            "bins": bins,
            "binWidthPs": header.map_or(0.0, |header| header.bin_width_ps.to_num()),
            "offsetMm": header.map_or(0.0, |header| header.offset_mm.to_num()),
            "laserHz": header.map_or(0.0, |header| header.laser_millihertz as f64 / 1000.0),
        });
        if self.kind == Kind::Device {
            let (file, gate, requested) = match &self.settings {
                Some((file, settings)) => {
                    let gate = Some(settings.configuration.gate);
                    let requested = file.sensor.dead_time;
                    (&file.with_settings(settings), gate, requested)
                }
                None => {
                    let sensor = &self.requested.sensor;
                    (&self.requested, sensor.gate, sensor.dead_time)
                }
            };
            // The dead time that is requested, so that the form does not take the sensor's as requested.
            let used = self.settings.as_ref().map(|(_, settings)| {
                json!([settings.dead_time(), settings.is_dead_time_of_sensor])
            });
            source["deadTime"] = json!(used);
            let dither = self.settings.as_ref();
            source["ditherBins"] =
                json!(dither.map(|(_, settings)| settings.configuration.dither_bins));
            let sensor = SensorSettings {
                dead_time: requested,
                ..file.sensor.clone()
            };
            source["settings"] = json!({
                "sensor": sensor,
                "detection": file.detection,
                "gate": gate,
            });
        }
        source
    }

    /// Records of pixels that have changed since the page was sent them; their number, and how many
    /// are left for the next frame. Pixels take turns.
    fn changed(&self, page: &mut Page) -> (String, usize, usize) {
        let all = self.pixels.all();
        let mut records = Vec::new();
        let (mut drawn, mut left) = (0, 0);
        let start = page.next.min(all.len());
        let in_turn = (start..all.len()).chain(0..start);
        for number in in_turn {
            let pixel = &all[number];
            if pixel.changed <= page.pixels[number] {
                continue;
            }
            if drawn == MOST_PIXELS {
                if left == 0 {
                    page.next = number;
                }
                left += 1;
                continue;
            }
            page.pixels[number] = pixel.changed;
            record(&mut records, number, pixel);
            drawn += 1;
        }
        (BASE64.encode(records), drawn, left)
    }
}

#[allow(clippy::cast_possible_truncation, reason = "at most 65,536 pixels")]
fn record(records: &mut Vec<u8>, number: usize, pixel: &PixelState) {
    let before = records.len();
    records.extend((number as u16).to_le_bytes());
    records.extend([pixel.level_echo, pixel.flags]);
    records.extend(pixel.count.to_le_bytes());
    records.extend(pixel.range_mm.to_le_bytes());
    // No event is reported of a peak of 0 photons.
    let (reflectivity, peak) = match pixel.peak {
        0 => (f32::NAN, f32::NAN),
        peak => (pixel.reflectivity, peak as f32),
    };
    records.extend(reflectivity.to_le_bytes());
    records.extend(peak.to_le_bytes());
    debug_assert_eq!(records.len(), before + PIXEL);
}

fn events(waiting: &[Waiting]) -> Vec<u8> {
    let mut records = Vec::with_capacity(waiting.len() * EVENT);
    for Waiting { event, range_mm } in waiting {
        let (peak, exposure, background) = match event {
            Event::Depth(event) => (
                event.peak_count.raw() as f32,
                event.exposure,
                event.background.raw() as f32,
            ),
            Event::DynamicDepth(_) => (f32::NAN, 0, f32::NAN),
        };
        records.extend(event.cycle().raw().to_le_bytes());
        records.extend(range_mm.to_le_bytes());
        records.extend(peak.to_le_bytes());
        records.extend(exposure.to_le_bytes());
        records.push(event.level().raw() << 4 | event.echo().raw());
        records.push(event.flags().bits());
        records.extend(background.to_le_bytes());
    }
    records
}

/// A histogram, and the rule's decision on it.
pub(super) fn histogram(histogram: &PixelHistogram, look: Option<&Explanation>) -> String {
    let counts = histogram
        .counts
        .iter()
        .flat_map(|count| count.to_le_bytes());
    json!({
        "pixel": histogram.head.pixel.raw(),
        "cycle": histogram.head.cycle.raw(),
        "exposure": histogram.head.exposure,
        "whole": histogram.head.is_whole,
        "counts": BASE64.encode(counts.collect::<Vec<u8>>()),
        "look": look,
    })
    .to_string()
}

/// The reason why a pixel has no histogram.
pub(super) fn no_histogram(pixel: u16, reason: &str) -> String {
    json!({ "pixel": pixel, "none": reason }).to_string()
}
