//! The values of a map.

/// One value per pixel, row by row from the top. `None` and values that are not finite are pixels
/// without a value.
#[derive(Clone, Copy, Debug)]
pub struct Map<'a> {
    /// The name of the values; drawn above the map.
    pub title: &'a str,
    /// Unit of the values; drawn above the colour bar.
    pub unit: &'a str,
    /// The names of columns and rows; drawn along the axes.
    pub axis_names: [&'a str; 2],
    /// The thing that a pixel without a value lacks, such as `event`.
    pub missing: &'a str,
    /// Number of pixels in a row.
    pub columns: usize,
    /// Number of rows.
    pub rows: usize,
    /// The values, `columns * rows` of them.
    pub values: &'a [Option<f64>],
}
