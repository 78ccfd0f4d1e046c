//! Recorded photons or histograms, ready for the engine.

use anyhow::{Context, Result, ensure};

use super::given::{FRAME, Given, SENSOR, of_given};
use super::recording::{RECORDING, of_file, opening};
use super::run::{Ran, Sink, run};
use dtof_engine::Engine;
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_engine::settings::{Detection, SettingsFile};
use dtof_options::Refused;
use dtof_options::progress::Progress;
use dtof_photons::masked::Masked;
use dtof_photons::medium::Medium;
use dtof_photons::open::{Known, Opening, open};
use dtof_photons::recorded::Whole;
use dtof_photons::source::{PhotonSource, has_only_neighbours};

/// What is replayed, and how.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The settings.
    pub given: Given,
}

impl dtof_options::Options for Options {
    const KEYS: &'static [&'static [&'static str]] = &[
        RECORDING,
        SENSOR,
        Detection::KEYS,
        FRAME,
        &["cycles", "seed"],
    ];

    fn set(&mut self, key: &'static str, text: &str) -> Result<(), String> {
        self.given.set(key, text)
    }

    of_given!();
}

/// A replay that can begin.
pub struct Replay {
    /// The photons.
    pub photons: Masked,
    /// The pixels.
    pub engine: Box<dyn Engine>,
    /// How they operate.
    pub settings: Settings,
    /// What was said, and what the recording says besides.
    pub said: SettingsFile,
    /// What is known of the recording.
    pub known: Known,
}

impl Replay {
    /// Replays all of `input`, which it was opened from, into `sink`.
    ///
    /// # Errors
    /// Those of [`run`].
    pub fn run(
        &mut self,
        input: &Medium,
        sink: &mut dyn Sink,
        progress: &mut dyn Progress,
    ) -> Result<Ran> {
        let how = (&self.settings, &self.said);
        let engine = self.engine.as_mut();
        let mut ran = run(&mut self.photons, engine, how, &mut [sink], progress)?;
        ran.summary.input = Some(input.to_string());
        ran.summary.cut_off = self.known.cut_off;
        ran.summary.recording.clone_from(&self.known.rows);
        ran.summary.warnings.clone_from(&self.known.warnings);
        Ok(ran)
    }
}

impl Options {
    /// What these options say, and the settings file.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn said(&self) -> Result<SettingsFile> {
        self.given.merged_for_recording()
    }

    /// Opens `input` as is `said`.
    ///
    /// # Errors
    /// What is wrong with it, its name first, or with what is said.
    pub fn open(&self, input: &Medium, said: &SettingsFile) -> Result<Replay> {
        self.open_part(input, said, None)
    }

    /// The same of an array that is a part of `whole`, if that is given.
    ///
    /// # Errors
    /// The same, and if it is no part of it or cuts blocks of pixels.
    pub fn open_part(
        &self,
        input: &Medium,
        said: &SettingsFile,
        whole: Option<Whole>,
    ) -> Result<Replay> {
        let opening = Opening {
            whole,
            ..opening(said)
        };
        let recording = open(input, &opening)?;
        let (photons, known) = (recording.photons, recording.known);
        self.given.suits(input, &known)?;
        ensure!(
            opening.whole.is_none() || !known.is_list,
            "{input} holds photons: only histograms are replayed in parts"
        );
        let said = said.clone().or(of_file(&known, photons.array()));
        let settings = said.settings(known.bins)?;
        let refused = |refused: Refused| anyhow::Error::from(refused).context(input.to_string());
        ensure!(
            known.has_shape || settings.binning.is_none(),
            refused(Refused::new(
                "binning",
                "needs to know the array: say `columns`"
            ))
        );
        if let Some(binning) = settings.binning {
            let ([column, row], side) = (photons.sides(), 1 << binning.levels.raw());
            ensure!(
                has_only_neighbours(photons.as_ref(), binning.levels),
                refused(Refused::value(
                    "binning",
                    binning.levels.raw(),
                    format!(
                        "blocks of {side}x{side} pixels would reach across captures; a {column} and \
                         a {row} are no neighbours there"
                    )
                ))
            );
            if let Some(whole) = &opening.whole {
                let pixels = photons.addresses().len();
                let is_whole = whole.has_whole_blocks(pixels, side);
                is_whole.with_context(|| input.to_string())?;
            }
        }
        let photons = Masked::new(photons, &settings.masked)?;
        let photons = photons.with_laser_hz(said.sensor.laser_hz);
        let engine = host_engine(&settings, photons.array(), &photons.addresses())?;
        Ok(Replay {
            photons,
            engine,
            settings,
            said,
            known,
        })
    }
}
