//! The algorithm of the paper in plain floating point.
//!
//! Y. Liu et al., "An on-chip Pixel Processing Approach with 2.4 µs latency for
//! Asynchronous Read-out of SPAD-based dToF Flash `LiDARs`". Every module is
//! written from the text of the paper and shares nothing with the integer
//! implementation, so that tests can compare the two.
//!
//! | Module         | Contents                                       | Paper                |
//! |----------------|------------------------------------------------|----------------------|
//! | `histogram`    | photon counts per bin, saturating counters     | sec. II-A, sec. IV-B |
//! | `peak`         | the bin with the largest count                 | sec. II-A            |
//! | `background`   | the background level next to a peak            | sec. II-A, sec. IV-B |
//! | `threshold`    | whether a peak is significant                  | Eq. 5                |
//! | `depth`        | sub-bin position of a peak, and its range      | sec. III-A           |
//! | `pixel`        | the asynchronous operation of a pixel          | sec. II-B            |
//! | `square_root`  | the integer square root of the background      | sec. IV-B, Alg. 1    |
//!
//! Beyond the paper, written from the descriptions in `docs/design.md`:
//!
//! | Module         | Contents                                       |
//! |----------------|------------------------------------------------|
//! | `window`       | the window rule                                |
//! | `live`         | the window rule for a TDC with a dead time     |
//! | `echoes`       | a pixel with echoes and tracking               |
//! | `blocks`       | adaptive binning                               |
//!
//! Windows of bins are inclusive at both ends: `first..=last`.

mod background;
mod blocks;
mod depth;
mod echoes;
mod histogram;
mod live;
mod peak;
mod pixel;
mod square_root;
mod threshold;
mod window;

pub use background::{average_background, quadrant_background};
pub use blocks::{BinnedArray, Reporter};
pub use depth::{centroid, range_mm};
pub use echoes::{Echo, EchoConfig, EchoPixel};
pub use histogram::Histogram;
pub use live::{LiveHistogram, LiveTest};
pub use peak::peak;
pub use pixel::{Background, Config, Event, Look, Pixel};
pub use square_root::floor_square_root;
pub use threshold::{stands_clear, threshold};
pub use window::Window;
