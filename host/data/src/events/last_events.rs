//! Decides for which of its pixels the event of a block stands.

use dtof_core::{BlockLevel, LaserCycle};

use crate::events::aer_file::Event;

/// When a pixel last had an event: its own, and one of a block of each level.
///
/// The event of a block stands for its pixels without an event of their own, or of a smaller
/// block, within its exposure. Such events are more exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LastEvents {
    /// One more than the laser cycle of the last event of each level; 0 before it.
    ends: [u64; 4],
}

impl LastEvents {
    /// Records the event of a pixel or a block of `level` in laser cycle `cycle`, after `exposure`
    /// laser cycles. Returns whether it stands for this pixel; only then it is recorded.
    pub fn record(&mut self, level: BlockLevel, cycle: LaserCycle, exposure: u64) -> bool {
        let end = cycle.raw().saturating_add(1);
        let first = end.saturating_sub(exposure);
        let level = usize::from(level.raw());
        let stands = self.ends[..level].iter().all(|&finer| finer <= first);
        if stands {
            self.ends[level] = end;
        }
        stands
    }

    /// The same for an [`Event`]. A dynamic depth event has no exposure.
    pub fn record_event(&mut self, event: &Event) -> bool {
        let exposure = match event {
            Event::Depth(event) => event.exposure.into(),
            Event::DynamicDepth(_) => 0,
        };
        self.record(event.level(), event.cycle(), exposure)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_stands_for_a_pixel_that_has_not_reported_within_its_exposure() {
        let mut last_events = LastEvents::default();
        let mut record = |level, cycle, exposure| {
            last_events.record(
                BlockLevel::new(level).unwrap(),
                LaserCycle::new(cycle),
                exposure,
            )
        };
        // Before any report, a block stands for all pixels.
        assert!(record(2, 50, 1000));
        // A pixel's own event always stands, and that of a block from then on.
        assert!(record(0, 99, 40));
        assert!(!record(1, 139, 41) && record(1, 139, 40));
        // A larger block must leave both alone.
        assert!(!record(2, 189, 51) && record(2, 189, 50));
        // An earlier report of a larger block does not matter.
        assert!(record(1, 190, 91));
    }
}
