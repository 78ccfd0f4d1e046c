//! Places names so that they touch neither each other nor what is drawn.

use crate::svg::Anchor;

/// A name beside the plot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Label {
    /// The y at which its curve ends.
    pub y: f64,
    /// The height of its text.
    pub height: f64,
}

/// The middles of `labels` in a column from `top` to `bottom`, as close as possible to the ends
/// of their curves, in the same order. The column has room for all.
pub(super) fn spread(labels: &[Label], top: f64, bottom: f64) -> Vec<f64> {
    let mut order: Vec<usize> = (0..labels.len()).collect();
    order.sort_by(|&a, &b| labels[a].y.total_cmp(&labels[b].y));
    // Names that touch form a block around the mean of their curve ends.
    let mut blocks: Vec<Vec<usize>> = Vec::new();
    let height = |block: &[usize]| {
        let heights = block.iter().map(|&index| labels[index].height);
        heights.sum::<f64>()
    };
    let start = |block: &[usize]| {
        let mut above = 0.0;
        let mut sum = 0.0;
        for &index in block {
            let height = labels[index].height;
            sum += labels[index].y - above - height / 2.0;
            above += height;
        }
        let mean = sum / block.len() as f64;
        mean.min(bottom - above).max(top)
    };
    for index in order {
        blocks.push(vec![index]);
        while let [.., above, below] = &blocks[..] {
            if start(above) + height(above) <= start(below) {
                break;
            }
            let below = blocks.pop().unwrap_or_default();
            if let Some(above) = blocks.last_mut() {
                above.extend(below);
            }
        }
    }
    let mut places = vec![0.0; labels.len()];
    for block in blocks {
        let mut y = start(&block);
        for index in block {
            let height = labels[index].height;
            places[index] = y + height / 2.0;
            y += height;
        }
    }
    places
}

/// A rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Area {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

impl Area {
    /// The area between two corners, enlarged by `margin` on every side.
    pub fn around(from: (f64, f64), to: (f64, f64), margin: f64) -> Self {
        Self {
            left: from.0.min(to.0) - margin,
            top: from.1.min(to.1) - margin,
            right: from.0.max(to.0) + margin,
            bottom: from.1.max(to.1) + margin,
        }
    }

    fn grown(&self, margin: f64) -> Self {
        Self::around((self.left, self.top), (self.right, self.bottom), margin)
    }

    fn overlaps(&self, other: &Self) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }

    fn is_in(&self, bounds: &Self) -> bool {
        bounds.left <= self.left
            && self.right <= bounds.right
            && bounds.top <= self.top
            && self.bottom <= bounds.bottom
    }

    /// A line from close to a dot outside to the nearest point of the area, up to a small gap.
    fn line_from(&self, dot: Place) -> Line {
        let end = (
            dot.0.clamp(self.left, self.right),
            dot.1.clamp(self.top, self.bottom),
        );
        let length = (end.0 - dot.0).hypot(end.1 - dot.1);
        let at = |part: f64| {
            (
                dot.0 + (end.0 - dot.0) * part,
                dot.1 + (end.1 - dot.1) * part,
            )
        };
        (at(7.0 / length), at(1.0 - 2.0 / length))
    }

    /// Whether a line enters the area.
    fn is_crossed(&self, &(from, to): &Line) -> bool {
        // The part of the line between its sides, as shares of its length.
        let between = |from: f64, to: f64, low: f64, high: f64| {
            let (one, other) = ((low - from) / (to - from), (high - from) / (to - from));
            match from == to {
                true if (low..=high).contains(&from) => (0.0, 1.0),
                true => (1.0, 0.0),
                false => (one.min(other), one.max(other)),
            }
        };
        let across = between(from.0, to.0, self.left, self.right);
        let down = between(from.1, to.1, self.top, self.bottom);
        across.0.max(down.0).max(0.0) <= across.1.min(down.1).min(1.0)
    }
}

/// A point of the picture.
pub(super) type Place = (f64, f64);
/// A straight line between two points.
pub(super) type Line = (Place, Place);

/// What is drawn in a plot. Names stay clear of it.
#[derive(Clone, Debug, Default)]
pub(super) struct Taken {
    /// Lines of curves, and lines to names.
    pub lines: Vec<Line>,
    /// Dots and intervals.
    pub dots: Vec<Area>,
    /// Names.
    pub names: Vec<Area>,
}

/// The place of a name.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    pub area: Area,
    /// The x of its text, and the part of the text that lies there.
    pub x: f64,
    pub anchor: Anchor,
    /// A line from its dot, if that is not close.
    pub line: Option<Line>,
}

/// The gap between a name and what is drawn.
const CLEAR: f64 = 3.0;
/// Other fonts than those that are measured need more width by this factor.
const WIDER: f64 = 1.05;
/// The distances of a name from its dot. A line leads to a name that is far.
const NEAR: [f64; 3] = [9.0, 13.0, 18.0];
const FAR: [f64; 6] = [23.0, 32.0, 43.0, 57.0, 75.0, 100.0];
/// The directions from a dot to its name, across and down.
const DIRECTIONS: [(f64, f64); 12] = [
    (1.0, 0.0),
    (-1.0, 0.0),
    (1.0, -1.0),
    (1.0, 1.0),
    (0.0, -1.0),
    (0.0, 1.0),
    (-1.0, -1.0),
    (-1.0, 1.0),
    (0.5, -1.0),
    (0.5, 1.0),
    (-0.5, -1.0),
    (-0.5, 1.0),
];

/// The first free place within `bounds` for a name of this `size` beside one of the `dots`, if there is one.
/// The first of the dots is the end of the curve.
pub(super) fn beside(
    dots: &[Place],
    size: (f64, f64),
    bounds: &Area,
    taken: &Taken,
) -> Option<Spot> {
    let (width, height) = (size.0 * WIDER, size.1);
    let spot = |(x, y): Place, away: f64, (across, down): (f64, f64)| {
        let x_of_text = x + away * across;
        let (anchor, left) = match across {
            0.5.. => (Anchor::Start, x_of_text),
            ..=-0.5 => (Anchor::End, x_of_text - width),
            _ => (Anchor::Middle, x_of_text - width / 2.0),
        };
        let top = match down {
            0.5.. => y + away * down,
            ..=-0.5 => y + away * down - height,
            _ => y - height / 2.0,
        };
        let area = Area::around((left, top), (left + width, top + height), 0.0);
        Spot {
            area,
            x: x_of_text,
            anchor,
            line: (away >= FAR[0]).then(|| area.line_from((x, y))),
        }
    };
    let around = move |dot: Place, distances: &'static [f64]| {
        distances.iter().flat_map(move |&away| {
            DIRECTIONS
                .iter()
                .map(move |&direction| spot(dot, away, direction))
        })
    };
    let at_end = dots
        .iter()
        .take(1)
        .flat_map(|&end| around(end, &NEAR).chain(around(end, &FAR)));
    let others = dots.iter().skip(1).flat_map(|&dot| around(dot, &NEAR));
    let mut spots = at_end.chain(others);
    spots.find(|Spot { area, line, .. }| {
        let wide = area.grown(CLEAR);
        let crosses = |name: &Area| line.is_some_and(|line| name.grown(CLEAR).is_crossed(&line));
        area.is_in(bounds)
            && !taken.lines.iter().any(|line| wide.is_crossed(line))
            && !taken.dots.iter().any(|dot| wide.overlaps(dot))
            && !taken
                .names
                .iter()
                .any(|name| wide.overlaps(name) || crosses(name))
    })
}
