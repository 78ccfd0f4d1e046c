//! Where a pixel looks.

use dtof_photons::source::Geometry;

/// Where a pixel looks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    /// Its column and row.
    pub pixel: [u32; 2],
    /// Its array.
    pub array: Geometry,
    /// Column and row of the layout.
    pub place: [f64; 2],
    /// The unit ray through its middle.
    pub ray: [f64; 3],
}
