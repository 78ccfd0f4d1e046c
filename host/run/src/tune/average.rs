//! The average rule.

use anyhow::Result;
use dtof_data::options::numbers::shortest;
use dtof_light::progress::Progress;
use dtof_light::tune::{Request, average};

use super::{Line, Options, counted, l1};

impl Options {
    /// α and L1, what to expect of them, and the options for them.
    pub(super) fn average(
        &self,
        request: &Request,
        progress: Progress,
    ) -> Result<(Vec<Line>, String)> {
        let tuned = average::tune(request, progress)?;
        let alpha = format!(
            "lowest for these false alarms; simulation: seed {}, {} exposures without a target",
            request.seed, tuned.exposures
        );
        let mut lines = vec![
            Line("alpha", tuned.alpha.to_num(), alpha),
            l1(request, tuned.l1, &tuned.detections),
            counted(request, tuned.false_alarms),
        ];
        lines.extend(self.expected(request, &tuned.detections));
        let options = format!(
            "--rule average --estimator centroid --alpha {} --l1 {}",
            shortest(tuned.alpha),
            tuned.l1
        );
        Ok((lines, options))
    }
}
