//! No text of a chart touches a curve, a dot, an axis or another text.

use std::fs;
use std::path::Path;

use dtof_draw::chart::{Axis, Chart, Key, Panel, Point, Series, Style, chart};
use dtof_draw::palette::STEPS;
use dtof_draw::svg::{BOLD, text_width};
use proptest::prelude::*;

type Place = (f64, f64);

/// The box of a text, and its letters.
#[derive(Clone, Debug)]
struct Text {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    letters: String,
}

/// A stroke, or a part of an outline: a line and half of its width. A round dot is a line without length.
type Stroke = (Place, Place, f64);

/// The texts and strokes of a document. The grid lies below all texts and is left out.
fn read(svg: &str) -> (Vec<Text>, Vec<Stroke>) {
    let (mut texts, mut strokes) = (Vec::new(), Vec::new());
    for element in svg.split('<').skip(1) {
        let (tag, content) = element.split_once('>').unwrap();
        let attribute = |name: &str| {
            let (_, value) = tag.split_once(&format!(" {name}=\""))?;
            Some(value.split_once('"')?.0)
        };
        let number = |name: &str| attribute(name).map(|text| text.parse::<f64>().unwrap());
        let class = attribute("class").unwrap_or_default();
        let is_drawn = ["stroke", "fill", "open", "edge"]
            .iter()
            .any(|drawn| class.split(' ').any(|class| class == *drawn));
        let half = number("stroke-width").unwrap_or(1.0) / 2.0;
        match tag.split(' ').next() {
            Some("text") => {
                let (x, y, size) = (
                    number("x").unwrap(),
                    number("y").unwrap(),
                    number("font-size").unwrap(),
                );
                let letters = ["lt;<", "gt;>", "quot;\"", "#39;'", "amp;&"];
                let letters = letters.iter().fold(content.to_owned(), |text, entity| {
                    let (name, letter) = entity.split_at(entity.len() - 1);
                    text.replace(&format!("&{name}"), letter)
                });
                let is_bold = ["title", "panel"].iter().any(|bold| class.ends_with(bold));
                let width = text_width(&letters, size) * if is_bold { BOLD } else { 1.0 };
                let left = match attribute("text-anchor") {
                    Some("middle") => x - width / 2.0,
                    Some("end") => x - width,
                    _ => x,
                };
                texts.push(Text {
                    left,
                    right: left + width,
                    // Capital letters, and the strokes of g and y.
                    top: y - 0.73 * size,
                    bottom: y + 0.21 * size,
                    letters,
                });
            }
            Some("polyline") if is_drawn => {
                let points = attribute("points").unwrap().split(' ');
                let places: Vec<Place> = points
                    .map(|point| {
                        let (x, y) = point.split_once(',').unwrap();
                        (x.parse().unwrap(), y.parse().unwrap())
                    })
                    .collect();
                strokes.extend(places.windows(2).map(|ends| (ends[0], ends[1], half)));
            }
            Some("circle") if is_drawn => {
                let middle = (number("cx").unwrap(), number("cy").unwrap());
                strokes.push((middle, middle, number("r").unwrap()));
            }
            Some("path") if is_drawn => {
                strokes.extend(
                    lines_of(attribute("d").unwrap())
                        .into_iter()
                        .map(|(from, to)| (from, to, half)),
                );
            }
            _ => {}
        }
    }
    (texts, strokes)
}

/// The lines of a path of M, L, H, V, their relative forms, and z.
fn lines_of(path: &str) -> Vec<(Place, Place)> {
    let mut lines = Vec::new();
    let (mut start, mut at) = ((0.0, 0.0), (0.0, 0.0));
    let mut rest = path;
    while let Some(command) = rest.chars().next() {
        rest = &rest[1..];
        let end = rest.find(char::is_alphabetic).unwrap_or(rest.len());
        let numbers: Vec<f64> = rest[..end]
            .split_whitespace()
            .map(|number| number.parse().unwrap())
            .collect();
        rest = &rest[end..];
        let to = match (command, &numbers[..]) {
            ('M' | 'L', &[x, y]) => (x, y),
            ('m' | 'l', &[x, y]) => (at.0 + x, at.1 + y),
            ('H', &[x]) => (x, at.1),
            ('V', &[y]) => (at.0, y),
            ('h', &[x]) => (at.0 + x, at.1),
            ('v', &[y]) => (at.0, at.1 + y),
            ('z', []) => start,
            _ => panic!("{path}: {command} {numbers:?}"),
        };
        if matches!(command, 'M' | 'm') {
            start = to;
        } else {
            lines.push((at, to));
        }
        at = to;
    }
    lines
}

/// Whether a stroke touches the box of a text.
fn touches(text: &Text, &(from, to, half): &Stroke) -> bool {
    // The part of the line that lies within the box, enlarged by half of the stroke, is cut side by side.
    let (mut first, mut last) = (0.0f64, 1.0f64);
    for (from, to, low, high) in [
        (from.0, to.0, text.left - half, text.right + half),
        (from.1, to.1, text.top - half, text.bottom + half),
    ] {
        let step = to - from;
        if step == 0.0 {
            if from < low || from > high {
                return false;
            }
        } else {
            let ends = [(low - from) / step, (high - from) / step];
            first = first.max(ends[0].min(ends[1]));
            last = last.min(ends[0].max(ends[1]));
        }
    }
    first <= last
}

