//! A scene on an array, ready to be simulated.

use anyhow::{Context, Result, ensure};
use dtof_core::DepthEvent;
use dtof_core::fixed::types::U16F16;

use super::given::{FRAME, Given, SENSOR, of_given};
use super::run::{Ran, Sink, run};
use super::truth::Comparison;
use dtof_engine::Engine;
use dtof_engine::settings::{Detection, Rays, Run, Sensor, Settings, SettingsFile};
use dtof_options::numbers::{truth, whole};
use dtof_options::progress::Progress;
use dtof_photons::masked::Masked;
use dtof_photons::source::{PhotonSource, Slice};
use dtof_simulate::scene::Scene;

/// What is simulated beside the scene, and how.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Columns and rows of the array that looks at the scene.
    pub array: Option<[u32; 2]>,
    /// Without signal: the picture of photon counts is then a passive image.
    pub laser_off: bool,
    /// The settings.
    pub given: Given,
}

impl dtof_options::Options for Options {
    const KEYS: &'static [&'static [&'static str]] = &[
        &["array", "laser_off"],
        SENSOR,
        Detection::KEYS,
        FRAME,
        &["cycles", "seed"],
    ];

    fn set(&mut self, key: &'static str, text: &str) -> Result<(), String> {
        match key {
            "array" => self.array = Some(array(text)?),
            "laser_off" => self.laser_off = truth(text)?,
            key => self.given.set(key, text)?,
        }
        Ok(())
    }

    of_given!();
}

impl Options {
    /// What these options say, and the settings file.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn said(&self) -> Result<SettingsFile> {
        self.given.merged()
    }

    /// `scene` as the array sees it, and as is `said`. Errors call it `name`.
    ///
    /// # Errors
    /// If what is said is for other histograms, or there are more pixels than addresses.
    pub fn open(&self, mut scene: Scene, name: &str, said: SettingsFile) -> Result<Simulation> {
        scene.size = self.array.unwrap_or(scene.size);
        if self.laser_off {
            scene = scene.with_laser_off();
        }
        let said = of_scene(said, &scene).with_context(|| match &self.given.file {
            Some(file) => file.display().to_string(),
            None => "the scene".to_owned(),
        })?;
        let settings = said.settings(scene.bins.into())?;
        Simulation::new(scene, settings, said, Some(name.to_owned()))
    }
}

/// A simulation that can begin.
pub struct Simulation {
    /// The scene.
    pub scene: Scene,
    /// Its photons.
    pub photons: Masked,
    /// How the pixels operate.
    pub settings: Settings,
    /// What was said of them, and what the scene says besides.
    pub said: SettingsFile,
    /// What summary and errors call the scene; none where it is a part of the program.
    pub input: Option<String>,
}

impl Simulation {
    /// Of `scene`, with `settings`, which come of `said`. Summary and errors call it `input`.
    ///
    /// # Errors
    /// If there are more pixels than addresses, or one that is left out is not there.
    pub fn new(
        scene: Scene,
        settings: Settings,
        said: SettingsFile,
        input: Option<String>,
    ) -> Result<Self> {
        let cycles = said.run.cycles.unwrap_or(scene.cycles);
        let photons = scene.photons(settings.seed, cycles);
        let photons = match &input {
            Some(name) => photons.with_context(|| name.clone())?,
            None => photons?,
        };
        Ok(Self {
            photons: Masked::new(Box::new(photons), &settings.masked)?,
            scene,
            settings,
            said,
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
    ) -> Result<Ran> {
        let mut comparison = Comparison::new(&self.scene, &self.settings, self.photons.cycles())?;
        let how = (&self.settings, &self.said);
        let sinks: &mut [&mut dyn Sink] = &mut [sink, &mut comparison];
        let mut ran = run(&mut self.photons, engine, how, sinks, progress)?;
        ran.summary.input.clone_from(&self.input);
        ran.summary.field_of_view_degrees = Some(self.scene.view().degrees());
        ran.summary.against_truth = Some(comparison.finish());
        Ok(ran)
    }
}

impl Sink for Comparison<'_> {
    fn take(&mut self, _slice: &Slice, events: &[DepthEvent]) -> Result<()> {
        self.add(events);
        Ok(())
    }
}

/// What is said, on a scene: it has histograms, a TDC and rays of its own.
///
/// # Errors
/// If what is said is for other histograms.
pub fn of_scene(said: SettingsFile, scene: &Scene) -> Result<SettingsFile> {
    let bin_width_ps = U16F16::from_num(scene.bin_width_ps);
    let Sensor {
        bins: said_bins,
        bin_width_ps: said_width,
        ..
    } = said.sensor;
    let (bins, width) = (
        said_bins.unwrap_or(scene.bins),
        said_width.unwrap_or(bin_width_ps),
    );
    ensure!(
        (bins, width) == (scene.bins, bin_width_ps),
        "{bins} bins of {width} ps, but the scene has {} of {bin_width_ps} ps",
        scene.bins
    );
    Ok(SettingsFile {
        sensor: Sensor {
            laser_hz: Some(scene.laser_hz()),
            columns: Some(scene.size[0]),
            bins: Some(bins),
            bin_width_ps: Some(width),
            // Simulated photons come at their distance.
            offset_mm: None,
            one_hit_tdc: scene.effects.one_hit_tdc().then_some(true),
            ..said.sensor
        },
        rays: Rays {
            // As written: 60 is not 59.99999999999999.
            field_of_view_degrees: Some(
                scene
                    .view()
                    .degrees()
                    .map(|angle| (angle * 1e9).round() / 1e9),
            ),
            calibration: None,
        },
        run: Run {
            cycles: said.run.cycles.or(Some(scene.cycles)),
            ..said.run
        },
        ..said
    })
}

/// As `64x32`.
///
/// # Errors
/// If it is no array.
pub fn array(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once('x').and_then(|(columns, rows)| {
        let side = whole(1..=u16::MAX);
        Some([side(columns).ok()?, side(rows).ok()?])
    });
    let sides = sides.ok_or("must be COLUMNSxROWS, as 64x32")?;
    Ok(sides.map(u32::from))
}
