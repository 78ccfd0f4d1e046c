//! Adaptive binning.

mod places;
mod whole;

use dtof_core::BlockLevel;

fn level(raw: u8) -> BlockLevel {
    BlockLevel::new(raw).unwrap()
}
