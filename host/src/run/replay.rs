//! Recorded photons or histograms, ready for the engine.

use anyhow::{Context, Result, ensure};
use clap::Args;

use super::operation::{Frames, Operation};
use super::recording::{Recording, of_file, opening};
use crate::cli::arguments::{MOST_WHOLE, whole};
use crate::engine::Engine;
use crate::engine::host::host_engine;
use crate::engine::settings::Settings;
use crate::input::masked::Masked;
use crate::input::medium::Medium;
use crate::input::open::{Known, Opening, open};
use crate::input::recorded::Whole;
use crate::input::source::{PhotonSource, has_only_neighbours};
use crate::settings::{Run, SettingsFile};

/// What is replayed, and how.
#[derive(Args)]
#[group(skip)]
pub struct Options {
    #[command(flatten)]
    recording: Recording,
    /// How pixels operate.
    #[command(flatten)]
    pub operation: Operation,
    #[command(flatten)]
    frames: Frames,
    /// Replay only the first N laser cycles [default: 10000]
    #[arg(long, value_name = "N", value_parser = whole(1..=MOST_WHOLE))]
    cycles: Option<u64>,
    /// Seed of the laser cycles that recorded photons are given [default: 1]
    #[arg(long, value_name = "N", value_parser = whole(0..=MOST_WHOLE))]
    seed: Option<u64>,
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

impl Options {
    /// What these options say, and the settings file.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn said(&self) -> Result<SettingsFile> {
        let options = Run {
            cycles: self.cycles,
            seed: self.seed,
            frame: self.frames.frame,
            ..Run::default()
        };
        self.recording
            .said(|recording| self.operation.said(recording.or(options.into())))
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
        self.recording.suits(input, &known)?;
        ensure!(
            opening.whole.is_none() || !known.is_list,
            "{input} holds photons: only histograms are replayed in parts"
        );
        let said = said.clone().or(of_file(&known, photons.geometry()));
        let settings = said.settings(known.bins)?;
        ensure!(
            known.has_shape || settings.binning.is_none(),
            "{input}: --binning needs to know the array: say --columns"
        );
        if let Some(binning) = settings.binning {
            let ([column, row], side) = (photons.sides(), 1 << binning.levels.raw());
            ensure!(
                has_only_neighbours(photons.as_ref(), binning.levels),
                "{input}: --binning {}: blocks of {side}x{side} pixels would reach across \
                 captures; a {column} and a {row} are no neighbours there",
                binning.levels.raw()
            );
            if let Some(whole) = &opening.whole {
                let pixels = photons.addresses().len();
                let is_whole = whole.has_whole_blocks(pixels, side);
                is_whole.with_context(|| input.to_string())?;
            }
        }
        let photons = Masked::new(photons, &settings.masked)?;
        let photons = photons.with_laser_hz(said.sensor.laser_hz);
        let engine = host_engine(&settings, photons.geometry(), &photons.addresses())?;
        Ok(Replay {
            photons,
            engine,
            settings,
            said,
            known,
        })
    }
}
