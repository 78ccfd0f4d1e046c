//! The maps of a run as pictures.

use anyhow::Result;

use crate::depth_map::DepthMap;
use dtof_data::events::histories::{PixelHistories, PixelHistory};
use dtof_draw::picture::{Map, heat_map};

/// The depth, decided on all photons.
pub const DEPTH: &str = "depth.svg";
/// The files, in the order of [`pictures`].
pub const NAMES: [&str; 7] = [
    DEPTH,
    "depth-last.svg",
    "depth-mean.svg",
    "event-counts.svg",
    "reflectivity-events.svg",
    "reflectivity-signal.svg",
    "photon-counts.svg",
];

/// A picture and the name of its file.
pub struct Picture {
    pub name: &'static str,
    pub svg: String,
    /// The caption in the report, which shows one picture of each quantity.
    pub caption: Option<String>,
}

/// The maps of a run, that of the depth first if there is one. `axis_names` are those of columns and rows; an event of a pixel is called `one`,
/// and several of them `several`.
pub fn pictures(
    maps: &PixelHistories,
    map: Option<&DepthMap>,
    axis_names: [&str; 2],
    [one, several]: [&str; 2],
) -> Result<Vec<Picture>> {
    let draw_without = |missing, name, title: &str, unit, caption, values: Vec<Option<f64>>| {
        let svg = heat_map(&Map {
            title,
            unit,
            axis_names,
            missing,
            columns: maps.array.columns() as usize,
            rows: maps.array.rows() as usize,
            values: &values,
        })?;
        anyhow::Ok(Picture { name, svg, caption })
    };
    let draw = |name, title: &str, unit, caption, values| {
        draw_without(one, name, title, unit, caption, values)
    };
    // A pixel that has reported in blocks only has a depth, but its light was not measured.
    let own = format!("{one} of its own");
    let all = |value: &dyn Fn(&PixelHistory) -> Option<f64>| -> Vec<Option<f64>> {
        maps.pixels.iter().map(value).collect()
    };
    let depth = map.map(|map| {
        let depths = map.depth_mm.iter().copied();
        let depths = depths.map(|depth| Some(depth).filter(|depth| !depth.is_nan()));
        let caption = "The range of each pixel, decided once on all of its photons.".to_owned();
        draw_without(
            "surface",
            DEPTH,
            "Range, decided on all photons",
            "mm",
            Some(caption),
            depths.collect(),
        )
    });
    let of_events = [
        draw(
            "depth-last.svg",
            &format!("Range of the last {one}"),
            "mm",
            map.is_none()
                .then(|| format!("The range of the last {one} of each pixel.")),
            all(&PixelHistory::last_mm),
        )?,
        draw(
            "depth-mean.svg",
            &format!("Range, mean of the last ten {several}"),
            "mm",
            None,
            all(&PixelHistory::mean_mm),
        )?,
        draw(
            "event-counts.svg",
            &format!("Number of {several}"),
            several,
            Some(if one == "event" {
                "How many events each pixel has. Near and bright surfaces report more often. Two echoes \
                 count twice, and an event of a block counts for its pixels."
                    .to_owned()
            } else {
                format!("How many {several} each pixel has: one a frame with a photon.")
            }),
            all(&|pixel| Some(pixel.events as f64)),
        )?,
        draw_without(
            &own,
            "reflectivity-events.svg",
            &format!("Reflectivity from the number of {several}"),
            "of the most",
            None,
            relative(all(&PixelHistory::reflectivity_of_events)),
        )?,
        draw_without(
            &own,
            "reflectivity-signal.svg",
            "Reflectivity from the signal",
            "of the most",
            Some(format!(
                "Relative reflectivity: signal photons a laser cycle × range², over all {several} \
                 of the pixel."
            )),
            relative(all(&PixelHistory::reflectivity_of_signal)),
        )?,
        draw_without(
            "photon",
            "photon-counts.svg",
            "Number of photons",
            "photons",
            Some(
                "How many photons each pixel received in the whole run, signal and background: an \
                 active image. With the laser off (simulate --laser-off) it is the passive one."
                    .to_owned(),
            ),
            all(&|pixel| (pixel.photons > 0).then_some(pixel.photons as f64)),
        )?,
    ];
    Ok(depth.transpose()?.into_iter().chain(of_events).collect())
}

/// `values` relative to the highest.
fn relative(mut values: Vec<Option<f64>>) -> Vec<Option<f64>> {
    let most = values.iter().flatten().copied().fold(0.0, f64::max);
    if most > 0.0 {
        values.iter_mut().flatten().for_each(|value| *value /= most);
    }
    values
}

#[cfg(test)]
mod tests {
    use dtof_core::Array;

    use super::*;

    #[test]
    fn every_picture_has_its_name_and_mark() {
        let maps = PixelHistories::new(Array::new(1, 1).unwrap());
        let map = DepthMap {
            positions: vec![None],
            depth_mm: vec![f64::NAN],
            echoes_mm: None,
            best_mm: vec![f64::NAN],
            confidence: vec![0.0],
            flags: vec![0],
        };
        let (axes, nouns) = (["column", "row"], ["event", "events"]);
        let of_events = pictures(&maps, None, axes, nouns).unwrap();
        assert!(
            of_events
                .iter()
                .map(|picture| picture.name)
                .eq(NAMES[1..].iter().copied())
        );
        let pictures = pictures(&maps, Some(&map), axes, nouns).unwrap();
        assert!(pictures.iter().map(|picture| picture.name).eq(NAMES));
        for picture in pictures {
            // A pixel that has reported in blocks only is reported, and no light was measured.
            let is_of_light = picture.name.starts_with("reflectivity");
            let own = "no event of its own in any pixel";
            assert_eq!(picture.svg.contains(own), is_of_light);
            assert!(picture.svg[..1024].contains(dtof_draw::svg::MARK));
        }
    }

    #[test]
    fn values_are_relative_to_the_highest() {
        let values = relative(vec![Some(1.0), None, Some(4.0), Some(0.0)]);
        assert_eq!(values, [Some(0.25), None, Some(1.0), Some(0.0)]);
        let dark = vec![None, Some(0.0)];
        assert_eq!(relative(dark.clone()), dark);
    }
}
