//! Scene files. `docs/scenes.md` lists the keys.

use std::path::Path;

use anyhow::{Context, Result, anyhow, ensure};
use serde::Deserialize;

use super::Scene;
use super::surface::{Ball, Brightness, Fan, Plane, Rectangle, Shape, Surface};
use crate::effects::Effects;
use crate::effects::afterpulsing::Afterpulsing;
use crate::effects::cover_glass::CoverGlass;
use crate::effects::dead_time::DeadTime;
use crate::effects::hot_pixels::HotPixels;
use crate::effects::jitter::Jitter;
use crate::effects::other_lidar::OtherLidar;
use crate::effects::second_echo::SecondEcho;
use crate::effects::tail::Tail;
use crate::effects::tdc::Tdc;
use dtof_data::options::Refused;
use dtof_data::options::files::read_text;
use dtof_data::options::numbers::bins_of;
use dtof_data::options::rows::printable;
use dtof_data::photons::MM_PER_PS;
use dtof_data::photons::geometry::FieldOfView;
use dtof_data::photons::range::within;
use dtof_sensors::dither::Dither;

#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct SceneFile {
    columns: u16,
    rows: u16,
    cycles: u64,
    bins: u16,
    bin_width_ps: f64,
    laser_rate_mhz: f64,
    background: f64,
    pulse_sigma_bins: f64,
    dither_bins: u16,
    signal_at_one_metre: f64,
    field_of_view_degrees: Option<[f64; 2]>,
    surface: Vec<SurfaceEntry>,
    tail: Option<Tail>,
    second_echo: Option<SecondEcho>,
    cover_glass: Option<CoverGlass>,
    other_lidar: Option<OtherLidar>,
    hot_pixels: Option<HotPixels>,
    dead_time: Option<DeadTime>,
    afterpulsing: Option<Afterpulsing>,
    jitter: Option<Jitter>,
    tdc: Option<Tdc>,
}

