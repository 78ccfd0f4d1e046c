//! The history of each pixel in a run.

use std::collections::VecDeque;

use dtof_core::events::Reflectivity;
use dtof_core::fixed::types::I24F8;
use dtof_core::{Array, BlockLevel, DepthEvent, PixelAddress};

use crate::events::events_csv::range_mm;
use crate::events::last_events::LastEvents;
use crate::options::rows::{Row, grouped};
use crate::photons::ranges::Ranges;
use crate::photons::source::Slice;

/// How many events the mean range averages (the paper's depth map of ten events).
pub const MEAN_OF: usize = 10;

/// Events that are up to so many bins apart are of one surface.
const SURFACE_BINS: i32 = 3;

/// The ranges of one pixel.
#[derive(Clone, Debug, Default)]
pub struct PixelHistory {
    /// Millimetres of the last event.
    last: Option<f64>,
    /// The last [`MEAN_OF`] events of `level`, or fewer, oldest first, and their ranges in millimetres.
    recent: VecDeque<(f64, DepthEvent)>,
    /// The finest level that has stood for the pixel.
    level: BlockLevel,
    /// How far apart events of one surface are at most, in millimetres.
    surface_mm: f64,
    /// The brightness of the surface, from the pixel's own events.
    reflectivity: Reflectivity,
    /// The number of events, including those of blocks that stand for the pixel.
    pub events: u64,
    /// When it last had an event, of its own or of a block.
    last_events: LastEvents,
    /// The number of photons, used or not.
    pub photons: u64,
}

impl PixelHistory {
    /// In the mean events of blocks never take the place of finer ones: those are of the pixel's own place.
    fn push(&mut self, event: &DepthEvent, range_mm: f64) {
        let level = event.level;
        self.last = Some(range_mm);
        if level < self.level {
            self.recent.clear();
        }
        if self.recent.is_empty() {
            self.level = level;
        }
        if level > self.level {
            return;
        }
        if self.recent.len() == MEAN_OF {
            self.recent.pop_front();
        }
        self.recent.push_back((range_mm, *event));
    }

    /// The range of the last event.
    #[must_use]
    pub const fn last_mm(&self) -> Option<f64> {
        self.last
    }

    /// The mean range of one surface: that on which most of up to [`MEAN_OF`] last events lie, of two with as
    /// many the newer. Events lie on a surface with one that is up to 3 bins away.
    #[must_use]
    pub fn mean_mm(&self) -> Option<f64> {
        Some(self.surface()?.0)
    }

    /// The same, and the newest event on that surface.
    #[must_use]
    pub fn surface(&self) -> Option<(f64, DepthEvent)> {
        let on_surface_of = |place: f64| {
            let all = self.recent.iter();
            all.filter(move |(range, _)| (range - place).abs() <= self.surface_mm)
        };
        let places = self.recent.iter().map(|(range, _)| *range);
        let place = places.max_by_key(|&place| on_surface_of(place).count())?;
        let (_, newest) = on_surface_of(place).next_back()?;
        let sum: f64 = on_surface_of(place).map(|(range, _)| range).sum();
        Some((sum / on_surface_of(place).count() as f64, *newest))
    }

    /// Events of blocks say nothing about the brightness of a pixel.
    fn has_own_events(&self) -> bool {
        self.reflectivity.events() > 0
    }

    /// The paper's relative reflectivity, events × range², at the mean range.
    #[must_use]
    pub fn reflectivity_of_events(&self) -> Option<f64> {
        self.has_own_events().then_some(())?;
        let range = I24F8::saturating_from_num(self.mean_mm()?);
        Some(self.reflectivity.of_events(range) as f64)
    }

    /// Relative reflectivity from the signal photons a laser cycle, × range², at the
    /// mean range.
    #[must_use]
    pub fn reflectivity_of_signal(&self) -> Option<f64> {
        self.has_own_events().then_some(())?;
        let range = I24F8::saturating_from_num(self.mean_mm()?);
        Some(self.reflectivity.of_signal(range).to_num())
    }
}

/// The histories of all pixels of an array.
#[derive(Clone, Debug)]
pub struct PixelHistories {
    /// The array.
    pub array: Array,
    /// One for each address.
    pub pixels: Vec<PixelHistory>,
}

impl PixelHistories {
    /// Starts without events.
    #[must_use]
    pub fn new(array: Array) -> Self {
        Self {
            array,
            pixels: vec![PixelHistory::default(); array.pixels() as usize],
        }
    }

