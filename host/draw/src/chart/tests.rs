use proptest::prelude::*;

use super::names::{Area, Label, Taken, beside, spread};
use super::scale::{GAP, Scale, number};
use super::*;
use crate::palette::{self, EVENTS, NEUTRAL};
use crate::svg::{Anchor, text_width};

/// A chart of `points`, joined, with a name.
fn of(logarithmic: bool, points: Vec<Point>) -> Chart {
    let axis = |label| Axis {
        logarithmic,
        ..Axis::linear(label)
    };
    let series = Series::named("series", EVENTS, Style::JoinedDots, points);
    Chart {
        finding: "A <title> & more".to_owned(),
        holds: true,
        note: "A note.".to_owned(),
        x: axis("x"),
        y: axis("y"),
        key: Vec::new(),
        columns: 1,
        panels: vec![Panel::only(vec![series])],
    }
}

fn dots(svg: &str) -> usize {
    svg.matches("<circle").count()
}

#[test]
fn every_point_with_a_place_is_a_dot() {
    let points: Vec<Point> = [-1.0, 0.0, 1.0, 10.0, f64::NAN]
        .map(|value| Point::exact(value, value))
        .to_vec();
    let linear = chart(&of(false, points.clone())).unwrap();
    let logarithmic = chart(&of(true, points.clone())).unwrap();
    assert_eq!((dots(&linear), dots(&logarithmic)), (4, 2));
    assert!(linear.contains("A &lt;title&gt; &amp; more"));
    let mut narrow = of(false, points);
    narrow.x = narrow.x.within(0.5, 20.0);
    assert_eq!(dots(&chart(&narrow).unwrap()), 2);
}

#[test]
fn zero_is_an_upper_limit_on_a_logarithmic_axis() {
    let zero = Point {
        interval: Some((0.0, 0.5)),
        ..Point::exact(2.0, 0.0)
    };
    let points = vec![Point::exact(1.0, 0.1), zero, Point::exact(3.0, 1.0)];
    let svg = chart(&of(true, points)).unwrap();
    assert_eq!(dots(&svg), 3);
    assert_eq!(svg.matches("<circle class=\"open\"").count(), 1, "{svg}");
}

#[test]
fn nothing_to_draw_is_an_error() {
    assert!(chart(&of(false, vec![])).is_err());
    assert!(chart(&of(true, vec![Point::exact(0.0, 1.0)])).is_err());
}

#[test]
fn a_title_says_if_the_data_do_not_show_the_finding() {
    let mut chart_of = of(false, vec![Point::exact(0.0, 1.0)]);
    chart_of.holds = false;
    let svg = chart(&chart_of).unwrap();
    assert!(svg.contains("<title>These data do not show: A &lt;title"));
}

#[test]
fn a_counting_axis_begins_at_zero() {
    let scale = Scale::new(&Axis::linear("n"), [7.0, 9.0].into_iter()).unwrap();
    assert_eq!(scale.position(0.0), 0.0);
    assert!(scale.position(9.0) < 1.0);
}

#[test]
fn numbers_have_no_more_digits_than_they_need() {
    let texts = [0.0, 0.1 + 0.2, 2000.0, 1e4, 1e-4, 2e-5, 1e6, -0.5].map(number);
    let expected = [
        "0",
        "0.3",
        "2000",
        "10,000",
        "10⁻⁴",
        "2·10⁻⁵",
        "10⁶",
        "−0.5",
    ];
    assert_eq!(texts, expected);
}

