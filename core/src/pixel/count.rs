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

    /// Counts a photon outside the gate.
    #[inline(always)]
    fn leave_out<R: DetectionRule>(&mut self, config: &PixelConfig<BINS, R>, code: u16) {
        self.gated_out = self.gated_out.wrapping_add(1);
        if config.weighs_dead_time() {
            self.keep(config, code);
        }
    }

    /// Counts a photon before the gate in its counter alone.
    // Out of line: the photon then needs no place in memory where there is no dead time.
    #[cold]
    #[inline(never)]
    fn keep<R: DetectionRule>(&mut self, config: &PixelConfig<BINS, R>, code: u16) {
        if self.weighs_dead_time(config) {
            self.histogram.keep_before(config.gate().first(), &[code]);
        }
    }
}