    /// Adds an event. That of a block counts for the pixels for which it stands (see
    /// [`LastEvents`]).
    pub fn add(&mut self, event: &DepthEvent, ranges: &Ranges) {
        let range_mm = range_mm(event, ranges);
        let exposure = event.exposure.into();
        let surface_mm = ranges.scale().distance(SURFACE_BINS << 8).to_num();
        for address in self.array.pixels_of(event.pixel, event.level) {
            let pixel = &mut self.pixels[usize::from(address.raw())];
            let stands_for_pixel = pixel.last_events.record(event.level, event.cycle, exposure);
            if stands_for_pixel {
                pixel.surface_mm = surface_mm;
                pixel.push(event, range_mm);
                pixel.events += 1;
            }
            if event.level == BlockLevel::PIXEL {
                pixel.reflectivity.add(event);
            }
        }
    }

    /// Adds the photons of `pixels`. Addresses outside the array are ignored.
    pub fn count(&mut self, pixels: &[PixelAddress], slice: &Slice) {
        for (address, received) in pixels.iter().zip(&slice.pixels) {
            if let Some(pixel) = self.pixels.get_mut(usize::from(address.raw())) {
                pixel.photons += received.photons.len() as u64;
            }
        }
    }

    /// One row a pixel, for people: what to call a column and a row, and one event and several.
    #[must_use]
    pub fn rows(&self, [column, row]: [&str; 2], [one, several]: [&str; 2]) -> Vec<Row> {
        let columns = self.array.columns() as usize;
        let rows = self.pixels.iter().enumerate().map(|(at, pixel)| {
            let name = format!("{column} {}, {row} {}", at % columns, at / columns);
            let photons = format!("{} photons", grouped(pixel.photons));
            let (Some(last), Some(mean)) = (pixel.last_mm(), pixel.mean_mm()) else {
                return (name, format!("no {one}; {photons}"));
            };
            let [events, called] = match pixel.events {
                1 => ["1".to_owned(), one.to_owned()],
                events => [grouped(events), several.to_owned()],
            };
            let text = format!(
                "{events} {called}; range of the last {last:.1} mm, mean of up to {MEAN_OF} \
                 {mean:.1} mm; {photons}"
            );
            (name, text)
        });
        rows.collect()
    }

