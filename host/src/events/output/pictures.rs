//! The maps of a run as pictures.

use anyhow::Result;

use crate::events::maps::{Maps, PixelHistory};
use crate::input::source::Geometry;
use crate::picture::{Map, heat_map};

/// The files, in the order of [`pictures`].
pub const NAMES: [&str; 6] = [
    "depth-last.svg",
    "depth-mean.svg",
    "event-counts.svg",
    "event-rate.svg",
    "reflectivity-events.svg",
    "reflectivity-signal.svg",
];

/// A picture and the file it becomes.
pub struct Picture {
    pub name: &'static str,
    pub svg: String,
    pub caption: &'static str,
}

/// The maps of a run of `cycles` laser cycles, on an array with these `sides`.
#[allow(clippy::cast_precision_loss, reason = "a picture")]
pub fn pictures(maps: &Maps, sides: [&str; 2], cycles: u64) -> Result<[Picture; 6]> {
    let draw = |name, title, unit, caption, values: Vec<Option<f64>>| -> Result<Picture> {
        let Geometry { columns, rows } = maps.geometry;
        let svg = heat_map(&Map {
            title,
            unit,
            sides,
            columns: columns as usize,
            rows: rows as usize,
            values: &values,
        })?;
        Ok(Picture { name, svg, caption })
    };
    let all = |value: &dyn Fn(&PixelHistory) -> Option<f64>| -> Vec<Option<f64>> {
        maps.pixels.iter().map(value).collect()
    };
    let thousands = (cycles as f64 / 1000.0).max(f64::MIN_POSITIVE);
    Ok([
        draw(
            "depth-last.svg",
            "Range, last event",
            "mm",
            "The range of the last event of each pixel.",
            all(&PixelHistory::last_mm),
        )?,
        draw(
            "depth-mean.svg",
            "Range, mean of the last ten events",
            "mm",
            "The mean range of the last ten events of each pixel, or of as many as it has.",
            all(&PixelHistory::mean_mm),
        )?,
        draw(
            "event-counts.svg",
            "Events",
            "events",
            "How many events each pixel reported. Near and bright surfaces report more often.",
            all(&|pixel| Some(pixel.events as f64)),
        )?,
        draw(
            "event-rate.svg",
            "Events per 1000 laser cycles",
            "events",
            "Events of each pixel per 1000 laser cycles of the run. A pixel that looks until L1 \
             before it decides cannot report more often than once in L1.",
            all(&|pixel| Some(pixel.events as f64 / thousands)),
        )?,
        draw(
            "reflectivity-events.svg",
            "Reflectivity from the number of events",
            "of the most",
            "Relative reflectivity as the paper has it: events × range². All bright surfaces \
             report once in L1 and count alike.",
            relative(all(&PixelHistory::reflectivity_of_events)),
        )?,
        draw(
            "reflectivity-signal.svg",
            "Reflectivity from the signal",
            "of the most",
            "Relative reflectivity from what the events say: signal photons a laser cycle × \
             range², over all events of the pixel.",
            relative(all(&PixelHistory::reflectivity_of_signal)),
        )?,
    ])
}

/// `values` as shares of the highest.
fn relative(mut values: Vec<Option<f64>>) -> Vec<Option<f64>> {
    let most = values.iter().flatten().copied().fold(0.0, f64::max);
    if most > 0.0 {
        values.iter_mut().flatten().for_each(|value| *value /= most);
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_picture_has_its_name_and_mark() {
        let maps = Maps::new(Geometry {
            columns: 1,
            rows: 1,
        });
        let pictures = pictures(&maps, ["column", "row"], 1).unwrap();
        assert_eq!(pictures.each_ref().map(|picture| picture.name), NAMES);
        for picture in pictures {
            assert!(picture.svg[..1024].contains(crate::picture::MARK));
        }
    }

    #[test]
    fn shares_are_those_of_the_highest() {
        let values = relative(vec![Some(1.0), None, Some(4.0), Some(0.0)]);
        assert_eq!(values, [Some(0.25), None, Some(1.0), Some(0.0)]);
        let dark = vec![None, Some(0.0)];
        assert_eq!(relative(dark.clone()), dark);
    }
}
