//! Surfaces and their motion.

use std::f64::consts::TAU;

use serde::Deserialize;

use super::LineOfSight;
use super::depth_map::DepthMap;

/// Larger distances are taken for infinite.
const FARTHEST_MM: f64 = 1e9;

/// A surface that sends photons back.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Its name in reports.
    pub name: String,
    /// The distance in millimetres at the start, at the first column; for a ball, of its centre.
    pub range_mm: f64,
    /// The same at the last column of the layout.
    pub range_right_mm: f64,
    /// How many photons come back.
    pub light: Brightness,
    /// The share of light that passes, each way.
    pub transmittance: f64,
    /// Metres a second away from the sensor.
    pub velocity_m_per_s: f64,
    /// Motion across the array in columns and rows a second, to the right and down.
    pub drift_per_s: [f64; 2],
    /// Which places it covers.
    pub shape: Shape,
}

/// How many photons come back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Brightness {
    /// The reflectivity; the photons fall with the square of the range.
    Reflectivity(f64),
    /// Signal photons a laser cycle, whatever the range.
    Signal(f64),
}

impl Brightness {
    /// The same brightness times `factor`.
    pub(super) fn times(self, factor: f64) -> Self {
        match self {
            Self::Reflectivity(share) => Self::Reflectivity(share * factor),
            Self::Signal(signal) => Self::Signal(signal * factor),
        }
    }
}

/// Which places a surface covers at the start.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Everywhere.
    Everywhere,
    /// A rectangle of the array.
    Rectangle(Rectangle),
    /// A ball.
    Ball(Ball),
    /// A fan.
    Fan(Fan),
    /// A plane, wherever a ray meets it.
    Plane(Plane),
    /// The samples of a depth map that have a depth.
    DepthMap(DepthMap),
}

/// From the first column (row) up to the second, which is not covered.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rectangle {
    /// First and last, in columns of the layout.
    pub columns: [f64; 2],
    /// First and last, in rows of the layout.
    pub rows: [f64; 2],
}

/// A ball, of which the half towards the sensor is visible.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ball {
    /// Column and row.
    pub centre: [f64; 2],
    /// Its apparent radius in columns.
    pub radius: f64,
    /// Its radius in millimetres.
    pub radius_mm: f64,
}

/// Blades around a centre that turn clockwise.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fan {
    /// Column and row.
    pub centre: [f64; 2],
    /// The length of the blades in columns.
    pub radius: f64,
    /// The number of blades.
    pub blades: u16,
    /// The share of the circle that they cover.
    pub blade_share: f64,
    /// Revolutions a minute.
    pub rpm: f64,
}

/// A flat surface at any angle. The optical axis meets it at `range_mm`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// The normal, of any length: x to the right, y down, z forward. Its z is not 0.
    pub normal: [f64; 3],
}

impl Surface {
    /// Whether it changes with time.
    #[must_use]
    pub fn moves(&self) -> bool {
        let turns = matches!(&self.shape, Shape::Fan(fan) if fan.rpm != 0.0);
        turns || self.velocity_m_per_s != 0.0 || self.drift_per_s != [0.0; 2]
    }

    /// The range along a line of sight after `seconds`. `None` if the surface does not cover it.
    pub(super) fn range_mm(
        &self,
        sight: &LineOfSight,
        seconds: f64,
        layout: [u32; 2],
    ) -> Option<f64> {
        let [column, row] = self.at_start(sight.place, seconds);
        let nearer_mm = match &self.shape {
            Shape::Everywhere => 0.0,
            Shape::Rectangle(Rectangle { columns, rows }) => {
                let covered =
                    (columns[0]..columns[1]).contains(&column) && (rows[0]..rows[1]).contains(&row);
                covered.then_some(0.0)?
            }
            Shape::Ball(ball) => {
                let from_centre =
                    (column - ball.centre[0]).hypot(row - ball.centre[1]) / ball.radius;
                (from_centre < 1.0).then(|| ball.radius_mm * (1.0 - from_centre.powi(2)).sqrt())?
            }
            Shape::Fan(fan) => fan.covers([column, row], seconds).then_some(0.0)?,
            Shape::Plane(plane) => {
                return plane.along(sight.ray, self.plane_mm(0.0, seconds, layout));
            }
            Shape::DepthMap(map) => return map.range_mm(sight),
        };
        Some(self.plane_mm(column, seconds, layout) - nearer_mm)
    }

