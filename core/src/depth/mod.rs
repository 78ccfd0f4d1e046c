//! Where in its bins the pulse lies, and how far that is.
//!
//! | module | what it has |
//! |---|---|
//! | `estimate` | what an estimator finds |
//! | `centroid` | the paper's estimator, of three bins |
//! | `centred_window` | a window that moves onto the pulse |
//! | `window_weights` | what photons of each bin count for it |
//! | `estimator` | the choice of one |
//! | `range_scale` | from bins to millimetres |

mod centred_window;
mod centroid;
mod estimate;
mod estimator;
mod range_scale;
mod window_weights;

pub use centred_window::CentredWindow;
pub use centroid::centroid;
pub(crate) use centroid::offset_of;
pub use estimate::Depth;
pub use estimator::DepthEstimator;
pub use range_scale::{RangeScale, RangeScaleError};
