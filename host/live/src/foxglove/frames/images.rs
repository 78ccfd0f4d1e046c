//! Maps as images: a number for each pixel, or NaN.

use std::time::{Duration, Instant};

use anyhow::Result;
use dtof_core::Array;
use foxglove::messages::RawImage;

use crate::foxglove::topics::Topic;
use crate::hub::PixelState;
use dtof_run::export::foxglove::{FRAME, Time, encoded};

/// Rates are measured over this time.
const RATE: Duration = Duration::from_secs(1);

/// Values of all pixels.
#[derive(Default)]
pub struct Images {
    array: Option<Array>,
    pixels: Vec<PixelState>,
    change: Option<u64>,
    /// Events of each pixel at the start of the second, and its time.
    counts: Option<(Vec<u32>, Instant)>,
    /// Events a second of each pixel.
    rates: Vec<f32>,
    has_new_rates: bool,
}

impl Images {
    /// Images of an array, if there is one, without events.
    pub fn of(array: Option<Array>) -> Self {
        Self {
            array,
            ..Self::default()
        }
    }

    /// Number of the last change, or a number that no change has.
    pub fn change(&self) -> u64 {
        self.change.unwrap_or(u64::MAX)
    }

    /// Updates the pixels, if there are new ones, and the rates. Returns whether there are new pixels.
    pub fn update(&mut self, new: Option<&(Vec<PixelState>, u64)>, has_subscriber: bool) -> bool {
        if !has_subscriber {
            // Rates need counts of a whole second.
            (self.counts, self.has_new_rates) = (None, false);
            return false;
        }
        if let Some((pixels, change)) = new {
            self.pixels.clone_from(pixels);
            self.change = Some(*change);
        }
        self.has_new_rates = false;
        let counts = || self.pixels.iter().map(|pixel| pixel.count);
        match &self.counts {
            // The array has changed.
            Some((before, _)) if before.len() != self.pixels.len() => self.counts = None,
            Some((before, since)) if since.elapsed() >= RATE => {
                let elapsed = since.elapsed().as_secs_f32();
                let events = counts().zip(before);
                let events = events.map(|(now, before)| now.wrapping_sub(*before) as f32);
                self.rates = events.map(|events| events / elapsed).collect();
                self.has_new_rates = true;
                self.counts = Some((counts().collect(), Instant::now()));
            }
            Some(_) => {}
            None => self.counts = Some((counts().collect(), Instant::now())),
        }
        new.is_some()
    }

    /// Returns whether the last update has measured rates.
    pub fn has_new_rates(&self) -> bool {
        self.has_new_rates
    }

    /// The image of a topic, if there is an array.
    ///
    /// # Errors
    /// Fails if it cannot be encoded.
    pub fn message(&self, topic: Topic, time: u64) -> Result<Option<Vec<u8>>> {
        let Some(array) = self.array.filter(|_| !self.pixels.is_empty()) else {
            return Ok(None);
        };
        let (width, height) = (array.columns(), array.rows());
        let value = |(number, pixel): (usize, &PixelState)| match topic {
            Topic::Rate => self.rates.get(number).copied().unwrap_or(f32::NAN),
            // No event yet.
            _ if pixel.level_echo == 0 => f32::NAN,
            Topic::Range => pixel.range_mm / 1000.0,
            // Changes of depth do not measure light. Depth events have a peak above 0.
            _ if pixel.peak == 0 => f32::NAN,
            _ => pixel.reflectivity,
        };
        let values = self.pixels.iter().enumerate().map(value);
        let data: Vec<u8> = values.flat_map(f32::to_le_bytes).collect();
        let image = RawImage {
            timestamp: Time::from_nanoseconds(time).stamp(),
            frame_id: FRAME.to_owned(),
            width,
            height,
            encoding: "32FC1".to_owned(),
            step: 4 * width,
            data: data.into(),
        };
        encoded(&image).map(Some)
    }
}
