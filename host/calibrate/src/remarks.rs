//! Remarks: what a recording does not show, and the option that would help.

use super::find::pile_up::MATTERS;
use super::find::shape;
use super::{Audit, Calibration, Length, Nearest, PulseSource, Tdc};
use dtof_data::options::numbers::shortest;
use dtof_data::options::rows::{Row, bins, grouped, percent, two_digits};
use dtof_engine::settings::SettingsFile;

/// From this share of lost photons on, far targets are missed or wrong although rates are corrected.
const MOST_LOST: f64 = 0.75;
/// The same without a correction.
const MOST_LOST_UNCORRECTED: f64 = 0.5;
/// The widest window is for a pulse of σ = 1.75 bins, and does for those of this.
const WIDEST: f64 = 2.2;
/// Sensors have fewer hot pixels than this.
const MOST_HOT: f64 = 0.05;

impl Calibration {
    /// What is wrong with the recording, what the settings hide, or what makes depths wrong, each with the option that helps.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        if self.is_void {
            return Vec::new();
        }
        let Audit { cause, others } = &self.audit;
        let audit = cause.iter().chain(others).cloned();
        // The others may follow from it.
        if cause.is_some() {
            return audit.collect();
        }
        let found = [
            self.unclear_glass(),
            self.wide_pulse(),
            self.hidden_surfaces(),
            self.many_hot(),
            self.hidden_photons(),
        ];
        audit.chain(found.into_iter().flatten()).collect()
    }

    /// That early photons have hidden so many late ones, or seem to have, that depths may be wrong.
    #[must_use]
    pub fn hidden_photons(&self) -> Option<String> {
        match self.tdc? {
            Tdc::OnePhotonIn { cycles, lost } if lost > MOST_LOST_UNCORRECTED => Some(format!(
                "the background falls as if the TDC recorded one photon in each of about {} laser cycles and lost \
                 {:.1} %: far targets may be missed or wrong. --recorded-cycles N, with the N of the sensor, corrects \
                 that",
                two_digits(cycles),
                lost * 100.0
            )),
            Tdc::Unclear(lost) if lost > MATTERS && self.pulse.is_some() => Some(format!(
                "if the TDC takes only the first photon of a laser cycle, {:.0} % of the photons are lost to pile-up, and \
                 ranges are too short, which the background does not show: --dead-time 0 says that it takes all, \
                 --dead-time {} that it does not",
                lost * 100.0,
                self.bins
            )),
            Tdc::DeadTime { lost, .. } if lost > MOST_LOST => Some(format!(
                "the TDC loses {:.1} % of the photons: far targets may be missed or wrong with so much light",
                lost * 100.0
            )),
            _ => None,
        }
    }

    /// That most pixels see a surface that may be a cover glass or not.
    fn unclear_glass(&self) -> Option<String> {
        let (layer, what) = match self.nearest {
            Nearest::Unclear(layer) => (layer, "a cover glass, or a wall"),
            Nearest::Passing(layer) => (
                layer,
                "not all the time, so something moved, or the light changed",
            ),
            _ => return None,
        };
        let percent = |share: f64| match (share * 100.0).round() {
            0.0 => "less than 1 %".to_owned(),
            percent => format!("{percent} %"),
        };
        let (bin, share, behind) = (layer.bin, percent(layer.share), percent(layer.behind));
        Some(format!(
            "{share} of the histograms have a surface at bin {bin}, and {behind} of these another behind it: {what}. \
             Nothing is left out, so pixels with both show the brighter one. --glass yes leaves it out; --glass no says \
             that it is a wall"
        ))
    }

    /// That no window is as wide as the pulse.
    fn wide_pulse(&self) -> Option<String> {
        let pulse = self.pulse.as_ref()?;
        let is_wide = pulse.sigma > WIDEST && self.detection.pulse_source == PulseSource::Measured;
        if !is_wide {
            return None;
        }
        let sigma = pulse.sigma;
        if sigma > 0.99 * shape::WIDEST {
            return Some(format!(
                "what stands above the background is wider than any pulse that was tried, up to σ = {} bins, so it may be \
                 none. --gate FIRST..LAST leaves out what is no target; --rebin 8 suits a pulse of so many bins",
                shape::WIDEST
            ));
        }
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "1 to 4"
        )]
        let rebin = ((sigma / WIDEST).ceil() as u32).next_power_of_two();
        Some(format!(
            "the pulse, of σ = {sigma:.2} bins, is too wide for the widest window, which is for 1.75 bins: --rebin {rebin} \
             suits it, unless it is two surfaces that run into each other, as a cover glass and a near target"
        ))
    }

    /// That the gate leaves out all that some pixels see.
    fn hidden_surfaces(&self) -> Option<String> {
        let (first, last) = self.gate;
        (self.hidden > 0.0).then(|| {
            format!(
                "the gate, {first}..{last}, leaves out the only surface of {:.0} % of the histograms, beside the cover \
                 glass: --glass no keeps it",
                (self.hidden * 100.0).max(1.0)
            )
        })
    }

    /// That so many pixels are hot that it may be the scene.
    fn many_hot(&self) -> Option<String> {
        let (hot, all) = (self.pixels.hot.len(), self.array_pixels);
        let are_many = hot > 1 && hot as f64 > MOST_HOT * all as f64;
        (are_many && !self.keeps_hot).then(|| {
            format!(
                "{} of {} pixels are left out as hot: flat, and more than ten times as bright as others. --mask none keeps \
                 them",
                grouped(hot as u64),
                grouped(all as u64)
            )
        })
    }
}

