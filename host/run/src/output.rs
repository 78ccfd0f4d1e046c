//! The output folder: `events.csv`, `events.aer`, `summary.json`, the maps as
//! SVG, `report.html` that shows them, and `dtof.toml` with the settings.
//!
//! Every file is written beside its place. When all are whole they are moved
//! there, the summary last: a folder with a summary is complete.

mod changes;
mod pictures;

use std::fs;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Error, Result, ensure};
use dtof_core::{DepthEvent, EchoNumber, PixelAddress, RangeScale};
use tempfile::NamedTempFile;

use crate::Sink;
use crate::summary::{self, Summary};
use changes::Changes;
use dtof_draw::svg;
use dtof_engine::Engine;
use dtof_engine::decisions::{Decision, Kept};
use dtof_engine::settings::Settings;
use dtof_engine::settings::{self, SettingsFile};
use dtof_events::aer_file;
use dtof_events::echoes::{Echo, Selection};
use dtof_events::events_csv::{self, range_mm};
use dtof_events::maps::Maps;
use dtof_events::sample::Sample;
use dtof_link::DynamicDepth;
use dtof_options::files::{ASIDE, are_same, aside, flushed, may_replace};
use dtof_options::rows::Row;
use dtof_photons::source::{PhotonSource, Slice};
use dtof_report::{Cloud, Decisions, Figure, Section};
use pictures::{Picture, pictures};

const CSV: &str = "events.csv";
const AER: &str = "events.aer";
const REPORT: &str = "report.html";
const SETTINGS: &str = "dtof.toml";
/// Makes a folder complete: moved to its place last.
const SUMMARY: &str = "summary.json";
/// Names of files of a run that are not complete begin so.
const OF_A_RUN: &str = ".dtof-run-";

/// Files on their way into the output folder.
pub struct Output {
    folder: PathBuf,
    /// What is read, and so stays.
    inputs: Vec<PathBuf>,
    /// The settings of the run.
    settings: SettingsFile,
    bins: usize,
    /// Unless it is not wanted.
    csv: Option<BufWriter<NamedTempFile>>,
    aer: aer_file::Writer<BufWriter<NamedTempFile>>,
    scale: RangeScale,
    maps: Maps,
    sides: [&'static str; 2],
    sample: Sample,
    /// What the last events of pixels were decided from.
    decisions: Option<(Kept, Vec<Decision>)>,
    /// The echo asked for, and the choice of it where pixels report several: for the maps, and
    /// for the events of the report unless it shows all.
    echo: Option<Echo>,
    selection: Option<Selection>,
    /// If they are asked for.
    changes: Option<Changes>,
    /// The pixels of the photons.
    pixels: Vec<PixelAddress>,
}

impl Output {
    /// Makes the folder if it is not there and begins the event files for the array of
    /// `source`.
    ///
    /// # Errors
    /// If nothing can be written there, or the settings do not give a range. Or if a result
    /// would replace `input`, or a file that no run of this program has written.
    pub fn create(
        folder: &Path,
        settings: &Settings,
        source: &dyn PhotonSource,
        input: Option<&Path>,
    ) -> Result<Self> {
        let scale = settings.range_scale()?;
        ensure!(
            !folder.join("methods.csv").exists(),
            "{}: holds the results of a comparison; take another folder",
            folder.display()
        );
        fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot be the output folder", folder.display()))?;
        let inputs: Vec<PathBuf> = input.into_iter().map(Path::to_owned).collect();
        may_hold_results(folder, &inputs)?;
        remove_leftovers(folder, &inputs);
        let array = source.array();
        let name = || folder.display().to_string();
        let mut csv = BufWriter::new(aside(folder, OF_A_RUN)?);
        writeln!(csv, "{}", events_csv::HEADER).with_context(name)?;
        let header = header(settings, source)?;
        let aer = BufWriter::new(aside(folder, OF_A_RUN)?);
        let aer = aer_file::Writer::new(aer, &header).with_context(name)?;
        Ok(Self {
            folder: folder.to_owned(),
            inputs,
            settings: SettingsFile::default().with(settings),
            bins: settings.bins,
            csv: Some(csv),
            aer,
            scale,
            maps: Maps::new(array),
            sides: source.sides(),
            sample: Sample::new(Sample::LIMIT),
            decisions: None,
            echo: None,
            selection: selection(None, settings),
            changes: None,
            pixels: source.addresses(),
        })
    }

    /// The settings file of the folder is `said`, which was read from `file`, if from one.
    ///
    /// # Errors
    /// If a result would replace it.
    pub fn with_settings(mut self, said: SettingsFile, file: Option<&Path>) -> Result<Self> {
        self.settings = said;
        self.inputs.extend(file.map(Path::to_owned));
        may_hold_results(&self.folder, &self.inputs)?;
        Ok(self)
    }

