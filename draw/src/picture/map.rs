//! What a picture shows.

/// One value a pixel, row by row from the top.
///
/// `None` stands for a pixel that never reported; a value that is not finite is
/// treated the same.
#[derive(Clone, Copy, Debug)]
pub struct Map<'a> {
    /// What the values are; drawn above the map.
    pub title: &'a str,
    /// Unit of the values; drawn above the colour bar.
    pub unit: &'a str,
    /// What columns and rows are; written along the sides.
    pub sides: [&'a str; 2],
    /// What a pixel without a value lacks.
    pub missing: &'a str,
    /// Number of pixels in a row.
    pub columns: usize,
    /// Number of rows.
    pub rows: usize,
    /// The values, `columns * rows` of them.
    pub values: &'a [Option<f64>],
}
