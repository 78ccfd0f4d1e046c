//! Places names so that they do not overlap.

/// A name beside the plot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Label {
    /// The y at which its curve ends.
    pub y: f64,
    /// The height of its text.
    pub height: f64,
}

/// The middles of `labels` in a column from `top` to `bottom`, as close as possible to the ends
/// of their curves, in the same order. If the column is too short they overlap evenly.
pub(super) fn spread(labels: &[Label], top: f64, bottom: f64) -> Vec<f64> {
    let mut order: Vec<usize> = (0..labels.len()).collect();
    order.sort_by(|&a, &b| labels[a].y.total_cmp(&labels[b].y));
    let all: f64 = labels.iter().map(|name| name.height).sum();
    let squeeze = ((bottom - top) / all.max(1.0)).min(1.0);
    // Names that touch form a block around the mean of their curve ends.
    let mut blocks: Vec<Vec<usize>> = Vec::new();
    let height = |block: &[usize]| {
        let heights = block.iter().map(|&index| labels[index].height * squeeze);
        heights.sum::<f64>()
    };
    let start = |block: &[usize]| {
        let mut above = 0.0;
        let mut sum = 0.0;
        for &index in block {
            let height = labels[index].height * squeeze;
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
            let height = labels[index].height * squeeze;
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

    fn overlap(&self, other: &Self) -> f64 {
        let width = self.right.min(other.right) - self.left.max(other.left);
        let height = self.bottom.min(other.bottom) - self.top.max(other.top);
        width.max(0.0) * height.max(0.0)
    }
}

/// The top left corner of a name of this `size` beside a dot: the position within `bounds` that
/// overlaps least with the `taken` areas.
pub(super) fn beside(
    dot: (f64, f64),
    size: (f64, f64),
    bounds: &Area,
    taken: &[Area],
) -> (f64, f64) {
    let (x, y) = dot;
    let (width, height) = size;
    let mut best = ((x, y), f64::INFINITY);
    for away in [9.0, 20.0, 34.0, 50.0] {
        let (level, above, below) = (y - height / 2.0, y - away - height, y + away);
        let corners = [
            (x + away, level),
            (x - away - width, level),
            (x + away.min(12.0), above),
            (x + away.min(12.0), below),
            (x - away.min(12.0) - width, above),
            (x - away.min(12.0) - width, below),
        ];
        for (left, top) in corners {
            let area = Area::around((left, top), (left + width, top + height), 0.0);
            let inside = area.overlap(bounds) / (width * height);
            let hidden: f64 = taken.iter().map(|other| area.overlap(other)).sum();
            let cost = hidden + 1e4 * (1.0 - inside) + away;
            if cost < best.1 - 1e-6 {
                best = ((left, top), cost);
            }
        }
    }
    best.0
}
