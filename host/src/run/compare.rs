//! All methods on the photons of a recording or a scene.

use anyhow::{Context, Result};
use clap::Args;
use dtof_core::CentredWindow;
use dtof_core::fixed::types::U8F8;

use super::calibrate::look;
use super::operation::Known;
use super::recording::{Recording, of_file, opening, warning_of_width, warnings};
use super::simulate::of_scene;
use crate::calibrate::Asked;
use crate::cli::arguments::{MOST_WHOLE, positive, whole};
use crate::compare::truth::Truth;
use crate::compare::{Comparison, Task, compare};
use crate::input::masked::Masked;
use crate::input::medium::Medium;
use crate::input::open::{Counts, Opening, counts, open};
use crate::input::source::PhotonSource;
use crate::settings::{Run, SettingsFile, share};
use crate::simulate::scene::Scene;

/// What is compared, and how exact it has to be.
#[derive(Args)]
#[group(skip)]
pub struct Options {
    /// Millimetres that 68 % of the reports may be off at most [default: as frames of L2]
    #[arg(long, value_name = "MM", value_parser = positive)]
    within: Option<f64>,
    /// The share of exposures without a target that may end with an event, at most 0.1
    /// [default: 0.01]
    #[arg(long, value_name = "SHARE", value_parser = share)]
    false_alarm: Option<f64>,
    #[command(flatten)]
    recording: Recording,
    /// What is known of the sensor.
    #[command(flatten)]
    pub known: Known,
    /// Laser cycles to use at most [default: 10000; the scene's]
    #[arg(long, value_name = "N", value_parser = whole(1..=MOST_WHOLE))]
    cycles: Option<u64>,
    /// Seed of every random number [default: 1]
    #[arg(long, value_name = "N", value_parser = whole(0..=MOST_WHOLE - 1))]
    seed: Option<u64>,
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
        let run = Run {
            cycles: self.cycles,
            seed: self.seed,
            ..Run::default()
        };
        let run = SettingsFile::from(run);
        match is_scene {
            true => self.known.said(run),
            false => self
                .recording
                .said(|options| self.known.said(options.or(run))),
        }
    }

    /// Compares all methods on `input`, of which so much is `said`.
    ///
    /// # Errors
    /// What is wrong with it, its name first, or with what is said.
    pub fn compare(&self, input: Input, said: SettingsFile, told: &Told) -> Result<Compared> {
        let mut asked = said.clone();
        asked.detection.false_alarm = Some(self.share(&said));
        let compared = self.compare_as_said(input, said, told);
        compared.map_err(|error| asked.name_origin(error))
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
        let sigma = said.sensor.sigma_bins.with_context(|| {
            format!("{name}: no peak tells how wide the pulse is; --sigma-bins is needed")
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
        self.recording.suits(&medium, &counts.known)?;
        let of_width = warning_of_width(&counts.known, &said);
        warnings(&counts.known)
            .chain(of_width)
            .for_each(told.warning);
        let geometry = counts.geometry;
        let truth = match (truth, &counts.truth_mm) {
            (Some(truth), _) => Some(Truth::read(truth, geometry)?),
            (None, ranges) => ranges.clone().map(Truth::Ranges),
        };
        let said = if said.sensor.sigma_bins.is_some() {
            said.or(of_file(&counts.known, geometry))
        } else {
            let asked = Asked {
                false_alarm: self.share(&said),
                ..Asked::default()
            };
            let found = look(&said, &counts, &asked);
            let found = found.with_context(|| medium.to_string())?;
            said.clone()
                .or(found.settings(said.or(of_file(&counts.known, geometry)))?)
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
