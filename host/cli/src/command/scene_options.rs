//! The options of `dtof simulate` that complete or replace a scene file.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use dtof::path;
use dtof_data::options::keys::real;
use dtof_data::options::rows::Row;
use dtof_data::photons::geometry::FieldOfView;
use dtof_light::scene::{DepthAlong, DepthMap, Scene};

use super::flags::name;

/// Photons a bin and laser cycle in a scene without a file.
const BACKGROUND: f64 = 0.02;

#[derive(Args)]
pub struct SceneOptions {
    /// Depth map as a surface, alone or with those of --scene: an .npy array of rows and columns,
    /// floats in metres or integers in millimetres. There is no surface where it is 0, negative,
    /// infinite or NaN
    #[arg(long, value_name = "FILE", value_parser = path())]
    pub depth: Option<PathBuf>,
    /// Meaning of the depth map
    #[arg(long, value_parser = name::<DepthAlong>(), default_value = "axis", requires = "depth")]
    depth_along: DepthAlong,
    /// Reflectivity of the depth map: an .npy picture of the same size, grey or of three colours,
    /// bytes from 0 to 255 or floats with 1 for white [default: white]
    #[arg(long, value_name = "FILE", value_parser = path(), requires = "depth")]
    albedo: Option<PathBuf>,
    /// Field of view, horizontal and vertical in degrees, from edge to edge of the array [default:
    /// the scene file's, or 60 along the longer side, with square pixels]
    #[arg(long, value_name = "HxV", allow_hyphen_values = true)]
    fov: Option<FieldOfView>,
    /// Signal photons a laser cycle from a white surface at one metre [default: the scene file's,
    /// or 4]
    #[arg(long, value_name = "PHOTONS", value_parser = real(0.0, 1e6).parser(), allow_hyphen_values = true)]
    signal_at_one_metre: Option<f64>,
    /// Background photons a bin and laser cycle [default: the scene file's, or 0.02]
    #[arg(long, value_name = "PHOTONS", value_parser = real(0.0, 100.0).parser(), allow_hyphen_values = true)]
    background: Option<f64>,
    /// Standard deviation of the simulated pulse in bins [default: the scene file's, or 1]
    #[arg(long, value_name = "BINS", value_parser = real(0.0, 1000.0).parser(), allow_hyphen_values = true)]
    pulse_sigma_bins: Option<f64>,
}

impl SceneOptions {
    /// The scene of `file`, or an empty one with some background, as the options change it.
    ///
    /// # Errors
    /// Fails if a file is wrong.
    pub fn scene(&self, file: Option<&Path>) -> Result<Scene> {
        let mut scene = match file {
            Some(file) => Scene::read(file)?,
            None => Scene {
                background: BACKGROUND,
                ..Scene::parse("")?
            },
        };
        scene.background = self.background.unwrap_or(scene.background);
        let sigma = self.pulse_sigma_bins;
        scene.pulse_sigma_bins = sigma.unwrap_or(scene.pulse_sigma_bins);
        let signal = self.signal_at_one_metre;
        scene.signal_at_one_metre = signal.unwrap_or(scene.signal_at_one_metre);
        scene.field_of_view = self.fov.or(scene.field_of_view);
        let Some(depth) = &self.depth else {
            return Ok(scene);
        };
        let mut map = DepthMap::read(depth, self.depth_along)?;
        if let Some(albedo) = &self.albedo {
            map = map.with_picture(albedo)?;
        }
        if file.is_none() {
            (scene.size, scene.layout) = (map.size(), map.size());
        }
        let name = || depth.display().to_string();
        scene.add_depth_map(map).with_context(name)?;
        Ok(scene)
    }

    /// Names of the scene's files, for the report.
    pub fn files(&self, file: Option<&Path>) -> String {
        let files = [file, self.depth.as_deref(), self.albedo.as_deref()];
        let names = files.into_iter().flatten();
        let names: Vec<_> = names.map(|file| file.display().to_string()).collect();
        names.join(", ")
    }

    /// Rows of the report on the values that belong to a depth map.
    pub fn rows(&self, scene: &Scene) -> Vec<Row> {
        if self.depth.is_none() {
            return Vec::new();
        }
        let row = |name: &str, value: String| (name.to_owned(), value);
        let along = match self.depth_along {
            DepthAlong::Axis => "depth along the optical axis",
            DepthAlong::Ray => "range along the ray",
        };
        vec![
            row("depth map", along.to_owned()),
            row(
                "field of view",
                format!("{} degrees", scene.effective_field_of_view()),
            ),
            row(
                "signal",
                format!(
                    "{} photons a laser cycle from a white surface at 1 m",
                    scene.signal_at_one_metre
                ),
            ),
            row(
                "background",
                format!("{} photons a bin and laser cycle", scene.background),
            ),
            row(
                "pulse",
                format!("standard deviation {} bins", scene.pulse_sigma_bins),
            ),
        ]
    }
}
