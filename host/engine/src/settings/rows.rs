//! Settings as a table.

use dtof_core::paper::Threshold;
use dtof_core::{AnyRule, DepthEstimator, EchoNumber};
use dtof_data::options::rows::Row;

use super::engine::Settings;

/// The most pixels that a row lists.
const LISTED: usize = 24;

impl Settings {
    /// The settings.
    #[must_use]
    pub fn rows(&self) -> Vec<Row> {
        let row = |name: &str, value: String| (name.to_owned(), value);
        let configuration = &self.configuration;
        let gate = self.gate().map_or("none".to_owned(), |(first, last)| {
            format!("{first}..{last}")
        });
        let mut rows = vec![
            row(
                "bins",
                format!("{} of {} ps", self.bins, configuration.bin_width_ps),
            ),
            row("range offset", format!("{} mm", configuration.offset_mm)),
            row("range gate", gate),
        ];
        if let (Some(low), Some(high)) =
            (self.offsets_mm.iter().min(), self.offsets_mm.iter().max())
        {
            let text = format!("from {low:.1} to {high:.1} mm, added to the range offset");
            rows.insert(2, row("offsets of pixels", text));
        }
        if !self.masked.is_empty() {
            let pixels = self.masked.iter().take(LISTED).map(u16::to_string);
            let mut text = pixels.collect::<Vec<_>>().join(", ");
            if self.masked.len() > LISTED {
                text += &format!(" and {} more", self.masked.len() - LISTED);
            }
            rows.push(row("pixels left out", text));
        }
        if configuration.dither_bins > 0 {
            let (half, seed) = (configuration.dither_bins / 2, configuration.dither_seed);
            let text = format!("laser cycles are up to {half} bins longer or shorter, seed {seed}");
            rows.push(row("dither", text));
        }
        rows.extend(self.detection_rows());
        if let Some(binning) = configuration.binning {
            let side = 1 << binning.levels.raw();
            rows.push(row(
                "adaptive binning",
                format!(
                    "blocks of up to {side}x{side} pixels that have been silent for {} laser cycles",
                    binning.patience
                ),
            ));
        }
        if configuration.tracking && !self.decide_once {
            let text = "half of the false alarms near the last event of a pixel";
            rows.push(row("tracking", text.to_owned()));
        }
        if configuration.echoes > EchoNumber::FIRST {
            let reach = configuration.echo_guard_bins;
            let most = configuration.echoes;
            let ends = match configuration.echo_wait {
                times if times < u8::MAX && !self.decide_once => {
                    format!(", which ends after {times} times the laser cycles of the last")
                }
                _ => String::new(),
            };
            let text = format!("up to {most} an exposure{ends}; ±{reach} bins left out");
            rows.push(row("echoes", text));
        }
        if self.decide_once {
            let text = "one a pixel, on all of its photons".to_owned();
            rows.push(row("decisions", text));
        } else if self.frame.is_none() {
            rows.push(row(
                "decisions",
                format!(
                    "every {} laser cycles (X), in exposures longer than {} (L1) and shorter than {} (L2)",
                    configuration.x, configuration.l1, configuration.l2
                ),
            ));
        }
        rows.push(row("seed", self.seed.to_string()));
        rows
    }

    /// The title of the report.
    #[must_use]
    pub fn title(&self) -> &'static str {
        match self.frame {
            None if self.decide_once => "Depth, decided once on all photons",
            None => "Asynchronous depth events",
            Some(_) => "Frames, as a frame-based sensor reads them",
        }
    }

    /// The names of one report of a pixel and of several.
    #[must_use]
    pub const fn reports(&self) -> [&'static str; 2] {
        match self.frame {
            None => ["event", "events"],
            Some(_) => ["reading", "readings"],
        }
    }

    /// Laser cycles until the first decision.
    #[must_use]
    pub fn first_decision(&self) -> u64 {
        if self.decide_once {
            return 1;
        }
        let (x, l1) = (
            u64::from(self.configuration.x),
            u64::from(self.configuration.l1),
        );
        self.frame.map_or((l1 / x + 1) * x, u64::from)
    }

    /// The most laser cycles of an exposure.
    #[must_use]
    pub fn longest_exposure(&self) -> u16 {
        match self.decide_once {
            true => u16::MAX,
            false => self.configuration.l2,
        }
    }

    /// Rule, or frame, estimator, and neighbours and dead time if there are any.
    fn detection_rows(&self) -> Vec<Row> {
        let decision = match self.frame {
            None => ("threshold".to_owned(), threshold(&self.configuration.rule)),
            Some(length) => (
                "frames".to_owned(),
                format!("the highest bin of each {length} laser cycles"),
            ),
        };
        let depth = match self.configuration.estimator {
            DepthEstimator::Centroid3 => "centroid of 3 bins".to_owned(),
            DepthEstimator::CentredWindow(window) => {
                let [before, after] = [window.before(), window.after()];
                if before == after {
                    format!("centred window of ±{before} bins")
                } else {
                    format!("centred window from −{before} to +{after} bins")
                }
            }
        };
        let mut rows = vec![decision, ("depth".to_owned(), depth)];
        if let Some(neighbours) = self
            .configuration
            .neighbours
            .filter(|_| self.frame.is_none())
        {
            let text = format!(
                "{} confirm; half of the false alarms of z for a pixel alone, half with neighbours",
                neighbours.raw()
            );
            rows.push(("neighbours".to_owned(), text));
        }
        if self.dead_time() > 0 && self.frame.is_none() {
            let bins = self.dead_time();
            let text = match usize::from(bins) >= self.bins {
                true => "all bins after the first photon of a laser cycle".to_owned(),
                false => format!("{bins} bins after each photon"),
            };
            let source = match self.is_dead_time_of_sensor {
                true => "the sensor or scene",
                false => "the settings",
            };
            rows.push(("dead time".to_owned(), format!("{text}, from {source}")));
        }
        if self.counts_once_per_bin() {
            let text = "those of one laser cycle in one bin count once";
            rows.push(("photons".to_owned(), text.to_owned()));
        }
        if self.counter_bits != 10 && self.frame.is_none() && !self.decide_once {
            let text = format!("{} bits; a full one ends an exposure", self.counter_bits);
            rows.push(("counters".to_owned(), text));
        }
        rows
    }
}

fn with_alpha(background: &str, threshold: &Threshold) -> String {
    format!(
        "{background} + {} × its square root (α), at least {} photons",
        threshold.alpha(),
        threshold.minimum_count()
    )
}

/// The threshold of a rule in words.
fn threshold(rule: &AnyRule) -> String {
    match rule {
        AnyRule::Paper(rule) => with_alpha("background", rule.threshold()),
        AnyRule::Average(rule) => with_alpha("average of all bins", rule.threshold()),
        AnyRule::Window(rule) => format!(
            "in a window of {} bins: background + {} standard deviations (z), at least {} photons",
            rule.width(),
            rule.z(),
            rule.minimum_count()
        ),
    }
}
