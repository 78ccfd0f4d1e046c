//! Where in its bins the pulse lies, and how far that is.
//!
//! | module | what it has |
//! |---|---|
//! | `estimate` | what an estimator finds |
//! | `centroid` | the paper's estimator, of three bins |
//! | `centred_window` | a window that moves onto the pulse |
//! | `estimator` | the choice of one |
//! | `range_scale` | from bins to millimetres |

mod centred_window;
mod centroid;
mod estimate;
mod estimator;
mod range_scale;

pub use centred_window::CentredWindow;
pub use centroid::centroid;
pub use estimate::Depth;
pub use estimator::DepthEstimator;
pub use range_scale::{RangeScale, RangeScaleError};