/// What touches a text of a document, and texts that are cut.
fn touching(svg: &str) -> Vec<String> {
    let (texts, strokes) = read(svg);
    let width = svg.split_once("width=\"").unwrap().1;
    let width: f64 = width.split_once('"').unwrap().0.parse().unwrap();
    let cut = texts
        .iter()
        .filter(|text| text.left < 0.0 || text.right > width);
    let mut found: Vec<String> = cut
        .map(|text| format!("{:?} is cut", text.letters))
        .collect();
    for (index, text) in texts.iter().enumerate() {
        for other in &texts[index + 1..] {
            let apart = text.right < other.left
                || other.right < text.left
                || text.bottom < other.top
                || other.bottom < text.top;
            if !apart {
                found.push(format!("{:?} touches {:?}", text.letters, other.letters));
            }
        }
        if let Some(stroke) = strokes.iter().find(|stroke| touches(text, stroke)) {
            found.push(format!("{:?} touches {stroke:?}", text.letters));
        }
    }
    found
}

#[test]
fn labels_of_the_kept_figures_touch_nothing() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/figures");
    let mut charts = 0;
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let file = entry.unwrap().path();
        if file.extension().is_none_or(|extension| extension != "svg") {
            continue;
        }
        let svg = fs::read_to_string(&file).unwrap();
        // Charts have an axis. Maps and movies move groups; diagrams have rounded boxes.
        if svg.contains("class=\"edge\"") && !svg.contains("transform=") && !svg.contains(" rx=") {
            charts += 1;
            let name = file.file_name().unwrap().to_string_lossy().into_owned();
            found.extend(touching(&svg).iter().map(|what| format!("{name}: {what}")));
        }
    }
    assert!(charts > 40, "{charts} charts");
    assert!(found.is_empty(), "{charts} charts\n{}", found.join("\n"));
}

/// A chart of one ring, which has no name beside the plot.
fn ring(title: &str, (x, y): (f64, f64), range: Option<(f64, f64)>) -> String {
    let axis = Axis::linear("a quantity, unit");
    let drawn = chart(&Chart {
        finding: "A finding".to_owned(),
        holds: true,
        note: "A note".to_owned(),
        x: axis.clone(),
        y: Axis { range, ..axis },
        key: Vec::new(),
        columns: 1,
        panels: vec![Panel {
            title: title.to_owned(),
            series: vec![Series::named(
                "a",
                STEPS[0],
                Style::Ring,
                vec![Point::exact(x, y)],
            )],
        }],
    });
    drawn.unwrap()
}

#[test]
fn a_label_at_the_end_of_an_axis_is_not_cut() {
    // The axis ends at 0.1203.
    let drawn = ring("", (0.113_494, 5.0), None);
    assert_eq!(touching(&drawn), [""; 0]);
    assert!(
        drawn.contains(">0.1</text>") && !drawn.contains(">0.12</text>"),
        "{drawn}"
    );
}

#[test]
fn a_title_as_wide_as_its_panel_is_not_cut() {
    let title = "aawaaini amakkaakama maia kakaa aiaaaaaama adawaaaaa";
    let drawn = ring(title, (0.01, 0.1), Some((0.05, 0.3)));
    assert_eq!(touching(&drawn), [""; 0]);
    assert_eq!(drawn.matches("ink panel").count(), 2);
}

/// Curves of any form: their names, kinds and points.
fn panels(most: usize) -> impl Strategy<Value = Vec<Panel>> {
    let style = prop::sample::select(vec![
        Style::Line,
        Style::Dashed,
        Style::Dots,
        Style::JoinedDots,
        Style::Ring,
    ]);
    let point = (0.01..1.0_f64, 0.01..1.0_f64, 0.0..0.3_f64);
    let points = prop::collection::vec(point, 1..20);
    let series = (
        "[a-z]{1,9}( [a-z0-9]{1,12}){0,3}",
        style,
        0..7_usize,
        points,
    );
    let series = series.prop_map(|(name, style, pen, mut points)| {
        points.sort_by(|one, other| one.0.total_cmp(&other.0));
        if style == Style::Ring {
            points.truncate(1);
        }
        let points = points.into_iter().map(|(x, y, half)| Point {
            interval: (half > 0.1).then_some(((y - half).max(0.001), y + half)),
            ..Point::exact(x, y)
        });
        Series::named(name, STEPS[pen], style, points.collect())
    });
    // A word that is wider than its panel cannot be wrapped.
    let title = "[a-z]{0,12}( [a-z]{1,12}){0,5}";
    let panel = (title, prop::collection::vec(series, 1..9));
    let panel = panel.prop_map(|(title, series)| Panel { title, series });
    prop::collection::vec(panel, 1..=most)
}

proptest! {
    #[test]
    fn labels_of_any_chart_touch_nothing(
        panels in panels(4),
        columns in 1..3_usize,
        logarithmic: [bool; 2],
        keys in prop::collection::vec("[a-z ]{1,30}", 0..5),
        range in prop::option::of(0.3..0.9_f64),
    ) {
        let axis = |logarithmic| Axis { logarithmic, ..Axis::linear("a quantity, unit") };
        let mut y = axis(logarithmic[1]);
        y.range = range.map(|high| (0.05, high));
        let drawn = chart(&Chart {
            finding: "A finding of some length, which may need two lines".to_owned(),
            holds: true,
            note: "A note of some length, which needs two lines as most of the others do".to_owned(),
            x: axis(logarithmic[0]),
            y,
            key: keys.into_iter().map(|text| Key::new(STEPS[0], Style::Ring, text)).collect(),
            columns,
            panels,
        });
        let found = touching(&drawn.unwrap());
        prop_assert!(found.is_empty(), "{}", found.join("\n"));
    }
}
