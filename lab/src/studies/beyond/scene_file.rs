//! Scenes of files, each at a random distance.

use super::setting::BINS;
use anyhow::{Result, ensure};
use dtof_light::scene::Scene;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;

/// A file of a scene, and a factor for its light.
#[derive(Clone, Copy)]
pub struct SceneFile {
    pub name: &'static str,
    text: &'static str,
    light: f64,
}

pub const FAN: SceneFile = SceneFile::new("fan", include_str!("../../../../scenes/fan.toml"));
pub const RADIAL: SceneFile =
    SceneFile::new("radial", include_str!("../../../../scenes/radial.toml"));
pub const STATIC: SceneFile =
    SceneFile::new("static", include_str!("../../../../scenes/static.toml"));
pub const TILTED_WALL: SceneFile = SceneFile::new(
    "tilted-wall",
    include_str!("../../../../scenes/tilted-wall.toml"),
);
pub const DIM_TILTED_WALL: SceneFile = TILTED_WALL.dimmed("dim tilted-wall", 0.1);
pub const DEMO: SceneFile =
    SceneFile::new("demo", include_str!("../../../../host/light/src/demo.toml"));

impl SceneFile {
    const fn new(name: &'static str, text: &'static str) -> Self {
        let light = 1.0;
        Self { name, text, light }
    }

    /// The same scene with less light.
    pub const fn dimmed(self, name: &'static str, light: f64) -> Self {
        Self {
            name,
            light,
            ..self
        }
    }

    /// The scene.
    pub fn parse(&self) -> Result<Scene> {
        let mut scene = Scene::parse(self.text)?;
        ensure!(usize::from(scene.bins) == BINS, "{} bins", scene.bins);
        scene.signal_at_one_metre *= self.light;
        Ok(scene)
    }

    /// The scene, a random part of a bin farther away.
    pub fn moved(&self, rng: &mut Pcg64) -> Result<Scene> {
        let mut scene = self.parse()?;
        let shift_mm = Uniform::new(0.0, 1.0)?.sample(rng) * scene.mm_per_bin();
        for surface in &mut scene.surfaces {
            surface.range_mm += shift_mm;
            surface.range_right_mm += shift_mm;
        }
        Ok(scene)
    }
}