    /// The report shows dynamic depth as well, if there are `options` for it.
    ///
    /// # Errors
    /// If the threshold is too low.
    pub fn with_changes(mut self, options: Option<&DynamicDepth>) -> Result<Self> {
        let changes = options.map(|options| Changes::new(options, self.scale));
        self.changes = changes.transpose()?;
        Ok(self)
    }

    /// Maps and report show this echo of each exposure. Without, maps show the strongest and
    /// the events of the report are all.
    #[must_use]
    pub fn with_echo(mut self, echo: Option<Echo>, settings: &Settings) -> Self {
        self.echo = echo;
        self.selection = selection(echo, settings);
        self
    }

    /// Without `events.csv`; one of an earlier run is removed.
    #[must_use]
    pub fn without_csv(self, without: bool) -> Self {
        let csv = self.csv.filter(|_| !without);
        Self { csv, ..self }
    }

    fn show_decided(&mut self) {
        while let Some(event) = self.selection.as_mut().and_then(Selection::next) {
            self.show(&event);
        }
    }

    /// An event that has been chosen.
    fn show(&mut self, event: &DepthEvent) {
        self.maps.add(event, &self.scale);
        if self.echo.is_some() {
            self.sample.add(event, range_mm(event, &self.scale));
        }
    }

    /// Which echoes maps and report show, if pixels report several.
    fn echo_row(&self, settings: &Settings) -> Option<Row> {
        let text = match self.echo {
            None => "all as events, the strongest of an exposure in the maps",
            Some(Echo::First) => "the nearest of an exposure",
            Some(Echo::Last) => "the farthest of an exposure",
            Some(Echo::Strongest) => "the strongest of an exposure",
            Some(Echo::All) => "all",
        };
        let several = settings.echoes > EchoNumber::FIRST;
        several.then(|| ("echoes shown".to_owned(), text.to_owned()))
    }

    /// Draws the maps and puts every file in its place. `sections` stand in the
    /// report beside the totals.
    ///
    /// # Errors
    /// If the folder cannot be written.
    pub fn finish(
        mut self,
        summary: &Summary,
        title: &str,
        lead: &str,
        sections: &[Section],
    ) -> Result<()> {
        let called = summary.settings.reports();
        let pictures = pictures(&self.maps, self.sides, called)?;
        let changes = self.changes.as_ref();
        let changes = changes.map(|changes| changes.picture(summary.cycles, called[1]));
        let changes = changes.transpose()?.flatten();
        let of_maps = pictures.iter().filter_map(|picture| {
            let Picture { svg, caption, .. } = picture;
            Some((svg, caption.as_ref()?))
        });
        let of_changes = changes.iter().map(|(svg, caption)| (svg, caption));
        // Few pixels are no picture: a table says the same.
        let few = self.maps.array.pixels() as usize <= dtof_report::FEW;
        let figures = of_maps.filter(|_| !few).chain(of_changes);
        let figures: Vec<Figure> = figures
            .map(|(svg, caption)| Figure { svg, caption })
            .collect();
        let totals = summary.rows();
        let mut settings = summary.settings.rows();
        settings.extend(self.echo_row(&summary.settings));
        let section = |heading, rows| Section { heading, rows };
        let mut all = vec![section("Totals", &totals[..])];
        all.extend(sections);
        let pixels = few.then(|| self.maps.rows(self.sides, called));
        if let Some(pixels) = &pixels {
            all.insert(0, section("Pixels", pixels));
        }
        all.push(section("Settings", &settings));
        let decisions = self.decisions.as_ref();
        let decisions = decisions.filter(|(_, all)| !all.is_empty());
        let cloud = Cloud {
            array: self.maps.array,
            sides: self.sides,
            cycles: summary.cycles,
            laser_hz: summary.laser_hz,
            sample: &mut self.sample,
            is_chosen: self.echo.is_some_and(|echo| echo != Echo::All),
            pixels: &self.maps.spread(),
            called,
            decisions: decisions.map(|(kept, all)| Decisions {
                settings: &summary.settings,
                kept: *kept,
                all,
                array: self.maps.array,
            }),
        };
        let report = dtof_report::html(title, lead, &all, &figures, cloud);

        let name = |file: &str| self.folder.join(file).display().to_string();
        let written = |text: &str, file: &'static str| -> Result<_> {
            let mut aside = BufWriter::new(aside(&self.folder, OF_A_RUN)?);
            let text = aside.write_all(text.as_bytes()).map_err(Error::from);
            let whole = text.and_then(|()| flushed(aside));
            Ok((whole.with_context(|| name(file))?, file))
        };
        // Everything is written before anything is moved to its place.
        let aer = self.aer.finish().map_err(Error::from).and_then(flushed);
        let mut files = vec![(aer.with_context(|| name(AER))?, AER)];
        // Without a summary the folder does not look complete; a table that is not written
        // is not that of another run.
        let mut gone = vec![SUMMARY];
        match self.csv {
            Some(csv) => files.push((flushed(csv).with_context(|| name(CSV))?, CSV)),
            None => gone.push(CSV),
        }
        for picture in &pictures {
            files.push(written(&picture.svg, picture.name)?);
        }
        files.push(written(&report, REPORT)?);
        files.push(written(&self.settings.to_toml()?, SETTINGS)?);
        let summary = serde_json::to_string_pretty(summary)? + "\n";
        files.push(written(&summary, SUMMARY)?);

