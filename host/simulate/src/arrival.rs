//! A photon on its way to the detector.

/// A photon of the plain model.
pub(super) enum Arrival {
    /// In this bin, anywhere in it.
    Background(u16),
    /// At this position in bins, from the start of bin 0.
    Signal(f64),
}

/// The bin of a position within the histogram.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "rounded down, within the bins"
)]
pub(super) fn code(position: f64) -> u16 {
    position as u16
}
