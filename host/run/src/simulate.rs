//! `simulate`: a scene through the engine.

use anyhow::{Context, Result, ensure};
use dtof_core::DepthEvent;
use dtof_core::fixed::types::U16F16;

use super::depth_map::MapInput;
use super::given::{FRAME, Given, ONCE, SENSOR, TDC, of_given};
use super::run::{RunResult, Sink, run};
use super::truth::SceneComparison;
use dtof_data::options::keys::{Key, Kind};
use dtof_data::options::numbers::{boolean, integer};
use dtof_data::options::progress::Progress;
use dtof_data::photons::masked::Masked;
use dtof_data::photons::source::Slice;
use dtof_engine::Engine;
use dtof_engine::settings::{
    DetectionSettings, RaySettings, RunSettings, SensorSettings, Settings, SettingsFile,
};
use dtof_light::scene::Scene;

/// What is simulated.
const ARRAY: &[Key] = &[
    Key::new(
        "array",
        Kind::Integers("columns and rows, [64, 32]"),
        "COLUMNSxROWS",
        "Macropixels of the array [default: the file's]",
    ),
    Key::new(
        "laser_off",
        Kind::Flag,
        "",
        "Simulate without signal: photon-counts.svg is then a passive image",
    ),
];
/// How long.
const RUN: &[Key] = &[
    Key::of(RunSettings::KEYS, "cycles")
        .with_help("Laser cycles to simulate [default: the file's]"),
    Key::of(RunSettings::KEYS, "seed").with_help("Seed of the simulated photons [default: 1]"),
];

/// The options of a simulation.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Columns and rows of the array, in place of those of the scene.
    pub array: Option<[u32; 2]>,
    /// Whether there is no signal: the picture of photon counts is then a passive image.
    pub laser_off: bool,
    /// The settings.
    pub given: Given,
}

impl dtof_data::options::Options for Options {
    const KEYS: &'static [&'static [Key]] = &[
        ARRAY,
        SENSOR,
        TDC,
        DetectionSettings::KEYS,
        FRAME,
        ONCE,
        RUN,
    ];

    fn set(&mut self, key: &'static str, text: &str) -> Result<(), String> {
        match key {
            "array" => self.array = Some(array(text)?),
            "laser_off" => self.laser_off = boolean(text)?,
            key => self.given.set(key, text)?,
        }
        Ok(())
    }

    of_given!();
}

impl Options {
    /// These options over the settings file.
    ///
    /// # Errors
    /// Fails if the file cannot be read.
    pub fn requested(&self) -> Result<SettingsFile> {
        self.given.merged()
    }

    /// Prepares the simulation of `scene`, with the settings from [`Self::requested`]. Errors call the
    /// scene `name`.
    ///
    /// # Errors
    /// Fails if the settings are for other histograms, or if there are more pixels than addresses.
    pub fn open(
        &self,
        mut scene: Scene,
        name: &str,
        requested: SettingsFile,
    ) -> Result<Simulation> {
        scene.size = self.array.unwrap_or(scene.size);
        if self.laser_off {
            scene = scene.with_laser_off();
        }
        let requested =
            settings_of_scene(requested, &scene).with_context(|| match &self.given.file {
                Some(file) => file.display().to_string(),
                None => "the scene".to_owned(),
            })?;
        let settings = requested.settings(scene.bins.into())?;
        Simulation::new(scene, settings, requested, Some(name.to_owned()))
    }
}

/// A simulation that can begin.
pub struct Simulation {
    /// The scene.
    pub scene: Scene,
    /// Its photons.
    pub photons: Masked,
    /// The settings of the pixels.
    pub settings: Settings,
    /// The requested settings, over those of the scene.
    pub requested: SettingsFile,
    /// How its depth map is decided; `None` if a device has the photons, so that it is that of the events.
    pub map: Option<MapInput>,
    /// The name of the scene for summary and errors; none if it is built in.
    pub input: Option<String>,
}

