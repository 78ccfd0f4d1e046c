//! The paper's building blocks by themselves: for tests, studies and hardware models.
//!
//! | in the paper | here |
//! |---|---|
//! | histogram with saturating 10-bit counters (section IV-B) | [`Histogram`](crate::Histogram) |
//! | peak search by a comparator tree (section IV-B) | [`ComparatorTree`] |
//! | background of two quadrants (section IV-B) | [`quadrant_background`] |
//! | integer square root (Alg. 1) | [`isqrt`], with five iterations |
//! | threshold (Eq. 5) | [`Threshold`] |
//! | centre of mass around the peak (section III-A) | [`centroid`] |
//! | flow chart of a pixel (section II-B) | [`AsyncPixel`](crate::AsyncPixel), [`PaperRule`](crate::PaperRule) |
//! | address events, REQ (section IV-A) | [`AerWord`](crate::AerWord), [`AsyncPixel::has_event`](crate::AsyncPixel::has_event) |
//!
//! A pixel with the paper's rule does all of this:
//! [`PixelConfig::paper`](crate::PixelConfig::paper).

pub use crate::depth::centroid;
pub use crate::detect::{ComparatorTree, Threshold, isqrt, quadrant_background};