impl Default for SceneFile {
    fn default() -> Self {
        Self {
            columns: 1,
            rows: 1,
            cycles: 10_000,
            bins: 128,
            bin_width_ps: 250.0,
            laser_rate_mhz: 10.0,
            background: 0.0,
            pulse_sigma_bins: 1.0,
            dither_bins: 0,
            signal_at_one_metre: 4.0,
            field_of_view_degrees: None,
            surface: Vec::new(),
            tail: None,
            second_echo: None,
            cover_glass: None,
            other_lidar: None,
            hot_pixels: None,
            dead_time: None,
            afterpulsing: None,
            jitter: None,
            tdc: None,
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SurfaceEntry {
    name: Option<String>,
    range_mm: Option<f64>,
    range_right_mm: Option<f64>,
    position_bins: Option<f64>,
    reflectivity: Option<f64>,
    signal: Option<f64>,
    #[serde(default)]
    transmittance: f64,
    #[serde(default)]
    velocity_m_per_s: f64,
    #[serde(default)]
    columns_per_s: f64,
    #[serde(default)]
    rows_per_s: f64,
    rectangle: Option<Rectangle>,
    ball: Option<Ball>,
    fan: Option<Fan>,
    plane: Option<Plane>,
}

impl Scene {
    /// Reads a scene file.
    ///
    /// # Errors
    /// Returns one line with the name of the file, and the line or the key that is wrong.
    pub fn read(path: &Path) -> Result<Self> {
        let text = read_text(path)?;
        Self::parse(&text).with_context(|| path.display().to_string())
    }

    /// Parses the text of a scene file.
    ///
    /// # Errors
    /// Names the line or the key that is wrong.
    pub fn parse(text: &str) -> Result<Self> {
        let file: SceneFile = toml::from_str(text).map_err(|error| {
            let before = error.span().and_then(|span| text.get(..span.start));
            let line = before.map_or(1, |text| text.matches('\n').count() + 1);
            anyhow!("line {line}: {}", printable(error.message()))
        })?;
        file.scene()
    }
}

impl SceneFile {
    fn scene(self) -> Result<Scene> {
        within("columns", self.columns.into(), 1.0..=65_535.0)?;
        within("rows", self.rows.into(), 1.0..=65_535.0)?;
        ensure!(self.cycles >= 1, "cycles 0: must be at least 1");
        bins_of(self.bins).map_err(|reason| Refused::value("bins", self.bins, reason))?;
        within("bin_width_ps", self.bin_width_ps, 1.0..=10_000.0)?;
        within("laser_rate_mhz", self.laser_rate_mhz, 0.01..=1000.0)?;
        within("background", self.background, 0.0..=100.0)?;
        within("pulse_sigma_bins", self.pulse_sigma_bins, 0.0..=1000.0)?;
        Dither::new(self.dither_bins, 0)
            .map_err(|error| anyhow!("dither_bins {}: {error}", self.dither_bins))?;
        within("signal_at_one_metre", self.signal_at_one_metre, 0.0..=1e6)?;
        let mm_per_bin = self.bin_width_ps * MM_PER_PS;
        let surfaces = (1..).zip(self.surface).map(|(number, entry)| {
            let name = entry.name.clone();
            let name = name.unwrap_or_else(|| format!("surface {number}"));
            entry.surface(&name, mm_per_bin).context(name)
        });
        let size = [self.columns, self.rows].map(u32::from);
        let view = self.field_of_view_degrees.map(FieldOfView::new);
        let scene = Scene {
            size,
            layout: size,
            field_of_view: view.transpose().context("field_of_view_degrees")?,
            cycles: self.cycles,
            bins: self.bins,
            bin_width_ps: self.bin_width_ps,
            laser_rate_mhz: self.laser_rate_mhz,
            background: self.background,
            pulse_sigma_bins: self.pulse_sigma_bins,
            dither_bins: self.dither_bins,
            signal_at_one_metre: self.signal_at_one_metre,
            surfaces: surfaces.collect::<Result<_>>()?,
            effects: Effects {
                tail: self.tail,
                second_echo: self.second_echo,
                cover_glass: self.cover_glass,
                other_lidar: self.other_lidar,
                hot_pixels: self.hot_pixels,
                dead_time: self.dead_time,
                afterpulsing: self.afterpulsing,
                jitter: self.jitter,
                tdc: self.tdc,
            },
        };
        let period = scene.timing().period;
        let shortest = period - f64::from(scene.dither_bins) / 2.0;
        ensure!(
            shortest >= f64::from(scene.bins),
            "laser_rate_mhz {}: the next laser pulse comes after {shortest:.1} bins, before the last \
             of {}",
            scene.laser_rate_mhz,
            scene.bins
        );
        scene.effects.check()?;
        Ok(scene)
    }
}

impl SurfaceEntry {
    fn surface(self, name: &str, mm_per_bin: f64) -> Result<Surface> {
        let range_mm = match (self.range_mm, self.position_bins) {
            (Some(range_mm), None) => {
                within("range_mm", range_mm, 1.0..=1e7)?;
                range_mm
            }
            (None, Some(bins)) => {
                within("position_bins", bins, 0.001..=1e6)?;
                bins * mm_per_bin
            }
            _ => anyhow::bail!("needs range_mm or position_bins, and not both"),
        };
        let range_right_mm = self.range_right_mm.unwrap_or(range_mm);
        within("range_right_mm", range_right_mm, 0.0..=1e7)?;
        let light = match (self.reflectivity, self.signal) {
            (Some(share), None) => {
                within("reflectivity", share, 0.0..=100.0)?;
                Brightness::Reflectivity(share)
            }
            (None, Some(signal)) => {
                within("signal", signal, 0.0..=10_000.0)?;
                Brightness::Signal(signal)
            }
            _ => anyhow::bail!("needs reflectivity or signal, and not both"),
        };
        within("transmittance", self.transmittance, 0.0..=1.0)?;
        within("velocity_m_per_s", self.velocity_m_per_s, -1e5..=1e5)?;
        within("columns_per_s", self.columns_per_s, -1e7..=1e7)?;
        within("rows_per_s", self.rows_per_s, -1e7..=1e7)?;
        let shape = match (self.rectangle, self.ball, self.fan, self.plane) {
            (None, None, None, None) => Shape::Everywhere,
            (Some(rectangle), None, None, None) => Shape::Rectangle(rectangle.checked()?),
            (None, Some(ball), None, None) => Shape::Ball(ball.checked()?),
            (None, None, Some(fan), None) => Shape::Fan(fan.checked()?),
            (None, None, None, Some(plane)) => {
                let across = [self.columns_per_s, self.rows_per_s] == [0.0; 2];
                ensure!(
                    self.range_right_mm.is_none() && across,
                    "a plane has no range_right_mm, columns_per_s or rows_per_s"
                );
                Shape::Plane(plane.checked()?)
            }
            _ => anyhow::bail!("is more than one of rectangle, ball, fan and plane"),
        };
        Ok(Surface {
            name: name.to_owned(),
            range_mm,
            range_right_mm,
            light,
            transmittance: self.transmittance,
            velocity_m_per_s: self.velocity_m_per_s,
            drift_per_s: [self.columns_per_s, self.rows_per_s],
            shape,
        })
    }
}

/// Checks a column and a row, which may be outside the array.
fn place(key: &str, place: [f64; 2]) -> Result<()> {
    within(key, place[0], -1e6..=1e6)?;
    within(key, place[1], -1e6..=1e6)
}

impl Rectangle {
    fn checked(self) -> Result<Self> {
        for (key, side) in [
            ("rectangle columns", self.columns),
            ("rectangle rows", self.rows),
        ] {
            place(key, side)?;
            let [first, last] = side;
            ensure!(
                first < last,
                "{key} [{first}, {last}]: the second must be greater"
            );
        }
        Ok(self)
    }
}

impl Ball {
    fn checked(self) -> Result<Self> {
        place("ball centre", self.centre)?;
        within("ball radius", self.radius, 0.001..=1e6)?;
        within("ball radius_mm", self.radius_mm, 0.0..=1e6)?;
        Ok(self)
    }
}

impl Plane {
    fn checked(self) -> Result<Self> {
        for side in self.normal {
            within("plane normal", side, -1e6..=1e6)?;
        }
        let [x, y, z] = self.normal;
        ensure!(
            z.abs() >= 0.001 * x.hypot(y) && z.abs() >= 1e-6,
            "plane normal [{x}, {y}, {z}]: its z is too small, the optical axis must meet the plane"
        );
        Ok(self)
    }
}

impl Fan {
    fn checked(self) -> Result<Self> {
        place("fan centre", self.centre)?;
        within("fan radius", self.radius, 0.001..=1e6)?;
        within("fan blades", self.blades.into(), 1.0..=1000.0)?;
        within("fan blade_share", self.blade_share, 0.0..=1.0)?;
        within("fan rpm", self.rpm, -1e6..=1e6)?;
        Ok(self)
    }
}