/// Remarks on the `settings`, each a topic and a sentence or two.
#[must_use]
pub fn remarks(found: &Calibration, settings: &SettingsFile) -> Vec<Row> {
    let mut remarks = Vec::new();
    let mut remark = |topic: &str, text: String| remarks.push((topic.to_owned(), text));
    match found.length {
        Length::Cycles(_) => {}
        Length::PhotonsPerCycle(rate) => remark(
            "rates",
            format!(
                "Rates rest on --photons-per-cycle {rate}, an assumption. --recorded-cycles N makes them \
             absolute and shows whether there is pile-up."
            ),
        ),
        Length::Unknown => remark(
            "rates",
            "The number of laser cycles is not known, so background, crosstalk and z are not \
             written: pass --recorded-cycles N. The gate is that for one photon a laser cycle in \
             the brightest pixel, as in replay."
                .to_owned(),
        ),
    }
    match &found.nearest {
        Nearest::Glass(glass) if glass.end == 0 => remark(
            "cover glass",
            format!(
                "The crosstalk of the cover glass, at bin {}, is so dim that it needs no gate.",
                glass.top
            ),
        ),
        Nearest::Glass(glass) if glass.has_tail => {
            let (low, high) = glass.end_between;
            remark(
                "cover glass",
                format!(
                    "The crosstalk of the cover glass has a tail. Its end, {}, comes from the photons, not from \
                     the shape of the pulse.",
                    bins(low, high)
                ),
            );
        }
        _ => {}
    }
    let used = found.detection.pulse_source;
    match &found.pulse {
        // The user knows it.
        _ if used == PulseSource::Given => {}
        None => {
            let kept = match used {
                PulseSource::Older => "that of the older settings is kept",
                _ => "the window is that for σ = 1 bin",
            };
            remark(
                "pulse",
                format!(
                    "No peak is bright enough to measure the pulse, so {kept}: record a target, or pass --sigma-bins."
                ),
            );
        }
        Some(pulse) if pulse.sigma > WIDEST => {} // A warning says so.
        Some(pulse) if pulse.sigma > 1.75 => remark(
            "pulse",
            "The pulse is too wide for the widest window, which is for 1.75 bins: 1.75 is written. \
             Wider bins would help."
                .to_owned(),
        ),
        Some(pulse) if pulse.is_core => remark(
            "pulse",
            if pulse.tail < 0.005 {
                "The pulse is not Gaussian: its sides fall faster or more slowly. The standard deviation \
                 is that of its core."
                    .to_owned()
            } else {
                format!(
                    "The pulse is not Gaussian: {:.1} % of its photons come more than three standard \
                     deviations late. The standard deviation is that of its core.",
                    pulse.tail * 100.0
                )
            },
        ),
        Some(_) => {}
    }
    let asymmetric = found.pulse.as_ref().and_then(|pulse| pulse.asymmetric);
    let asymmetric = asymmetric.filter(|_| used == PulseSource::Measured);
    if let Some(asymmetric) = asymmetric {
        remark(
            "depth",
            format!(
                "The window of the depth reaches {} bins before its centre and {} after it. The mean error of \
                 16 photons of the pulse is {:.2} bins, with equal half widths {:.2}.",
                asymmetric.window.before(),
                asymmetric.window.after(),
                asymmetric.error,
                asymmetric.symmetric
            ),
        );
    }
    match found.tdc {
        Some(Tdc::DeadTime { bins, lost }) => {
            let tdc = if bins >= found.bins {
                "that records one photon a laser cycle".to_owned()
            } else {
                format!("that is blind for {bins} bins after a photon")
            };
            remark(
                "pile-up",
                format!(
                    "The background falls as with a TDC {tdc}: {:.1} % of the photons are lost. Rates are \
                     corrected for that, and dead_time lets the window rule weigh bins by how often \
                     they were live.",
                    lost * 100.0
                ),
            );
        }
        Some(Tdc::Unclear(lost)) if lost > 0.01 && lost <= MATTERS => remark(
            "pile-up",
            format!(
                "If the TDC records one photon a laser cycle, {:.1} % of the photons are lost. The \
             background does not show it.",
                lost * 100.0
            ),
        ),
        _ => {}
    }
    for text in found.warnings() {
        remark(
            "warning",
            format!("{}{}.", text[..1].to_uppercase(), &text[1..]),
        );
    }
    let detection = &found.detection;
    if detection.is_by_count {
        remark(
            "z",
            format!(
                "There is so little background that the minimum count alone keeps false alarms \
             below {} %: z is the lowest that is written.",
                percent(detection.false_alarm)
            ),
        );
    }
    if let Some(pixels) = &found.pixel_offsets
        && pixels.needs_field_of_view
    {
        remark(
            "offset",
            format!(
                "Beyond their noise the pixels differ by {:.1} mm. A flat target is farther away at the edges of the \
                 array: --fov HxV says by how much, and the rest is written as an offset for each pixel.",
                pixels.spread_mm
            ),
        );
    }
    if found.offset.is_none() {
        let unused = found.target_mm.map(|distance| {
            format!(
                "--target-mm {distance} was not used: no more than half of the pixels see a surface at \
                 one range. Put a flat target in front of more of them; with --fov HxV, too, their ranges may differ \
                 by up to 240 mm."
            )
        });
        let kept = settings.sensor.offset_mm.map(|offset| {
            let offset = shortest(offset);
            format!(
                "{offset} mm are kept, from the settings or the log's sensor: this recording does not give another \
                 range offset."
            )
        });
        let mut texts: Vec<String> = unused.into_iter().chain(kept).collect();
        if texts.is_empty() {
            texts.push(
                "The range offset is not known: put a flat target at a known distance in front of more \
                 than half of the pixels, and pass --target-mm D."
                    .to_owned(),
            );
        }
        remark("offset", texts.join(" "));
    }
    remarks
}

