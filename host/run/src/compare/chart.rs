//! The chart of a comparison: time to a report against its error.

use anyhow::Result;
use dtof_draw::chart::{Axis, Chart, Panel, Point, Series, Style, chart};
use dtof_draw::palette;

use super::Comparison;
use super::method::Method;

impl Comparison {
    /// A number of laser cycles in the unit of the chart.
    pub(super) fn time(&self, cycles: f64) -> f64 {
        self.laser_hz.map_or(cycles, |hz| cycles * 1e6 / hz as f64)
    }

    /// The unit of time of the chart.
    const fn unit(&self) -> &'static str {
        match self.laser_hz {
            Some(_) => "µs",
            None => "laser cycles",
        }
    }

    /// The chart: time to a report against its error, a curve a method.
    ///
    /// # Errors
    /// Fails if there is nothing to draw.
    pub fn chart(&self) -> Result<String> {
        let frames = self.methods.len() - 1;
        let panel = |title: &str, is_first: bool, is_in: &dyn Fn(&Method) -> bool| {
            let numbers = (0..frames).filter(|&number| is_in(&self.methods[number]));
            let series: Vec<Series> = numbers.filter_map(|number| self.series(number)).collect();
            let others = self.series(frames).into_iter().chain(self.bound_series());
            let others = others.chain(self.rings(is_in));
            (is_first || !series.is_empty()).then(|| Panel {
                title: title.to_owned(),
                series: series.into_iter().chain(others).collect(),
            })
        };
        let has_more = |method: &Method| method.has_full_resolution() && !method.is_single();
        let panels = [
            panel(
                "each pixel and exposure by itself",
                true,
                &Method::is_single,
            ),
            panel("every pixel, with neighbours or tracking", false, &has_more),
            panel("blocks: fewer places", false, &|method| {
                !method.has_full_resolution()
            }),
        ];
        let (finding, holds) = self.finding();
        chart(&Chart {
            finding,
            holds,
            note: self.note(),
            x: Axis::logarithmic(format!("time to a report, {}", self.unit())),
            y: Axis::logarithmic("error of a report, mm"),
            key: Vec::new(),
            columns: 1,
            panels: panels.into_iter().flatten().collect(),
        })
    }

    /// Explains dots and names of the chart.
    fn note(&self) -> String {
        format!(
            "A dot is a minimum count of photons, or a length of frames. A ring is around the answer. All \
             rules have at most the same rate of false alarms. Beside a name: instructions a laser cycle and \
             pixel on a Cortex-M4F. Times are those of the middle half of the pixels. 68 % of the errors are \
             smaller; {}.",
            self.truth.description()
        )
    }

    /// A ring around each point of the answer whose method `is_in` the panel.
    fn rings(&self, is_in: &dyn Fn(&Method) -> bool) -> impl Iterator<Item = Series> {
        let answer = [("take", self.answer.best), ("fastest", self.answer.fastest)];
        let rings = answer.map(|(name, choice)| {
            let choice = choice.filter(|choice| is_in(&self.methods[choice.method]))?;
            let point = Point::exact(self.time(choice.cycles), choice.error_mm);
            Some(Series::named(
                name,
                palette::NEUTRAL,
                Style::Ring,
                vec![point],
            ))
        });
        rings.into_iter().flatten()
    }

    fn series(&self, number: usize) -> Option<Series> {
        let method = &self.methods[number];
        let drawn = self
            .of(number)
            .filter(|outcome| outcome.figures.error_mm > 0.0);
        let points: Vec<Point> = drawn
            .map(|outcome| {
                Point::exact(self.time(outcome.figures.cycles), outcome.figures.error_mm)
            })
            .collect();
        let cost = self.of(number).next()?.instructions;
        let name = format!("{} ({cost:.0})", method.name);
        (!points.is_empty()).then(|| Series::named(name, method.pen, Style::JoinedDots, points))
    }

    fn bound_series(&self) -> Option<Series> {
        let bound = self.bound?;
        let longest = self.outcomes.iter().map(|outcome| outcome.figures.cycles);
        let longest = longest
            .filter(|cycles| cycles.is_finite())
            .fold(0.0, f64::max);
        let steps = 24;
        let each = (longest / bound.cycles)
            .max(1.0)
            .powf(1.0 / f64::from(steps));
        let cycles = (0..=steps).map(|step| bound.cycles * each.powi(step));
        let points = cycles.map(|cycles| Point::exact(self.time(cycles), bound.error_mm(cycles)));
        let name = "bound of a pixel";
        Some(Series::named(
            name,
            palette::REFERENCE,
            Style::Line,
            points.collect(),
        ))
    }
}
