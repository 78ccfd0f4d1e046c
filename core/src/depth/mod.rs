//! The place of the pulse within its bins, and its range.
//!
//! | module | what it has |
//! |---|---|
//! | `estimate` | the result of an estimator |
//! | `centroid` | the paper's estimator, of three bins |
//! | `centred_window` | a window that moves onto the pulse |
//! | `rates` | the light of bins, of a TDC with a dead time |
//! | `window_weights` | the weights of its bins |
//! | `estimator` | the choice of one |
//! | `range_scale` | from bins to millimetres |

mod centred_window;
mod centroid;
mod estimate;
mod estimator;
mod range_scale;
mod rates;
mod window_weights;

pub use centred_window::CentredWindow;
pub use centroid::centroid;
pub(crate) use centroid::offset_of;
pub use estimate::DepthEstimate;
pub use estimator::DepthEstimator;
pub use range_scale::{RangeScale, RangeScaleError};
pub(crate) use rates::{Counted, Rates};
