//! The line of sight of a pixel.

/// The line of sight of a pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct LineOfSight {
    /// Its column and row.
    pub pixel: [u32; 2],
    /// Columns and rows of its array.
    pub size: [u32; 2],
    /// Column and row of the layout.
    pub place: [f64; 2],
    /// The unit ray through its middle.
    pub ray: [f64; 3],
}
