//! The depth map as numbers: arrays for NumPy, and a table.

use std::fmt::Write as _;

use crate::depth_map::DepthMap;
use dtof_core::Array;
use dtof_data::photons::npy;

/// Millimetres of each pixel: 64-bit floats, rows by columns; not a number without a surface.
pub const ARRAY: &str = "depth.npy";
/// One line a pixel; the depth is empty without a surface.
pub const TABLE: &str = "depth.csv";
/// The same of the nearest and of the farthest surface: the array and the table.
pub const LAYERS: [[&str; 2]; 2] = [
    ["depth-nearest.npy", "depth-nearest.csv"],
    ["depth-farthest.npy", "depth-farthest.csv"],
];
/// The depth of the best window of each pixel, however unsure.
pub const BEST: &str = "depth-best.npy";
/// The mean depth of the last events.
pub const EVENTS: &str = "depth-events.npy";
/// How clear the peak of each pixel stands, in standard deviations; not a number for pixels that are left out.
pub const CONFIDENCE: &str = "confidence.npy";
/// Laser cycles since the last event at the depth of the map.
pub const AGE: &str = "age.npy";
/// The first line of the table, or its beginning: columns `confidence` and `flags` may follow.
pub const HEADER: &str = "pixel,column,row,depth_mm";
/// What marks the array as a result: its header ends with so many spaces. NumPy pads its own with fewer than 64.
pub const MARK: &str = match str::from_utf8(&[b' '; 128]) {
    Ok(mark) => mark,
    Err(_) => panic!("spaces are text"),
};

/// So long that it ends with the mark.
const HEADER_BYTES: usize = 256;

/// An array with a value for each pixel.
pub fn array(array: Array, values: &[f64]) -> Vec<u8> {
    let shape = [array.rows(), array.columns()].map(u64::from);
    let mut bytes = npy::header("<f8", &shape, HEADER_BYTES);
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    bytes
}

/// The table of `depths`, with confidence and flags if they are those of `map`.
pub fn table(array: Array, depths: &[f64], map: Option<&DepthMap>) -> String {
    let columns = array.columns() as usize;
    let more = map.map_or("", |_| ",confidence,flags");
    let mut table = format!("{HEADER}{more}\n");
    let text = |value: f64| match value.is_nan() {
        true => String::new(),
        false => format!("{value:.3}"),
    };
    for (number, &depth) in depths.iter().enumerate() {
        let (column, row) = (number % columns, number / columns);
        // Writing to a string does not fail.
        let _ = write!(table, "{number},{column},{row},{}", text(depth));
        if let Some(map) = map {
            let (confidence, flags) = (map.confidence[number], map.flags[number]);
            let _ = write!(table, ",{},{flags}", text(confidence));
        }
        table.push('\n');
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_array_has_the_mark_and_as_many_numbers_as_pixels() {
        let (all, depths) = (Array::new(256, 256).unwrap(), vec![f64::NAN; 65_536]);
        let bytes = array(all, &depths);
        assert_eq!(bytes.len(), 256 + 8 * 65_536);
        assert!(
            bytes[..256]
                .windows(128)
                .any(|part| part == MARK.as_bytes())
        );
        assert_eq!(bytes[255], b'\n');
        assert!(table(all, &depths, None).ends_with("\n65535,255,255,\n"));
    }
}
