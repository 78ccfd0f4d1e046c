//! What a recording leaves open, and which option answers it.

use super::{Calibration, Length, Nearest, Tdc};
use dtof_options::rows::Row;

/// What a reader of the settings has to know: a topic, and a sentence or two on it.
#[must_use]
pub fn remarks(found: &Calibration) -> Vec<Row> {
    let mut remarks = Vec::new();
    let mut say = |topic: &str, text: String| remarks.push((topic.to_owned(), text));
    match found.length {
        Length::Cycles(_) => {}
        Length::PhotonsPerCycle(rate) => say(
            "rates",
            format!(
                "Rates rest on --photons-per-cycle {rate}: an assumption. --recorded-cycles N makes them \
             absolute and tells whether there is pile-up."
            ),
        ),
        Length::Unknown => say(
            "rates",
            "How long the recording lasted is not known, so background, glass and z are not \
             written: say --recorded-cycles N. The gate is that for one photon a laser cycle in \
             the brightest pixel, as replay takes it."
                .to_owned(),
        ),
    }
    match &found.nearest {
        Nearest::WallOrGlass(bin) => say(
            "cover glass",
            format!(
                "All pixels see a surface at bin {bin}. Whether it is a wall or a cover glass the recording does \
             not tell: nothing lies behind it, or there are too few pixels. It is taken as a wall. \
             --glass yes takes it as a glass, --glass no confirms the wall."
            ),
        ),
        Nearest::Glass(glass) if glass.end == 0 => say(
            "cover glass",
            format!(
                "There is a cover glass at bin {}, so dim that it needs no gate.",
                glass.top
            ),
        ),
        Nearest::Glass(glass) if glass.has_tail => {
            let (low, high) = glass.end_between;
            say(
                "cover glass",
                format!(
                    "The cover glass has a tail: where it ends, bin {low} to {high}, comes from the \
                 photons, not from the shape of the pulse."
                ),
            );
        }
        _ => {}
    }
    match &found.pulse {
        None => say(
            "pulse",
            "No peak is bright enough to measure the pulse: record a target, or say --sigma-bins \
             when you replay."
                .to_owned(),
        ),
        Some(pulse) if pulse.sigma > 1.75 => say(
            "pulse",
            "The pulse is wider than the widest window, which suits 1.75 bins: that is written. \
             Wider bins suit it better."
                .to_owned(),
        ),
        Some(pulse) if pulse.is_core => say(
            "pulse",
            if pulse.tail < 0.005 {
                "The pulse is no Gaussian: its sides fall faster or more slowly. The standard deviation \
                 is that of its core."
                    .to_owned()
            } else {
                format!(
                    "The pulse is no Gaussian: {:.1} % of its photons come more than three standard \
                     deviations late. The standard deviation is that of its core.",
                    pulse.tail * 100.0
                )
            },
        ),
        Some(_) => {}
    }
    if let Some(suited) = found.pulse.as_ref().and_then(|pulse| pulse.suited) {
        say(
            "depth",
            format!(
                "The depth comes from a window that reaches {} bins before its place and {} after it: 16 \
                 photons of the pulse are off by {:.2} bins in the mean, with equal half widths by {:.2}.",
                suited.window.before(),
                suited.window.after(),
                suited.error,
                suited.equal
            ),
        );
    }
    match found.tdc {
        Some(Tdc::OneHit(lost)) => {
            let even = if lost > 0.1 {
                " Rules take the background as even: near bins, which have more of it, bring false \
                 alarms. Less light helps, or a gate."
            } else {
                ""
            };
            say(
                "pile-up",
                format!(
                    "The background falls as it does with a TDC that takes one photon a laser \
                     cycle: {:.1} % of the photons are lost. Rates are corrected for that.{even}",
                    lost * 100.0
                ),
            );
        }
        Some(Tdc::Unclear(lost)) if lost > 0.01 => say(
            "pile-up",
            format!(
                "If the TDC takes one photon a laser cycle, {:.1} % of the photons are lost. The \
             background does not tell.",
                lost * 100.0
            ),
        ),
        _ => {}
    }
    if found
        .detection
        .is_some_and(|detection| detection.is_by_count)
    {
        say(
            "z",
            format!(
                "There is so little background that the fewest photons of an event keep false alarms \
             below {} %: z is the least that is written.",
                found.detection.map_or(0.0, |of| of.false_alarm) * 100.0
            ),
        );
    }
    if found.offset.is_none() {
        let what = match found.target_mm {
            Some(distance) => format!(
                "--target-mm {distance} was not used: no more than half of the pixels see a surface at \
                 one range. Put a flat target before more of them."
            ),
            None => {
                "The range offset is not known: put a flat target at a known distance before more \
                     than half of the pixels, and say --target-mm D."
                    .to_owned()
            }
        };
        say("offset", what);
    }
    remarks
}