impl Simulation {
    /// A simulation of `scene` with `settings`, which resolve `requested`. Summary and errors call the
    /// scene `input`.
    ///
    /// # Errors
    /// Fails if there are more pixels than addresses, or if a masked pixel does not exist.
    pub fn new(
        scene: Scene,
        settings: Settings,
        requested: SettingsFile,
        input: Option<String>,
    ) -> Result<Self> {
        let cycles = requested.run.cycles.unwrap_or(scene.cycles);
        let photons = scene.photons(settings.seed, cycles);
        let photons = match &input {
            Some(name) => photons.with_context(|| name.clone())?,
            None => photons?,
        };
        Ok(Self {
            photons: Masked::new(Box::new(photons), &settings.masked)?,
            map: MapInput::new(&requested, &settings, None, &requested)?,
            scene,
            settings,
            requested,
            input,
        })
    }

    /// Runs all of it with `engine`, on this computer or a device, into `sink`. The events are
    /// compared with the scene.
    ///
    /// # Errors
    /// Those of [`run`].
    pub fn run(
        &mut self,
        engine: &mut dyn Engine,
        sink: &mut dyn Sink,
        progress: &mut dyn Progress,
    ) -> Result<RunResult> {
        let mut comparison = SceneComparison::new(&self.scene, &self.settings)?;
        let settings = (&self.settings, &self.requested);
        let sinks: &mut [&mut dyn Sink] = &mut [sink, &mut comparison];
        let mut result = run(
            &mut self.photons,
            engine,
            settings,
            self.map.as_ref(),
            sinks,
            progress,
        )?;
        result.summary.input.clone_from(&self.input);
        result.summary.field_of_view_degrees = Some(self.scene.effective_field_of_view().degrees());
        result.summary.against_truth = Some(comparison.finish(result.summary.cycles));
        if result.summary.photons == 0 {
            let warning = "no photons: the scene is dark, or too short".to_owned();
            result.summary.warnings.push(warning.clone());
            result.warnings.push(warning);
        }
        Ok(result)
    }
}

impl Sink for SceneComparison<'_> {
    fn take(&mut self, _slice: &Slice, events: &[DepthEvent]) -> Result<()> {
        self.add(events);
        Ok(())
    }
}

/// The requested settings, with histograms, laser, TDC and rays of the scene.
///
/// # Errors
/// Fails if the settings are for another number of bins or another bin width.
pub fn settings_of_scene(requested: SettingsFile, scene: &Scene) -> Result<SettingsFile> {
    let bin_width_ps = U16F16::from_num(scene.bin_width_ps);
    let bins = requested.sensor.bins.unwrap_or(scene.bins);
    let width = requested.sensor.bin_width_ps.unwrap_or(bin_width_ps);
    ensure!(
        (bins, width) == (scene.bins, bin_width_ps),
        "{bins} bins of {width} ps, but the scene has {} of {bin_width_ps} ps",
        scene.bins
    );
    Ok(SettingsFile {
        sensor: SensorSettings {
            laser_hz: Some(scene.laser_hz()),
            columns: Some(scene.size[0]),
            bins: Some(bins),
            bin_width_ps: Some(width),
            // The ranges of simulated photons need no offset.
            offset_mm: None,
            offsets_mm: None,
            ..requested.sensor
        },
        rays: RaySettings {
            // Rounded, so that 60 is not 59.99999999999999.
            field_of_view_degrees: Some(
                scene
                    .effective_field_of_view()
                    .degrees()
                    .map(|angle| (angle * 1e9).round() / 1e9),
            ),
            calibration: None,
        },
        run: RunSettings {
            cycles: requested.run.cycles.or(Some(scene.cycles)),
            ..requested.run
        },
        dead_time_of_sensor: Some(scene.effects.tdc_dead_time()),
        dither_of_laser: Some((scene.dither_bins, requested.run.seed.unwrap_or(1))),
        ..requested
    })
}

/// Columns and rows from a text such as `64x32`.
///
/// # Errors
/// Fails unless the text is two numbers from 1 to 65,535 with an `x` between them.
pub fn array(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once('x').and_then(|(columns, rows)| {
        let side = integer(1..=u16::MAX);
        Some([side(columns).ok()?, side(rows).ok()?])
    });
    let sides = sides.ok_or("must be COLUMNSxROWS, as 64x32")?;
    Ok(sides.map(u32::from))
}