        // Something may have come there since.
        may_hold_results(&self.folder, &self.inputs)?;
        for name in gone {
            let old = self.folder.join(name);
            match fs::remove_file(&old) {
                Err(error) if error.kind() != ErrorKind::NotFound => {
                    return Err(error).with_context(|| old.display().to_string());
                }
                _ => {}
            }
        }
        for (file, name) in files {
            let place = self.folder.join(name);
            let moved = file.persist(&place).map_err(|error| error.error);
            moved.with_context(|| place.display().to_string())?;
        }
        Ok(())
    }
}

impl Sink for Output {
    /// The report shows what the last events of pixels were decided from.
    fn begin(&mut self, source: &dyn PhotonSource, engine: &mut dyn Engine) {
        let kept = Kept::of(source.array(), self.bins);
        engine.keep_decisions(&|pixel| kept.holds(pixel));
        self.decisions = Some((kept, Vec::new()));
    }

    fn take(&mut self, slice: &Slice, events: &[DepthEvent]) -> Result<()> {
        self.maps.count(&self.pixels, slice);
        for event in events {
            let csv = self.csv.as_mut();
            csv.map_or(Ok(()), |csv| events_csv::write(csv, event, &self.scale))
                .and_then(|()| self.aer.write(&aer_file::Event::Depth(*event)))
                .with_context(|| self.folder.display().to_string())?;
            if let Some(changes) = &mut self.changes {
                changes.add(event);
            }
            if self.echo.is_none() {
                self.sample.add(event, range_mm(event, &self.scale));
            }
            match &mut self.selection {
                Some(selection) => selection.push(*event),
                None => self.show(event),
            }
            self.show_decided();
        }
        Ok(())
    }

    /// No event waits for another echo of its exposure.
    fn end(&mut self, engine: &dyn Engine) {
        if let Some(selection) = &mut self.selection {
            selection.finish();
        }
        self.show_decided();
        if let Some((_, decisions)) = &mut self.decisions {
            *decisions = engine.decisions();
        }
    }
}

/// The header of an AER file with the events of `source`.
///
/// # Errors
/// Never: a run has at most 1024 bins.
pub fn header(settings: &Settings, source: &dyn PhotonSource) -> Result<aer_file::Header> {
    Ok(aer_file::Header {
        bins: u32::try_from(settings.bins)?,
        array: source.array(),
        bin_width_ps: settings.bin_width_ps,
        offset_mm: settings.offset_mm,
        laser_millihertz: source.laser_hz().map_or(0, |hz| hz.saturating_mul(1000)),
        start_us: 0,
    })
}

/// What chooses the echo of each exposure, if a pixel reports several and not all are shown.
fn selection(echo: Option<Echo>, settings: &Settings) -> Option<Selection> {
    let echo = echo.unwrap_or(Echo::Strongest);
    let several = settings.echoes > EchoNumber::FIRST && echo != Echo::All;
    several.then(|| Selection::new(echo, settings.echoes, settings.l2))
}

/// Names of results, and what stands near the start of each.
fn results() -> impl Iterator<Item = (&'static str, &'static str)> {
    let pictures = pictures::NAMES.map(|name| (name, svg::MARK));
    pictures.into_iter().chain([
        (CSV, events_csv::HEADER),
        (AER, aer_file::MAGIC),
        (REPORT, dtof_report::MARK),
        (SETTINGS, settings::MARK),
        (SUMMARY, summary::MARK),
    ])
}

/// Checks that no result would replace one of `inputs`, or a file that no run has written.
fn may_hold_results(folder: &Path, inputs: &[PathBuf]) -> Result<()> {
    let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
    results().try_for_each(|(name, mark)| may_replace(&folder.join(name), mark, &inputs))
}

/// Removes what a killed run has left, and nothing of an export or a recording, which
/// may be under way. None of it is worth an error.
fn remove_leftovers(folder: &Path, inputs: &[PathBuf]) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let is_read = inputs.iter().any(|input| are_same(input, &entry.path()));
        if name.starts_with(OF_A_RUN) && name.ends_with(ASIDE) && !is_read {
            let _ = fs::remove_file(entry.path());
        }
    }
}
