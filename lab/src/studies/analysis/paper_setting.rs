//! The histogram of the paper's analysis (section II-C): eight bins, the pulse on
//! an edge between two of them.

use anyhow::Result;
use rand_distr::{Distribution, Poisson};
use rand_pcg::Pcg64;

use dtof_light::gaussian::MeanCounts;
use dtof_light::rates::{Reflection, peak_share, signal_mean};

/// The pulse's bin and seven others (`M_B`).
pub const BINS: usize = BINS_U32 as usize;
const BINS_U32: u32 = 8;
/// Bins that hold background only (`M_B`).
pub const BACKGROUND_BINS: u32 = BINS_U32 - 1;
/// Position of the pulse, in bins from the start of bin 0.
pub const POSITION: f64 = 4.0;
/// Standard deviation of the pulse in bins.
pub const SIGMA: f64 = 1.5;

/// The bin of the pulse (the lower of the two at the edge) and its share of the pulse.
#[must_use]
pub fn target() -> (usize, f64) {
    let (bin, share) = peak_share(BINS_U32, POSITION, SIGMA);
    (bin as usize, share)
}

/// Mean counts of each bin at a mean `background` a bin. Without `neighbours` only the pulse's bin
/// holds signal, as in Eq. 7.
#[must_use]
pub fn means(background: f64, snr: f64, neighbours: bool) -> [f64; BINS] {
    // The histogram's signal is N·A, its background N·B.
    let returned = [Reflection {
        photons: snr * background.sqrt(),
        position: POSITION,
    }];
    let (target, _) = target();
    let mut bins = 0..;
    [(); BINS].map(|()| {
        let bin: u32 = bins.next().unwrap_or_default();
        if neighbours || bin as usize == target {
            background + signal_mean(bin, 1.0, &returned, SIGMA)
        } else {
            background
        }
    })
}

/// The input of the paper's equations.
#[must_use]
pub fn gaussian(background: f64, snr: f64) -> MeanCounts {
    let (_, share) = target();
    MeanCounts {
        background,
        signal: snr * background.sqrt() * share,
        background_bins: BACKGROUND_BINS,
    }
}

/// Histograms with Poisson counts.
pub struct Histograms([Poisson<f64>; BINS]);

impl Histograms {
    /// With the means `means`.
    ///
    /// # Errors
    /// Fails if a mean is not above 0.
    pub fn new(means: [f64; BINS]) -> Result<Self> {
        let mut laws = [Poisson::new(1.0)?; BINS];
        for (law, mean) in laws.iter_mut().zip(means) {
            *law = Poisson::new(mean)?;
        }
        Ok(Self(laws))
    }

    /// Draws a histogram.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a whole number of some hundred"
    )]
    pub fn draw(&self, rng: &mut Pcg64) -> [u32; BINS] {
        self.0.map(|law| law.sample(rng) as u32)
    }
}
