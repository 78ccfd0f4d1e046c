//! The pulse that settings are for: the given one, else the measured one, else that of older settings.

use dtof_core::CentredWindow;
use dtof_core::fixed::types::U8F8;
use dtof_engine::settings::SettingsFile;

use super::find::pulse::Pulse;

/// The standard deviation of a pulse that nothing shows, in bins. Its window of 3 bins holds most photons of any pulse
/// up to 1.25 bins.
const ASSUMED: U8F8 = U8F8::ONE;

/// A pulse that is known beside the recording.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KnownPulse {
    /// Standard deviation in bins.
    pub sigma_bins: Option<U8F8>,
    /// Half widths of the depth estimator for it.
    pub half_widths: Option<CentredWindow>,
    /// Whether `sigma_bins` holds whatever the recording shows. If not, it holds where no peak is bright enough.
    pub is_given: bool,
}

impl KnownPulse {
    /// The pulse of `settings`.
    #[must_use]
    pub const fn of(settings: &SettingsFile, is_given: bool) -> Self {
        Self {
            sigma_bins: settings.sensor.sigma_bins,
            half_widths: settings.detection.half_widths,
            is_given,
        }
    }
}

/// Where the pulse of the settings comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PulseSource {
    /// The recording.
    Measured,
    /// The user.
    Given,
    /// Older settings, as no peak is bright enough.
    Older,
    /// Nothing: no peak is bright enough, and there is no older pulse.
    Assumed,
}

/// The pulse that settings are for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UsedPulse {
    /// Standard deviation in bins.
    pub sigma_bins: U8F8,
    /// Half widths of the depth estimator, where its window is asymmetric.
    pub half_widths: Option<CentredWindow>,
    /// Where it comes from.
    pub source: PulseSource,
}

impl UsedPulse {
    pub fn new(measured: Option<&Pulse>, known: &KnownPulse) -> Self {
        let source = match (measured, known.sigma_bins) {
            (_, Some(_)) if known.is_given => PulseSource::Given,
            (Some(_), _) => PulseSource::Measured,
            (None, Some(_)) => PulseSource::Older,
            (None, None) => PulseSource::Assumed,
        };
        if let (PulseSource::Measured, Some(pulse)) = (source, measured) {
            let sigma = U8F8::saturating_from_num(pulse.sigma);
            return Self {
                sigma_bins: sigma.clamp(U8F8::DELTA, CentredWindow::WIDEST_PULSE),
                half_widths: pulse.asymmetric.map(|asymmetric| asymmetric.window),
                source,
            };
        }
        Self {
            sigma_bins: known.sigma_bins.unwrap_or(ASSUMED),
            half_widths: known.half_widths,
            source,
        }
    }

    /// The window that events find their depth with.
    pub fn window(&self) -> CentredWindow {
        let symmetric = || CentredWindow::for_pulse(self.sigma_bins);
        self.half_widths.unwrap_or_else(symmetric)
    }
}
