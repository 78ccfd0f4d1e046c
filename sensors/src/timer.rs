//! A moment in the caller's milliseconds, which may wrap.

/// When something began.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Since(u32);

impl Since {
    pub(crate) const fn new(now_ms: u32) -> Self {
        Self(now_ms)
    }

    /// Milliseconds from then to `now_ms`; right for up to 49 days.
    pub(crate) const fn elapsed(self, now_ms: u32) -> u32 {
        now_ms.wrapping_sub(self.0)
    }

    /// Whether `wait` milliseconds have certainly passed. The clock may have ticked right after the
    /// beginning, so this takes one tick more.
    pub(crate) const fn is_over(self, wait: u32, now_ms: u32) -> bool {
        self.elapsed(now_ms) > wait
    }
}