#[test]
fn a_logarithmic_axis_labels_decades_and_2_and_5_where_there_is_room() {
    let scale = |low, high| {
        let axis = Axis::logarithmic("x").within(low, high);
        Scale::new(&axis, [low, high].into_iter()).unwrap()
    };
    let labels = |scale: &Scale, length| {
        let ticks = scale.ticks(length, (f64::INFINITY, f64::INFINITY), |label| {
            text_width(label, 14.0)
        });
        ticks.into_iter().map(|tick| tick.label).collect::<Vec<_>>()
    };
    let two = scale(1.0, 100.0);
    assert_eq!(
        labels(&two, 300.0),
        ["1", "2", "5", "10", "20", "50", "100"]
    );
    assert_eq!(labels(&two, 130.0), ["1", "10", "100"]);
    let many = scale(1e-8, 1.0);
    assert_eq!(labels(&many, 200.0), ["10⁻⁸", "10⁻⁶", "10⁻⁴", "0.01", "1"]);
    assert_eq!(labels(&scale(0.95, 2.2), 300.0), ["1", "1.2", "1.5", "2"]);
}

#[test]
fn a_label_that_would_be_cut_is_left_out() {
    let axis = Axis::linear("x").within(0.0, 0.121);
    let scale = Scale::new(&axis, [0.1].into_iter()).unwrap();
    // "0.12" has its middle at 297.5 of 300.
    let labels = |low, high| {
        let ticks = scale.ticks(300.0, (low, high), |label| 7.0 * label.len() as f64);
        ticks.into_iter().map(|tick| tick.label).collect::<Vec<_>>()
    };
    let all = ["0", "0.02", "0.04", "0.06", "0.08", "0.1", "0.12"];
    assert_eq!(labels(4.0, 12.0), all);
    assert_eq!(labels(4.0, 11.0), all[..6]);
    assert_eq!(labels(3.0, 12.0), all[1..]);
}

proptest! {
    /// Labels do not touch, for any range and length, and extend no further than there is room.
    /// There is at least one if there is room for any.
    #[test]
    fn ticks_never_touch(
        logarithmic: bool,
        percent: bool,
        low in -12.0..6.0_f64,
        span in 0.01..12.0_f64,
        shift in -2.0..2.0_f64,
        length in 20.0..800.0_f64,
        size in 8.0..24.0_f64,
        room in prop_oneof![Just((f64::INFINITY, f64::INFINITY)), (0.0..40.0_f64, 0.0..40.0_f64)],
    ) {
        let (from, to) = if logarithmic {
            (10f64.powf(low), 10f64.powf(low + span))
        } else {
            let width = 10f64.powf(low);
            (shift * width, (shift + 1.0) * width)
        };
        let axis = Axis { logarithmic, ..Axis::linear("x") }.within(from, to);
        let axis = if percent { axis.percent() } else { axis };
        let scale = Scale::new(&axis, [from, to].into_iter()).unwrap();
        let size_of = |label: &str| text_width(label, size);
        let ticks = scale.ticks(length, room, size_of);
        for pair in ticks.windows(2) {
            let [first, second] = [&pair[0], &pair[1]].map(|tick| {
                (length * scale.position(tick.value), size_of(&tick.label) / 2.0)
            });
            prop_assert!(first.0 + first.1 + GAP <= second.0 - second.1, "{pair:?}");
            prop_assert!(pair[0].label != pair[1].label, "{pair:?}");
        }
        for tick in &ticks {
            let position = scale.position(tick.value);
            prop_assert!((-1e-6..=1.0 + 1e-6).contains(&position), "{tick:?}");
            let (middle, half) = (length * position, size_of(&tick.label) / 2.0);
            prop_assert!(middle - half >= -room.0 && middle + half <= length + room.1, "{tick:?}");
        }
        // Less than a third of a decade may lie between two round numbers.
        prop_assert!(!ticks.is_empty() || room.0.is_finite() || (logarithmic && span < 0.5));
        if ticks.is_empty() {
            for tick in scale.ticks(length, (f64::INFINITY, f64::INFINITY), size_of) {
                let (middle, half) = (length * scale.position(tick.value), size_of(&tick.label) / 2.0);
                prop_assert!(middle - half < -room.0 || middle + half > length + room.1, "{tick:?}");
            }
        }
    }

    /// Names keep their order and do not overlap if there is space for all.
    #[test]
    fn names_never_overlap(ends in prop::collection::vec(0.0..300.0_f64, 1..12)) {
        let labels: Vec<Label> = ends.iter().map(|&y| Label { y, height: 20.0 }).collect();
        let mut places = spread(&labels, 0.0, 300.0);
        for (end, place) in ends.iter().zip(&places) {
            prop_assert!((9.9..=290.1).contains(place), "{end} {place}");
        }
        places.sort_by(f64::total_cmp);
        prop_assert!(places.windows(2).all(|pair| pair[1] - pair[0] > 19.99), "{places:?}");
    }
}

