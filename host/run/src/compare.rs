//! All methods on the photons of a recording or a scene.

use anyhow::{Context, Result};
use dtof_core::CentredWindow;
use dtof_core::fixed::types::U8F8;

use super::calibrate::look;
use super::given::{Given, SENSOR, of_given};
use super::recording::{RECORDING, of_file, opening, warning_of_width, warnings};
use super::simulate::of_scene;
use dtof_calibrate::Asked;
use dtof_compare::truth::Truth;
use dtof_compare::{Comparison, Task, compare};
use dtof_engine::settings::{Run, Sensor, SettingsFile, share};
use dtof_options::numbers::{MOST_WHOLE, positive, whole};
use dtof_options::{Refused, plain};
use dtof_photons::masked::Masked;
use dtof_photons::medium::Medium;
use dtof_photons::open::{Counts, Opening, counts, open};
use dtof_photons::source::PhotonSource;
use dtof_simulate::scene::Scene;

/// What is compared, and how exact it has to be.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Millimetres that 68 % of the reports may be off at most; as frames of L2 unless given.
    pub within: Option<f64>,
    /// The share of exposures without a target that may end with an event; 0.01 unless given.
    pub false_alarm: Option<f64>,
    /// What the recording is, and what is known of the sensor.
    pub given: Given,
}

impl dtof_options::Options for Options {
    const KEYS: &'static [&'static [&'static str]] = &[
        &["within", "false_alarm"],
        RECORDING,
        SENSOR,
        &["cycles", "seed"],
    ];

    fn set(&mut self, key: &'static str, text: &str) -> Result<(), String> {
        match key {
            "within" => self.within = Some(positive(text)?),
            "false_alarm" => self.false_alarm = Some(share(text)?),
            // One more is the seed of a second run.
            "seed" => self.given.options.run.seed = Some(whole(0..=MOST_WHOLE - 1)(text)?),
            key => self.given.set(key, text)?,
        }
        Ok(())
    }

    of_given!();
}

/// Where photons come from.
pub enum Input {
    /// A recording, and the true range of each pixel if it is known.
    Recording(Medium, Option<Medium>),
    /// A scene, and what errors call it.
    Scene(Box<Scene>, String),
}

/// Told while methods are compared.
pub struct Told<'a> {
    /// What is wrong with the recording.
    pub warning: &'a dyn Fn(String),
    /// What comes next. An error from it ends the comparison.
    pub step: &'a dyn Fn(&str) -> Result<()>,
}

/// What came of it.
pub struct Compared {
    /// All methods.
    pub comparison: Comparison,
    /// The settings of the one to take, if there is one.
    pub settings: Option<SettingsFile>,
}

/// What is compared, once it is known.
struct Subject {
    said: SettingsFile,
    truth: Option<Truth>,
    photons: Photons,
}

/// Where its photons come from, again and again.
enum Photons {
    Scene(Box<Scene>),
    /// A file is read once.
    Histograms(Counts),
    /// A list is never held in memory.
    List(Medium),
}

impl Input {
    /// As errors call it.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Recording(medium, _) => medium.to_string(),
            Self::Scene(_, name) => name.clone(),
        }
    }
}

