//! The window rule.

use anyhow::{Result, ensure};
use dtof_core::{CentredWindow, DepthEstimator};
use dtof_data::options::Refused;
use dtof_data::options::numbers::shortest;
use dtof_light::progress::Progress;
use dtof_light::tune::{Request, window};

use super::{Line, Options, counted, l1, number};

impl Options {
    /// z and L1, what to expect of them, and the options for them.
    pub(super) fn window(
        &self,
        request: &Request,
        progress: Progress,
    ) -> Result<(Vec<Line>, String)> {
        let widest = CentredWindow::WIDEST_PULSE;
        ensure!(
            request.sigma <= widest.to_num::<f64>(),
            Refused::input(format!(
                "a pulse of σ = {} bins is too wide for a window, which is for {widest} bins at most; take \
                 wider bins, or `rule` paper",
                number(request.sigma)
            ))
        );
        let tuned = window::tune(request, progress)?;
        let z = format!(
            "for a false alarm in {} exposures; simulation: table",
            tuned.one_in
        );
        let window = "formula: 2 up to σ = 0.6 bins, 3 up to 1.25, 5 above";
        let mut lines = vec![
            Line("z", tuned.z.to_num(), z),
            Line("window", tuned.window.into(), window.to_owned()),
        ];
        if let DepthEstimator::CentredWindow(window) = tuned.estimator {
            let source = "formula: 2σ + 1/2, from 1 to 4; centred window".to_owned();
            lines.push(Line("half_width", window.after().to_num(), source));
        }
        lines.extend([
            l1(request, tuned.l1, &tuned.detections),
            counted(request, tuned.false_alarms),
        ]);
        lines.extend(self.expected(request, &tuned.detections));
        let binning = match request.levels.raw() {
            0 => String::new(),
            levels => format!(" --binning {levels}"),
        };
        let options = format!(
            "--rule window --sigma-bins {} --z {} --l1 {}{binning}",
            shortest(tuned.sigma),
            shortest(tuned.z),
            tuned.l1
        );
        Ok((lines, options))
    }
}