#[cfg(test)]
mod tests {
    use crate::{CalibrationOptions, Observed, calibrate};
    use dtof_core::{Array, PixelAddress};
    use dtof_data::photons::histograms::Histograms;
    use dtof_data::random::pixel_rng;
    use rand_distr::{Distribution, Poisson};

    /// Warnings about 8×8 pixels, of which so many are hot, none beside another.
    fn warnings(hot: usize, masked: Option<&[u16]>) -> Vec<String> {
        let histogram = |pixel: u16| {
            let (row, column) = (pixel / 8, pixel % 8);
            let number = usize::from(row / 2 * 4 + column / 2);
            let is_hot = row % 2 == 0 && column % 2 == 0 && number < hot;
            let photons = Poisson::new(if is_hot { 600.0 } else { 20.0 }).unwrap();
            let mut rng = pixel_rng(1, PixelAddress::new(pixel));
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let histogram: Vec<u64> = (0..64).map(|_| photons.sample(&mut rng) as u64).collect();
            histogram
        };
        let histograms = Histograms::of((0..64).map(histogram).collect::<Vec<_>>()).unwrap();
        let observed = Observed {
            masked,
            ..Observed::plain(Array::new(8, 8).unwrap(), &histograms)
        };
        let found = calibrate(&observed, &CalibrationOptions::default()).unwrap();
        assert_eq!(found.pixels.hot.len(), hot);
        found.warnings()
    }

    #[test]
    fn many_hot_pixels_are_warned_of_unless_they_are_kept() {
        for (hot, is_warned) in [(0, false), (3, false), (4, true), (16, true)] {
            let part = format!("{hot} of 64 pixels are left out as hot");
            let is_in = |warnings: &[String]| warnings.iter().any(|line| line.starts_with(&part));
            let found = warnings(hot, None);
            assert_eq!(is_in(&found), is_warned, "{found:?}");
            let kept = warnings(hot, Some(&[]));
            assert!(!kept.iter().any(|line| line.contains("--mask")), "{kept:?}");
        }
    }
}