#[test]
fn a_name_alone_stands_where_its_curve_ends() {
    let labels = [50.0, 200.0].map(|y| Label { y, height: 20.0 });
    assert_eq!(spread(&labels, 0.0, 300.0), [50.0, 200.0]);
}

#[test]
fn a_name_beside_a_dot_takes_the_first_free_place() {
    let bounds = Area::around((0.0, 0.0), (200.0, 100.0), 0.0);
    let mut taken = Taken::default();
    let found = |dot, taken: &Taken| beside(&[dot], (60.0, 18.0), &bounds, taken);
    let spot = found((20.0, 50.0), &taken).unwrap();
    assert_eq!(
        (spot.x, spot.area.top, spot.anchor),
        (29.0, 41.0, Anchor::Start)
    );
    assert_eq!(spot.line, None);
    // No room to the right.
    let spot = found((190.0, 50.0), &taken).unwrap();
    assert_eq!(
        (spot.x, spot.area.top, spot.anchor),
        (181.0, 41.0, Anchor::End)
    );
    let there = Area::around((25.0, 40.0), (100.0, 60.0), 0.0);
    taken.dots.push(there);
    let spot = found((20.0, 50.0), &taken).unwrap();
    assert!(!(22.0..60.0).contains(&spot.area.top), "{spot:?}");
    // A place that is far has a line to the dot.
    taken
        .dots
        .push(Area::around((0.0, 25.0), (200.0, 75.0), 0.0));
    assert!(found((20.0, 50.0), &taken).unwrap().line.is_some());
    // A line across all places.
    for y in [10.0, 30.0, 50.0, 70.0, 90.0] {
        taken.lines.push(((-100.0, y), (300.0, y)));
    }
    assert!(found((20.0, 50.0), &taken).is_none());
}

#[test]
fn a_name_without_a_place_stands_in_a_legend() {
    // A dense zigzag leaves no room.
    let zigzag = (0..400).map(|step| Point::exact(f64::from(step), f64::from(step % 2)));
    let mut crowded = of(false, zigzag.collect());
    let ring = Series::named("taken", NEUTRAL, Style::Ring, vec![Point::exact(90.0, 0.5)]);
    crowded.panels[0].series.push(ring);
    let svg = chart(&crowded).unwrap();
    // One ring in the plot, one in the legend.
    assert_eq!(svg.matches("r=\"7\"").count(), 2, "{svg}");
    assert_eq!(svg.matches(">taken</text>").count(), 1);
    crowded.panels[0].series.remove(0);
    let svg = chart(&crowded).unwrap();
    assert_eq!(svg.matches("r=\"7\"").count(), 1, "{svg}");
    assert_eq!(svg.matches(">taken</text>").count(), 1);
}

#[test]
fn the_same_chart_gives_the_same_bytes_and_one_thing_one_colour() {
    let points = vec![Point::exact(1.0, 1.0), Point::exact(2.0, 3.0)];
    let once = chart(&of(false, points.clone())).unwrap();
    assert_eq!(once, chart(&of(false, points)).unwrap());
    assert!(once.contains("<g class=\"c0\">") && once.contains("class=\"c0 halo\""));
    assert_eq!(palette::window(3), palette::STEPS[2]);
}