    /// The brightness along a line of sight.
    pub(super) fn light(&self, sight: &LineOfSight) -> Brightness {
        match (&self.shape, self.light) {
            (Shape::DepthMap(map), Brightness::Reflectivity(share)) => {
                Brightness::Reflectivity(share * map.reflectivity(sight))
            }
            (_, light) => light,
        }
    }

    /// The brightness and the distance of the brightest place, if all of the surface is at least
    /// `nearest_mm` away.
    pub(super) fn brightest(&self, nearest_mm: f64) -> (Brightness, f64) {
        if let (Shape::DepthMap(map), Brightness::Reflectivity(share)) = (&self.shape, self.light)
            && let Some((reflectivity, depth_mm)) = map.brightest()
        {
            return (Brightness::Reflectivity(share * reflectivity), depth_mm);
        }
        (self.light, nearest_mm)
    }

    /// The nearest distance at any place of the layout after `seconds`. For a plane, the nearest
    /// distance anywhere.
    pub(super) fn nearest_mm(&self, seconds: f64, layout: [u32; 2]) -> f64 {
        let nearer_mm = match &self.shape {
            Shape::Plane(plane) => return plane.distance(self.plane_mm(0.0, seconds, layout)),
            Shape::DepthMap(map) => return map.nearest_mm(),
            Shape::Ball(ball) => ball.radius_mm,
            _ => 0.0,
        };
        let ends = [0.0, f64::from(layout[0])];
        let ends = ends.map(|column| {
            let [column, _] = self.at_start([column, 0.0], seconds);
            self.plane_mm(column, seconds, layout)
        });
        ends[0].min(ends[1]) - nearer_mm
    }

    /// Where the point now at `place` was at the start.
    fn at_start(&self, place: [f64; 2], seconds: f64) -> [f64; 2] {
        let [columns, rows] = self.drift_per_s;
        [place[0] - columns * seconds, place[1] - rows * seconds]
    }

    fn plane_mm(&self, column: f64, seconds: f64, layout: [u32; 2]) -> f64 {
        let turned = self.range_right_mm - self.range_mm;
        let last = f64::from(layout[0].max(2) - 1);
        self.range_mm + turned * column / last + self.velocity_m_per_s * 1000.0 * seconds
    }
}

impl Plane {
    /// The range of the plane along a ray, if the optical axis meets it at `axis_mm`. `None` if the
    /// ray leads away from it.
    fn along(&self, ray: [f64; 3], axis_mm: f64) -> Option<f64> {
        let towards: f64 = self.normal.iter().zip(ray).map(|(n, side)| n * side).sum();
        let range_mm = axis_mm * self.normal[2] / towards;
        // A larger range means that the ray is parallel.
        (range_mm > 0.0 && range_mm < FARTHEST_MM).then_some(range_mm)
    }

    /// The distance of the plane from the lens.
    fn distance(&self, axis_mm: f64) -> f64 {
        let [x, y, z] = self.normal;
        axis_mm * z.abs() / x.hypot(y).hypot(z)
    }
}

impl Fan {
    fn covers(&self, place: [f64; 2], seconds: f64) -> bool {
        // Rows count downwards, so that angles grow clockwise.
        let (across, down) = (place[0] - self.centre[0], place[1] - self.centre[1]);
        if across.hypot(down) > self.radius {
            return false;
        }
        let turns = down.atan2(across) / TAU - self.rpm / 60.0 * seconds;
        (turns * f64::from(self.blades)).rem_euclid(1.0) < self.blade_share
    }
}
