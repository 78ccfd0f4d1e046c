//! What the photons of each pixel are like: background, signal, whether there is a target.

use anyhow::Result;
use dtof_core::PixelAddress;

use super::stress::Light;
use dtof_engine::settings::Settings;
use dtof_engine::slices::next_cycles;
use dtof_photons::source::PhotonSource;

/// A window stands clear of the background by so many of its standard deviations, if there is
/// a target for sure.
const CLEAR: f64 = 6.0;

/// The whole histogram of a pixel, and what it comes to.
#[derive(Clone, Debug, Default)]
pub struct PixelLight {
    /// Background photons a bin and laser cycle, of bins away from the highest window.
    pub background: f64,
    /// Photons a laser cycle in the highest window above the background.
    pub signal: f64,
    /// Where the photons above the background lie in that window on average, in bins, if it stands
    /// clear of the background.
    pub position: Option<f64>,
}

/// Counts all photons of `source`, and gives each pixel's.
///
/// # Errors
/// What is wrong with the recording.
pub fn survey(
    source: &mut dyn PhotonSource,
    settings: &Settings,
    sigma: f64,
) -> Result<Vec<(PixelAddress, PixelLight)>> {
    let addresses = source.addresses();
    let mut histograms = vec![vec![0u64; settings.bins]; addresses.len()];
    let mut cycles = vec![0; addresses.len()];
    let mut done = 0;
    while done < source.cycles() {
        let slice = source.next_slice(next_cycles(source, done))?;
        for ((pixel, histogram), cycles) in
            slice.pixels.iter().zip(&mut histograms).zip(&mut cycles)
        {
            *cycles += u64::from(pixel.cycles);
            done = done.max(*cycles);
            for photon in &pixel.photons {
                if let Some(count) = histogram.get_mut(usize::from(photon.code)) {
                    *count += 1;
                }
            }
        }
        if slice.pixels.iter().all(|pixel| pixel.cycles == 0) {
            break;
        }
    }
    let last = settings.bins - 1;
    let (first, last) = settings
        .gate
        .map_or((0, last), |(first, last)| (first.into(), usize::from(last)));
    let all = addresses.into_iter().zip(histograms).zip(cycles);
    let all = all.map(|((address, histogram), cycles)| {
        let mut pixel = of_pixel(&histogram[first..=last], cycles, sigma);
        pixel.position = pixel.position.map(|position| position + first as f64);
        (address, pixel)
    });
    Ok(all.collect())
}

/// The window is as wide as six standard deviations, which hold nearly all of a pulse.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a few bins"
)]
fn of_pixel(bins: &[u64], cycles: u64, sigma: f64) -> PixelLight {
    let width = ((6.0 * sigma).ceil() as usize + 1).min(bins.len() / 2);
    let windows = bins.windows(width).enumerate();
    let highest = windows.max_by_key(|(_, window)| window.iter().sum::<u64>());
    let (start, window) = highest.unwrap_or((0, &[]));
    let in_window: u64 = window.iter().sum();
    let all: u64 = bins.iter().sum();
    let each = (all - in_window) as f64 / (bins.len() - width) as f64;
    let expected = each * width as f64;
    let above = in_window as f64 - expected;
    let cycles_f = cycles.max(1) as f64;
    PixelLight {
        background: each / cycles_f,
        signal: above.max(0.0) / cycles_f,
        position: (above > CLEAR * expected.max(1.0).sqrt()).then(|| {
            let places = window.iter().enumerate();
            let sum: f64 = places
                .map(|(place, &count)| (place as f64 + 0.5) * (count as f64 - each))
                .sum();
            start as f64 + sum / above
        }),
    }
}

/// The light of the median pixel: the background of all pixels, and the signal of those that
/// `has_target` names.
#[must_use]
pub fn light(
    pixels: &[(PixelAddress, PixelLight)],
    sigma: f64,
    has_target: impl Fn(PixelAddress) -> bool,
) -> Light {
    let background = pixels.iter().map(|(_, pixel)| pixel.background);
    let targets = pixels.iter().filter(|(address, _)| has_target(*address));
    Light {
        background: median(background.collect()),
        signal: median(targets.map(|(_, pixel)| pixel.signal).collect()),
        sigma,
    }
}

/// The middle one; 0 of none.
pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
