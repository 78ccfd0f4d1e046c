//! The depth map as numbers: an array for NumPy, and a table. Millimetres of each pixel, the mean of the surface
//! that most of its last events lie on. If pixels report several echoes, also the depth of the nearest and of the
//! farthest echo of each exposure, and if they decide once how clear the peak of each pixel stands.

use std::fmt::Write as _;

use dtof_core::{Array, DepthEvent, EchoNumber};
use dtof_engine::settings::Settings;
use dtof_events::echoes::{Echo, EchoSelection};
use dtof_events::histories::PixelHistories;
use dtof_photons::npy;
use dtof_photons::ranges::Ranges;

/// 64-bit floats, rows by columns; not a number without an event.
pub const ARRAY: &str = "depth.npy";
/// One line a pixel; the depth is empty without an event.
pub const TABLE: &str = "depth.csv";
/// The same of one echo of each exposure: the array and the table.
pub const LAYERS: [(Echo, &str, &str); 2] = [
    (Echo::First, "depth-nearest.npy", "depth-nearest.csv"),
    (Echo::Last, "depth-farthest.npy", "depth-farthest.csv"),
];
/// How clear the peak of each pixel stands, in standard deviations, as the array of depths; not a number for pixels
/// that are left out.
pub const CONFIDENCE: &str = "confidence.npy";
/// The first line of the table, or its beginning: a column `confidence` may follow.
pub const HEADER: &str = "pixel,column,row,depth_mm";
/// What marks the array as a result: its header ends with so many spaces. NumPy pads its own with fewer than 64.
pub const MARK: &str = match str::from_utf8(&[b' '; 128]) {
    Ok(mark) => mark,
    Err(_) => panic!("spaces are text"),
};

/// So long that it ends with the mark.
const HEADER_BYTES: usize = 256;

/// The depth of one echo of each exposure.
pub struct Layer {
    /// The names of its files.
    pub names: [&'static str; 2],
    selection: EchoSelection,
    /// Its depth.
    pub maps: PixelHistories,
}

impl Layer {
    /// The nearest and the farthest, if the pixels of `array` report several echoes.
    pub fn all(settings: &Settings, array: Array) -> Vec<Self> {
        if settings.echoes == EchoNumber::FIRST || settings.frame.is_some() {
            return Vec::new();
        }
        let layers = LAYERS.map(|(echo, array_name, table_name)| Self {
            names: [array_name, table_name],
            selection: EchoSelection::new(echo, settings.echoes, settings.longest_exposure()),
            maps: PixelHistories::new(array),
        });
        layers.into()
    }

    /// Takes an event.
    pub fn add(&mut self, event: &DepthEvent, ranges: &Ranges) {
        self.selection.push(*event);
        self.take_selected(ranges);
    }

    /// Takes the events that still waited for another echo of their exposure.
    pub fn end(&mut self, ranges: &Ranges) {
        self.selection.finish();
        self.take_selected(ranges);
    }

    fn take_selected(&mut self, ranges: &Ranges) {
        for event in &mut self.selection {
            self.maps.add(&event, ranges);
        }
    }
}

/// An array with a value for each pixel.
pub fn array(array: Array, values: impl Iterator<Item = f64>) -> Vec<u8> {
    let shape = [array.rows(), array.columns()].map(u64::from);
    let mut bytes = npy::header("<f8", &shape, HEADER_BYTES);
    bytes.extend(values.flat_map(f64::to_le_bytes));
    bytes
}

/// The table, with the confidence if there is one for each pixel.
pub fn table(maps: &PixelHistories, confidence: Option<&[f64]>) -> String {
    let columns = maps.array.columns() as usize;
    let more = confidence.map_or("", |_| ",confidence");
    let mut table = format!("{HEADER}{more}\n");
    for (number, pixel) in maps.pixels.iter().enumerate() {
        let (column, row) = (number % columns, number / columns);
        let depth = pixel.mean_mm().map(|depth| format!("{depth:.3}"));
        // Writing to a string does not fail.
        let _ = write!(
            table,
            "{number},{column},{row},{}",
            depth.unwrap_or_default()
        );
        if let Some(confidence) = confidence.and_then(|all| all.get(number)) {
            let text = match confidence.is_nan() {
                true => String::new(),
                false => format!("{confidence:.3}"),
            };
            let _ = write!(table, ",{text}");
        }
        table.push('\n');
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_core::Array;

    #[test]
    fn the_array_has_the_mark_and_as_many_numbers_as_pixels() {
        let maps = PixelHistories::new(Array::new(256, 256).unwrap());
        let bytes = array(maps.array, std::iter::repeat_n(f64::NAN, 65_536));
        assert_eq!(bytes.len(), 256 + 8 * 65_536);
        assert!(
            bytes[..256]
                .windows(128)
                .any(|part| part == MARK.as_bytes())
        );
        assert_eq!(bytes[255], b'\n');
        assert!(table(&maps, None).ends_with("\n65535,255,255,\n"));
    }
}
