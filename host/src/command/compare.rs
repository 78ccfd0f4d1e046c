//! `dtof compare`: which method for these photons.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use dtof::calibrate::Asked;
use dtof::cli::arguments::{MOST_WHOLE, path, positive, whole};
use dtof::compare::page::{self, FILES};
use dtof::compare::truth::Truth;
use dtof::compare::{Task, compare};
use dtof::input::masked::Masked;
use dtof::input::open::{Counts, Opening, counts, open};
use dtof::input::source::PhotonSource;
use dtof::progress::Steps;
use dtof::rows::aligned;
use dtof::settings::{Run, SettingsFile, share};
use dtof::simulate::scene::Scene;
use dtof_core::CentredWindow;
use dtof_core::fixed::types::U8F8;

use super::calibrate::look;
use super::operation::Known;
use super::recording::{Recording, of_file, opening, warn, warn_of_width};
use super::simulate::of_scene;

#[derive(Args)]
pub struct Compare {
    /// A recording, of any format that `replay` reads
    #[arg(long, value_name = "FILE", value_parser = path(), required_unless_present = "scene")]
    input: Option<PathBuf>,
    /// A scene instead, a TOML file; docs/scenes.md lists its keys
    #[arg(long, value_name = "FILE", value_parser = path(), conflicts_with = "input")]
    scene: Option<PathBuf>,
    /// The true range of each pixel in millimetres, an .npy array with as many numbers; 0 is
    /// none [default: that of the file, if it has one]
    #[arg(long, value_name = "FILE", value_parser = path(), conflicts_with = "scene")]
    truth: Option<PathBuf>,
    /// Millimetres that 68 % of the reports may be off at most [default: as frames of L2]
    #[arg(long, value_name = "MM", value_parser = positive)]
    within: Option<f64>,
    /// The share of exposures without a target that may end with an event, at most 0.1
    /// [default: 0.01]
    #[arg(long, value_name = "SHARE", value_parser = share)]
    false_alarm: Option<f64>,
    /// The folder of the results
    #[arg(long, value_name = "DIR", value_parser = path())]
    out: PathBuf,
    #[command(flatten)]
    recording: Recording,
    #[command(flatten)]
    known: Known,
    /// Laser cycles to use at most [default: 10000; the scene's]
    #[arg(long, value_name = "N", value_parser = whole(1..=MOST_WHOLE))]
    cycles: Option<u64>,
    /// Seed of every random number [default: 1]
    #[arg(long, value_name = "N", value_parser = whole(0..=MOST_WHOLE - 1))]
    seed: Option<u64>,
    /// Print nothing but errors
    #[arg(long)]
    quiet: bool,
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
    List,
}

impl Compare {
    pub fn run(&self) -> Result<()> {
        let name = self.input.as_deref().or(self.scene.as_deref());
        let name = name.context("--input or --scene is needed")?;
        page::may_write(&self.out, &self.inputs())?;
        let said = match &self.scene {
            Some(_) => self.known.said(self.options()),
            None => self
                .recording
                .said(|options| self.known.said(options.or(self.options()))),
        }?;
        let mut asked = said.clone();
        asked.detection.false_alarm = Some(self.share(&said));
        let compared = self.compare(name, said);
        compared.map_err(|error| asked.name_origin(error))
    }

    fn compare(&self, name: &Path, said: SettingsFile) -> Result<()> {
        let subject = match &self.scene {
            Some(file) => Self::of_scene(file, said)?,
            None => self.of_recording(name, said)?,
        };
        let Subject {
            said,
            truth,
            photons,
        } = subject;
        let false_alarm = self.share(&said);
        let sigma = said.sensor.sigma_bins.with_context(|| {
            format!(
                "{}: no peak tells how wide the pulse is; --sigma-bins is needed",
                name.display()
            )
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
                Photons::List => open(name, &opening)?.photons,
            };
            let photons = Masked::new(photons, &settings.masked)?;
            Ok(Box::new(photons.with_laser_hz(said.sensor.laser_hz)))
        };
        let steps = Steps::new(self.quiet);
        let compared = compare(&Task {
            photons: &photons,
            truth,
            settings: &settings,
            sigma: sigma.to_num(),
            false_alarm,
            within_mm: self.within,
            progress: &|step| steps.at(step),
        });
        steps.finish();
        let compared = compared.with_context(|| name.display().to_string())?;
        let taken = compared
            .taken
            .as_ref()
            .map(|taken| said.with(taken).of_any_file());
        page::write(&compared, &self.out, name, taken.as_ref(), &self.inputs())?;
        if !self.quiet {
            let mut out = io::stdout().lock();
            let report = self.out.join("report.html");
            write!(out, "{}", aligned(&compared.rows()))?;
            if taken.is_some() {
                writeln!(
                    out,
                    "\n{} has these settings.",
                    self.out.join(FILES[0].0).display()
                )?;
            }
            writeln!(out, "Open {} in a browser.", report.display())?;
            out.flush()?;
        }
        Ok(())
    }

    /// The share of false alarms.
    fn share(&self, said: &SettingsFile) -> f64 {
        let share = self.false_alarm.or(said.detection.false_alarm);
        share.unwrap_or(0.01)
    }

    /// The files that are read.
    fn inputs(&self) -> Vec<&Path> {
        let files = [&self.input, &self.scene, &self.truth, &self.known.settings];
        files.into_iter().flatten().map(PathBuf::as_path).collect()
    }

    /// What the options say.
    fn options(&self) -> SettingsFile {
        SettingsFile {
            run: Run {
                cycles: self.cycles,
                seed: self.seed,
                ..Run::default()
            },
            ..SettingsFile::default()
        }
    }

    /// A scene knows everything of itself.
    fn of_scene(file: &Path, said: SettingsFile) -> Result<Subject> {
        let scene = Scene::read(file)?;
        let mut said = of_scene(said, &scene).with_context(|| file.display().to_string())?;
        let sigma = U8F8::checked_from_num(scene.pulse_sigma_bins);
        let known = sigma.filter(|sigma| *sigma <= CentredWindow::WIDEST_PULSE);
        said.sensor.sigma_bins = said.sensor.sigma_bins.or(known);
        Ok(Subject {
            said: with_short_exposures(said),
            truth: Some(Truth::Scene(Box::new(scene.clone()))),
            photons: Photons::Scene(Box::new(scene)),
        })
    }

    /// What is not said of a recording is found in it.
    fn of_recording(&self, file: &Path, said: SettingsFile) -> Result<Subject> {
        let counts = counts(file, &opening(&said))?;
        self.recording.suits(file, &counts.known)?;
        warn(file, &counts.known, self.quiet);
        warn_of_width(file, &counts.known, &said, self.quiet);
        let geometry = counts.geometry;
        let truth = match (&self.truth, &counts.truth_mm) {
            (Some(file), _) => Some(Truth::read(&file.into(), geometry)?),
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
            let found = found.with_context(|| file.display().to_string())?;
            said.clone()
                .or(found.settings(said.or(of_file(&counts.known, geometry)))?)
        };
        Ok(Subject {
            said: with_short_exposures(said),
            truth,
            photons: if counts.known.is_list {
                Photons::List
            } else {
                Photons::Histograms(counts)
            },
        })
    }
}

/// A decision may come at the second look, unless something else is said: rules have the
/// thresholds for it.
fn with_short_exposures(mut said: SettingsFile) -> SettingsFile {
    let x = said.detection.x.unwrap_or(4);
    said.detection.l1.get_or_insert(x);
    said
}
