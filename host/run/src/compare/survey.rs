//! Background and signal of each pixel, and the position of its target if there is one.

use anyhow::Result;
use dtof_core::PixelAddress;

use super::stress::Light;
use super::tally::first_and_last;
use dtof_data::photons::source::PhotonSource;
use dtof_engine::settings::Settings;
use dtof_engine::slices::next_cycles;
use dtof_light::counts::dead_time::arrived;

/// There is a target if a window exceeds the background by so many standard deviations.
const CLEAR: f64 = 6.0;

/// The light of a pixel, from its whole histogram.
#[derive(Clone, Debug, Default)]
pub struct PixelLight {
    /// Background photons a bin and laser cycle, from the bins outside the highest window.
    pub background: f64,
    /// Photons a laser cycle above the background in the highest window.
    pub signal: f64,
    /// Mean position of these photons in bins, if there is a target.
    pub position: Option<f64>,
}

/// Counts all photons of `source`: the light of each pixel, corrected for the dead time of the settings.
/// `progress` takes the share that is done.
///
/// # Errors
/// Fails if `progress` fails, if the gate is invalid or the photons cannot be read.
pub fn survey(
    source: &mut dyn PhotonSource,
    settings: &Settings,
    sigma: f64,
    progress: &dyn Fn(f64) -> Result<()>,
) -> Result<Vec<(PixelAddress, PixelLight)>> {
    let (first, last) = first_and_last(settings)?;
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
        progress(done as f64 / source.cycles() as f64)?;
    }
    let all = addresses.into_iter().zip(histograms).zip(cycles);
    let all = all.map(|((address, histogram), cycles)| {
        let mut counts: Vec<f64> = histogram.iter().map(|&count| count as f64).collect();
        if settings.dead_time() > 0 {
            counts = arrived(&counts, cycles as f64, settings.dead_time().into());
        }
        let mut pixel = of_pixel(&counts[first..=last], cycles, sigma);
        pixel.position = pixel.position.map(|position| position + first as f64);
        (address, pixel)
    });
    Ok(all.collect())
}

/// The light of a pixel with these counts. The window is six standard deviations wide, which holds nearly
/// all of a pulse.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a few bins"
)]
fn of_pixel(bins: &[f64], cycles: u64, sigma: f64) -> PixelLight {
    let width = ((6.0 * sigma).ceil() as usize + 1).min(bins.len() / 2);
    let windows = bins.windows(width).enumerate();
    let sums = windows.map(|(start, window)| (start, window, window.iter().sum::<f64>()));
    let highest = sums.max_by(|one, other| one.2.total_cmp(&other.2));
    let (start, window, in_window) = highest.unwrap_or((0, &[], 0.0));
    let all: f64 = bins.iter().sum();
    let each = (all - in_window) / (bins.len() - width) as f64;
    let expected = each * width as f64;
    let above = in_window - expected;
    let cycles_f = cycles.max(1) as f64;
    PixelLight {
        background: each / cycles_f,
        signal: above.max(0.0) / cycles_f,
        position: (above > CLEAR * expected.max(1.0).sqrt()).then(|| {
            let places = window.iter().enumerate();
            let sum: f64 = places
                .map(|(place, &count)| (place as f64 + 0.5) * (count - each))
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

/// The median; 0 if there are no values.
pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
