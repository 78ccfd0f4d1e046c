//! Photons into the histogram of a pixel.

use super::AsyncPixel;
use crate::config::PixelConfig;
use crate::detect::DetectionRule;
use crate::histogram::counter::{CounterWidth, PhotonCount};

impl<const BINS: usize, W: CounterWidth> AsyncPixel<BINS, W> {
    /// Counts one photon with the TDC code `code` in the current laser cycle.
    #[inline]
    pub fn count<R: DetectionRule>(&mut self, config: &PixelConfig<BINS, R>, code: u16) {
        let gated_out = self.histogram.add_gated(code, config.gate());
        // Most often it is gated.
        if gated_out > 0 {
            self.leave_out(config, code);
        }
    }

    /// Counts one photon for each TDC code, as [`Self::count`] does.
    #[inline]
    pub fn count_batch<R: DetectionRule>(&mut self, config: &PixelConfig<BINS, R>, codes: &[u16]) {
        let gated_out = self.histogram.add_gated_batch(codes, config.gate());
        if gated_out > 0 {
            self.gated_out = self.gated_out.wrapping_add(gated_out);
            if self.weighs_dead_time(config) {
                self.histogram.keep_before(config.gate().first(), codes);
            }
        }
    }

    /// Counts the photons of a whole mini-frame, a histogram over one or more
    /// laser cycles. Follow it by [`Self::end_laser_cycles`] with as many.
    #[inline]
    pub fn count_frame<R: DetectionRule, C: PhotonCount>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        frame: &[C; BINS],
    ) {
        let gated_out = self.histogram.add_frame(frame, config.gate());
        if gated_out > 0 {
            self.gated_out = self.gated_out.wrapping_add(gated_out);
            if self.weighs_dead_time(config) {
                let first = config.gate().first();
                self.histogram.keep_frame_before(first, frame);
            }
        }
    }

    /// [`Self::count`] where no dead time applies, as in blocks.
    #[inline]
    pub(crate) fn count_without_dead_time<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        code: u16,
    ) {
        let gated_out = self.histogram.add_gated(code, config.gate());
        // Most often none.
        if gated_out > 0 {
            self.gated_out = self.gated_out.wrapping_add(gated_out);
        }
    }

    /// Counts a photon outside the gate: before it in its counter alone, if there is a dead time.
    // Out of line: few photons are, and the others take longer with it.
    #[cold]
    #[inline(never)]
    fn leave_out<R: DetectionRule>(&mut self, config: &PixelConfig<BINS, R>, code: u16) {
        self.gated_out = self.gated_out.wrapping_add(1);
        if self.weighs_dead_time(config) {
            self.histogram.keep_before(config.gate().first(), &[code]);
        }
    }
}
