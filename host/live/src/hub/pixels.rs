//! The last event of each pixel, and its number of events.

use dtof_core::{Array, EchoNumber};

use dtof_data::events::aer_file::Event;
use dtof_data::events::last_events::LastEvents;

/// The running mean of the signal covers about so many events.
const MEAN_OF: f32 = 8.0;

/// State of a pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelState {
    /// Range in millimetres of its last event, or of its block's.
    pub range_mm: f32,
    /// Photons of the peak.
    pub peak: u32,
    /// Signal photons a laser cycle × range² in m²: the relative reflectivity, a running mean.
    pub reflectivity: f32,
    /// Events so far.
    pub count: u32,
    /// Level in the upper four bits, echo in the lower.
    pub level_echo: u8,
    /// Flags.
    pub flags: u8,
    /// Number of its last change; 0 before the first.
    pub changed: u64,
    last_events: LastEvents,
}

/// All pixels of an array.
#[derive(Debug, Default)]
pub struct Pixels {
    all: Vec<PixelState>,
    changes: u64,
}

impl Pixels {
    pub fn new(array: Array) -> Self {
        Self {
            // An array has at most 65,536 pixels.
            all: vec![PixelState::default(); array.pixels() as usize],
            changes: 0,
        }
    }

    pub fn len(&self) -> usize {
        self.all.len()
    }

    pub fn all(&self) -> &[PixelState] {
        &self.all
    }

    /// The number of the last change.
    #[cfg(feature = "foxglove")]
    pub fn changes(&self) -> u64 {
        self.changes
    }

    /// Adds an event. The first of several echoes is kept; all are counted.
    pub fn add(&mut self, event: &Event, range_mm: f32, array: Array) {
        self.changes += 1;
        for pixel in array.pixels_of(event.pixel(), event.level()) {
            let Some(pixel) = self.all.get_mut(usize::from(pixel.raw())) else {
                continue;
            };
            if event.echo() > EchoNumber::FIRST {
                pixel.count = pixel.count.wrapping_add(1);
                pixel.changed = self.changes;
                continue;
            }
            if !pixel.last_events.record_event(event) {
                continue;
            }
            if let Event::Depth(event) = event {
                let signal = event
                    .peak_count
                    .raw()
                    .saturating_sub(event.background.raw());
                let metres = range_mm / 1000.0;
                let new = signal as f32 / f32::from(event.exposure.max(1)) * metres * metres;
                let weight = if pixel.count == 0 { 1.0 } else { 1.0 / MEAN_OF };
                pixel.reflectivity += (new - pixel.reflectivity) * weight;
                pixel.peak = event.peak_count.raw();
            }
            pixel.range_mm = range_mm;
            pixel.count = pixel.count.wrapping_add(1);
            pixel.level_echo = event.level().raw() << 4 | event.echo().raw();
            pixel.flags = event.flags().bits();
            pixel.changed = self.changes;
        }
    }
}