    /// Up to five pixels with events: the one with the most, the median, the one with the fewest,
    /// and the two halfway between. Of equal ones the lower address comes first.
    #[must_use]
    pub fn spread(&self) -> Vec<PixelAddress> {
        let all = (0..=u16::MAX).map(PixelAddress::new).zip(&self.pixels);
        let mut pixels: Vec<_> = all.filter(|(_, pixel)| pixel.events > 0).collect();
        pixels.sort_by_key(|(_, pixel)| std::cmp::Reverse(pixel.events));
        let Some(last) = pixels.len().checked_sub(1) else {
            return Vec::new();
        };
        let mut places: Vec<usize> = (0..=4).map(|quarter| last * quarter / 4).collect();
        places.dedup();
        places.into_iter().map(|place| pixels[place].0).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::events::fixtures;
    use crate::photons::source::{Photon, PixelPhotons};

    #[test]
    fn the_last_range_is_the_newest_and_the_mean_that_of_the_last_ten() {
        let mut pixel = PixelHistory::default();
        assert_eq!((pixel.last_mm(), pixel.mean_mm()), (None, None));
        pixel.surface_mm = 20.0;
        for range in 1..=12u32 {
            pixel.push(&fixtures::event(0, range.into(), 0), range.into());
        }
        assert_eq!(pixel.last_mm(), Some(12.0));
        assert_eq!(pixel.mean_mm(), Some(7.5)); // of 3 to 12
        assert_eq!(pixel.surface(), Some((7.5, fixtures::event(0, 12, 0))));
    }

    #[test]
    fn the_mean_is_of_one_surface() {
        let mut pixel = PixelHistory {
            surface_mm: 100.0,
            ..PixelHistory::default()
        };
        let mut mean_after = |range: f64| {
            pixel.push(&fixtures::event(0, 0, 0), range);
            pixel.mean_mm().unwrap()
        };
        assert_eq!(mean_after(1600.0), 1600.0);
        // Of two with as many the newer.
        assert_eq!(mean_after(4000.0), 4000.0);
        assert_eq!(mean_after(1620.0), 1610.0);
        assert_eq!(mean_after(4010.0), 4005.0);
        // Ten later a surface is forgotten.
        for _ in 0..7 {
            mean_after(2000.0);
        }
        assert_eq!(mean_after(2010.0), 2001.25);
    }

    #[test]
    fn a_block_stands_for_its_pixels_that_have_not_reported_since() {
        let mut histories = PixelHistories::new(Array::new(3, 3).unwrap());
        let ranges = fixtures::ranges();
        let of_block = |pixel, cycle, bin, level| DepthEvent {
            level: BlockLevel::new(level).unwrap(),
            ..fixtures::event(pixel, cycle, bin) // over 40 laser cycles
        };
        histories.add(&of_block(4, 100, 10, 0), &ranges);
        histories.add(&of_block(0, 140, 20, 1), &ranges); // from 101 on
        histories.add(&of_block(1, 150, 30, 0), &ranges);
        histories.add(&of_block(0, 189, 40, 2), &ranges); // from 150 on
        histories.add(&of_block(0, 190, 50, 1), &ranges); // from 151 on
        let last = histories.pixels.iter().map(|pixel| {
            let range = pixel.last_mm().unwrap();
            (range / 37.474 - 0.5).round()
        });
        assert!(last.eq([50.0, 50.0, 40.0, 50.0, 50.0, 40.0, 40.0, 40.0, 40.0]));
        // Pixels 1 and 4 have reported by themselves, and two others in a small block twice.
        let mean = histories.pixels.iter().map(|pixel| {
            let range = pixel.mean_mm().unwrap();
            (range / 37.474 - 0.5).round()
        });
        assert!(mean.eq([50.0, 30.0, 40.0, 50.0, 10.0, 40.0, 40.0, 40.0, 40.0]));
        let events = histories.pixels.iter().map(|pixel| pixel.events);
        assert!(events.eq([3, 3, 1, 3, 4, 1, 1, 1, 1]));
        let reporting = histories.pixels.iter().filter(|pixel| pixel.events > 0);
        assert_eq!(reporting.count(), 9);
    }

    #[test]
    fn photons_are_those_of_their_pixel() {
        let mut histories = PixelHistories::new(Array::new(3, 1).unwrap());
        let photon = Photon { cycle: 0, code: 5 };
        let received = |photons| PixelPhotons {
            cycles: 1,
            photons: vec![photon; photons],
        };
        let slice = Slice {
            first_cycle: 0,
            pixels: vec![received(2), received(7)],
        };
        for _ in 0..2 {
            histories.count(&[0, 2].map(PixelAddress::new), &slice);
        }
        let photons = histories.pixels.iter().map(|pixel| pixel.photons);
        assert!(photons.eq([4, 0, 14]));
    }

    #[test]
    fn a_row_says_what_is_known_of_a_pixel() {
        let mut histories = PixelHistories::new(Array::new(2, 2).unwrap());
        let at = |pixel, cycle, bin| fixtures::event(pixel, cycle, bin);
        for event in [at(3, 50, 10), at(3, 99, 12), at(0, 120, 10)] {
            histories.add(&event, &fixtures::ranges());
        }
        histories.pixels[3].photons = 12_345;
        let rows = histories.rows(["zone", "capture"], ["event", "events"]);
        let texts = rows.iter().map(|(name, text)| format!("{name}: {text}"));
        let bins = |bins: f64| bins * 37.474;
        let [last, mean] = [bins(12.5), bins(11.5)];
        let expected = format!(
            "zone 1, capture 1: 2 events; range of the last {last:.1} mm, mean of up to 10 \
             {mean:.1} mm; 12,345 photons"
        );
        let texts: Vec<String> = texts.collect();
        assert_eq!(texts[1], "zone 1, capture 0: no event; 0 photons");
        assert_eq!(texts[3], expected);
        assert!(texts[0].starts_with("zone 0, capture 0: 1 event; range"));
    }

    #[test]
    fn the_spread_goes_from_most_to_fewest_events() {
        let with = |events: &[u64]| {
            let mut histories =
                PixelHistories::new(Array::new(u32::try_from(events.len()).unwrap(), 1).unwrap());
            for (pixel, events) in histories.pixels.iter_mut().zip(events) {
                pixel.events = *events;
            }
            histories.spread()
        };
        assert_eq!(with(&[0, 0]), []);
        assert_eq!(with(&[0, 3]), [PixelAddress::new(1)]);
        assert_eq!(with(&[3, 3]), [0, 1].map(PixelAddress::new));
        assert_eq!(
            with(&[5, 0, 9, 1, 3, 7, 2, 8, 4, 6]),
            [2, 5, 0, 4, 3].map(PixelAddress::new)
        );
    }
}