impl Options {
    /// What these options say of a recording or of a scene, and the settings file.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn said(&self, is_scene: bool) -> Result<SettingsFile> {
        let mut said = match is_scene {
            true => self.of_scene().merged(),
            false => self.given.merged_for_recording(),
        }?;
        if self.false_alarm.is_some() {
            said.override_key("false_alarm");
        }
        Ok(said)
    }

    /// Without what says what a recording is: a scene knows.
    fn of_scene(&self) -> Given {
        let Given { file, options } = self.given.clone();
        let SettingsFile { sensor, run, .. } = options;
        let options = SettingsFile {
            sensor: Sensor {
                gate: sensor.gate,
                masked: sensor.masked,
                sigma_bins: sensor.sigma_bins,
                ..Sensor::default()
            },
            run: Run {
                cycles: run.cycles,
                seed: run.seed,
                ..Run::default()
            },
            ..SettingsFile::default()
        };
        Given { file, options }
    }

    /// Compares all methods on `input`, of which so much is `said`.
    ///
    /// # Errors
    /// What is wrong with it, its name first, or with what is said.
    pub fn compare(&self, input: Input, said: &SettingsFile, told: &Told) -> Result<Compared> {
        let compared = self.compare_as_said(input, said.clone(), told);
        compared.map_err(|error| said.blame(error))
    }

    fn compare_as_said(&self, input: Input, said: SettingsFile, told: &Told) -> Result<Compared> {
        let name = input.name();
        let subject = match input {
            Input::Scene(scene, name) => of_known_scene(*scene, &name, said)?,
            Input::Recording(medium, truth) => {
                self.of_recording(medium, truth.as_ref(), said, told)?
            }
        };
        let Subject {
            said,
            truth,
            photons,
        } = subject;
        let false_alarm = self.share(&said);
        let sigma = said.sensor.sigma_bins.ok_or_else(|| {
            let reason = format!(
                "is needed: no peak of {} tells how wide the pulse is",
                plain(&name)
            );
            Refused::new("sigma_bins", reason)
        })?;
        let settings = said.settings(said.sensor.bins.unwrap_or(128).into())?;
        let photons = |seed: u64| -> Result<Box<dyn PhotonSource>> {
            let opening = Opening {
                seed,
                ..opening(&said)
            };
            let photons: Box<dyn PhotonSource> = match &photons {
                Photons::Scene(scene) => {
                    Box::new(scene.photons(seed, said.run.cycles.unwrap_or(scene.cycles))?)
                }
                Photons::Histograms(counts) => Box::new(counts.photons(&opening)?),
                Photons::List(medium) => open(medium, &opening)?.photons,
            };
            let photons = Masked::new(photons, &settings.masked)?;
            Ok(Box::new(photons.with_laser_hz(said.sensor.laser_hz)))
        };
        let comparison = compare(&Task {
            photons: &photons,
            truth,
            settings: &settings,
            sigma: sigma.to_num(),
            false_alarm,
            within_mm: self.within,
            progress: told.step,
        });
        let comparison = comparison.context(name)?;
        let taken = comparison.taken.as_ref();
        Ok(Compared {
            settings: taken.map(|taken| said.with(taken).of_any_file()),
            comparison,
        })
    }

    /// The share of false alarms.
    fn share(&self, said: &SettingsFile) -> f64 {
        let share = self.false_alarm.or(said.detection.false_alarm);
        share.unwrap_or(0.01)
    }

    /// What is not said of a recording is found in it.
    fn of_recording(
        &self,
        medium: Medium,
        truth: Option<&Medium>,
        said: SettingsFile,
        told: &Told,
    ) -> Result<Subject> {
        let counts = counts(&medium, &opening(&said))?;
        self.given.suits(&medium, &counts.known)?;
        let of_width = warning_of_width(&counts.known, &said);
        warnings(&counts.known)
            .chain(of_width)
            .for_each(told.warning);
        let pixels = counts.array.pixels() as usize * counts.captures.len();
        let truth = match (truth, &counts.truth_mm) {
            (Some(truth), _) => Some(Truth::read(truth, pixels)?),
            (None, ranges) => ranges.clone().map(Truth::Ranges),
        };
        let said = if said.sensor.sigma_bins.is_some() {
            said.or(of_file(&counts.known, counts.array))
        } else {
            let asked = Asked {
                false_alarm: self.share(&said),
                ..Asked::default()
            };
            let found = look(&said, &counts, &asked);
            let found = found.with_context(|| medium.to_string())?;
            said.clone()
                .or(found.settings(said.or(of_file(&counts.known, counts.array)))?)
        };
        Ok(Subject {
            said: with_short_exposures(said),
            truth,
            photons: if counts.known.is_list {
                Photons::List(medium)
            } else {
                Photons::Histograms(counts)
            },
        })
    }
}

/// A scene knows everything of itself.
fn of_known_scene(scene: Scene, name: &str, said: SettingsFile) -> Result<Subject> {
    let mut said = of_scene(said, &scene).with_context(|| name.to_owned())?;
    let sigma = U8F8::checked_from_num(scene.pulse_sigma_bins);
    let known = sigma.filter(|sigma| *sigma <= CentredWindow::WIDEST_PULSE);
    said.sensor.sigma_bins = said.sensor.sigma_bins.or(known);
    Ok(Subject {
        said: with_short_exposures(said),
        truth: Some(Truth::Scene(Box::new(scene.clone()))),
        photons: Photons::Scene(Box::new(scene)),
    })
}

/// A decision may come at the second look, unless something else is said: rules have the
/// thresholds for it.
fn with_short_exposures(mut said: SettingsFile) -> SettingsFile {
    let x = said.detection.x.unwrap_or(4);
    said.detection.l1.get_or_insert(x);
    said
}
