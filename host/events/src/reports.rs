//! For which of its pixels the event of a block stands.

use dtof_core::{BlockLevel, LaserCycle};

use crate::aer_file::Event;

/// When a pixel was reported last, by itself and in a block of each level.
///
/// A block's event stands for those of its pixels that have not reported by themselves, or in
/// a smaller block, within its exposure: such an event says more of the pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LastReports {
    /// One more than the laser cycle of the last event of each level, 0 before it.
    ends: [u64; 4],
}

impl LastReports {
    /// Takes the event of a block that holds the pixel, or of the pixel itself: of `level`, in
    /// laser cycle `cycle` after so many of `exposure`. Whether it stands for the pixel; only
    /// then it is one of its reports.
    pub fn take(&mut self, level: BlockLevel, cycle: LaserCycle, exposure: u64) -> bool {
        let end = cycle.0.saturating_add(1);
        let first = end.saturating_sub(exposure);
        let level = usize::from(level.raw());
        let stands = self.ends[..level].iter().all(|&finer| finer <= first);
        if stands {
            self.ends[level] = end;
        }
        stands
    }

    /// The same of an event that has arrived. A change of depth has no exposure.
    pub fn take_event(&mut self, event: &Event) -> bool {
        let exposure = match event {
            Event::Depth(event) => event.exposure.into(),
            Event::DynamicDepth(_) => 0,
        };
        self.take(event.level(), event.cycle(), exposure)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_stands_for_a_pixel_that_has_not_reported_within_its_exposure() {
        let mut reports = LastReports::default();
        let mut take = |level, cycle, exposure| {
            reports.take(BlockLevel::new(level).unwrap(), LaserCycle(cycle), exposure)
        };
        // Before any report a block stands for all.
        assert!(take(2, 50, 1000));
        // Its own event always stands; the block's from then on.
        assert!(take(0, 99, 40));
        assert!(!take(1, 139, 41) && take(1, 139, 40));
        // A larger block has to leave both alone.
        assert!(!take(2, 189, 51) && take(2, 189, 50));
        // A larger block before it is no hindrance.
        assert!(take(1, 190, 91));
    }
}
