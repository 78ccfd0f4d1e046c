//! Whether a peak stands clear of the background.
//!
//! | module | what it has |
//! |---|---|
//! | `rule` | the trait of detection rules |
//! | `quadrant` | the paper's rule, with its `background`, `threshold` and square `root` |
//! | `average` | the same threshold over the average of all bins |
//! | `window`, `window_z` | the window rule, a CFAR test over all photons of the pulse, and its z |
//! | `live` | how often each bin was live, for a TDC with a dead time |
//! | `tracking` | the window rule with a lower threshold where the last event was |
//! | `confirm` | neighbouring pixels confirm what is promising |
//! | `any_rule` | a rule that is chosen at run time |
//! | `decision` | one decision on one histogram |
//! | `comparator_tree` | the paper's search for the peak, as a model of its hardware |

mod any_rule;
mod average;
mod background;
mod comparator_tree;
mod confirm;
mod decision;
mod live;
mod quadrant;
mod root;
mod rule;
mod threshold;
mod tracking;
mod window;
mod window_z;

pub use any_rule::AnyRule;
pub use average::AverageRule;
pub use background::quadrant_background;
pub use comparator_tree::ComparatorTree;
pub(crate) use confirm::Exposed;
pub use confirm::NeighbourRule;
pub use decision::{Detection, detect};
pub(crate) use decision::{detect_at, detection_in};
pub use live::{LiveCounts, LiveDecision, LiveWindow};
pub use quadrant::PaperRule;
pub use root::isqrt;
pub use rule::{DetectionRule, background_from_count};
pub use threshold::Threshold;
pub use tracking::Tracking;
pub use window::{WindowRule, WindowWidthError};
pub use window_z::{HIGHEST_Z, z_for, z_for_levels};
