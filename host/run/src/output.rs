//! The output folder: `events.csv`, `events.aer`, `summary.json`, the depth as arrays and a table, the maps as SVG, `report.html` that shows them, and `dtof.toml` with the settings.
//!
//! Every file is written beside its place. When all are whole they are moved
//! there, the summary last: a folder with a summary is complete.

mod age;
mod changes;
mod depth;
mod pictures;

use std::fs::{self, File, TryLockError};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Error, Result, ensure};
use dtof_core::{DepthEvent, EchoNumber, PixelAddress};
use tempfile::NamedTempFile;

use crate::Sink;
use crate::depth_map::DepthMap;
use crate::report::{Cloud, Decisions, Figure, Section};
use crate::summary::{self, Summary};
use age::LastAtBin;
use changes::Changes;
use dtof_data::events::aer_file;
use dtof_data::events::echoes::{Echo, EchoSelection};
use dtof_data::events::events_csv::{self, range_mm};
use dtof_data::events::histories::PixelHistories;
use dtof_data::events::sample::Sample;
use dtof_data::options::files::{
    PARTIAL, destination, flush_to_disk, is_same_file, keep_edited, may_replace, remove,
    temporary_file,
};
use dtof_data::options::rows::Row;
use dtof_data::photons::ranges::Ranges;
use dtof_data::photons::source::{PhotonSource, Slice};
use dtof_draw::svg;
use dtof_engine::Engine;
use dtof_engine::decisions::{Decision, KeptPixels};
use dtof_engine::settings::{Settings, SettingsFile};
use dtof_link::DynamicDepth;
use pictures::{Picture, pictures};

const CSV: &str = "events.csv";
const AER: &str = "events.aer";
const REPORT: &str = "report.html";
const SETTINGS: &str = "dtof.toml";
/// Moved to its place last: it makes the folder complete.
const SUMMARY: &str = "summary.json";
/// The prefix of unfinished files of a run.
const UNFINISHED: &str = ".dtof-run-";

/// The files of a run, until they are in the output folder.
pub struct Output {
    folder: PathBuf,
    /// Locked while it is there: no other run writes to the folder.
    _lock: NamedTempFile,
    /// Files that the run reads: they must not be replaced.
    inputs: Vec<PathBuf>,
    /// The settings of the run.
    settings: SettingsFile,
    bins: usize,
    /// None with [`Self::without_csv`].
    csv: Option<BufWriter<NamedTempFile>>,
    aer: aer_file::Writer<BufWriter<NamedTempFile>>,
    ranges: Ranges,
    maps: PixelHistories,
    axis_names: [&'static str; 2],
    sample: Sample,
    /// The pixels whose last decisions are kept, and these decisions.
    decisions: Option<(KeptPixels, Vec<Decision>)>,
    /// The requested echo, and its selection if pixels report several: for the maps, and for the events
    /// of the report unless it shows all.
    echo: Option<Echo>,
    selection: Option<EchoSelection>,
    /// The depth of each pixel, decided on all photons.
    map: Option<DepthMap>,
    /// If events have the times of their photons.
    last_events: Option<LastAtBin>,
    /// If they are requested.
    changes: Option<Changes>,
    /// The pixels of the photons.
    pixels: Vec<PixelAddress>,
}

impl Output {
    /// Checks that a run which reads the files `inputs` may write into `folder`.
    ///
    /// # Errors
    /// Fails if the folder holds the results of a comparison, or if a result would replace one of `inputs` or a file that
    /// no run has written.
    pub fn check(folder: &Path, inputs: &[PathBuf]) -> Result<()> {
        ensure!(
            !folder.join("methods.csv").exists(),
            "{}: holds the results of a comparison; take another folder",
            folder.display()
        );
        match folder.is_dir() {
            true => may_hold_results(folder, inputs),
            // It is created later.
            false => Ok(()),
        }
    }

    /// Creates the folder if it does not exist, and begins the event files for the array of `source`. The run reads the
    /// files `inputs`.
    ///
    /// # Errors
    /// Those of [`Self::check`], and fails if nothing can be written there, if another run writes there, or if the range
    /// scale is invalid.
    pub fn create(
        folder: &Path,
        settings: &Settings,
        source: &dyn PhotonSource,
        inputs: Vec<PathBuf>,
    ) -> Result<Self> {
        let ranges = settings.ranges(source.array())?;
        Self::check(folder, &inputs)?;
        fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot be the output folder", folder.display()))?;
        let lock = lock(folder, &inputs)?;
        let array = source.array();
        let name = || folder.display().to_string();
        let mut csv = BufWriter::new(temporary_file(folder, UNFINISHED)?);
        writeln!(csv, "{}", events_csv::HEADER).with_context(name)?;
        let header = header(settings, source)?;
        let aer = BufWriter::new(temporary_file(folder, UNFINISHED)?);
        let aer = aer_file::Writer::new(aer, &header).with_context(name)?;
        Ok(Self {
            folder: folder.to_owned(),
            _lock: lock,
            inputs,
            settings: SettingsFile::default().with_settings(settings),
            bins: settings.bins,
            csv: Some(csv),
            aer,
            ranges,
            maps: PixelHistories::new(array),
            axis_names: source.axis_names(),
            sample: Sample::new(Sample::LIMIT),
            decisions: None,
            echo: None,
            selection: selection(None, settings),
            map: None,
            last_events: (source.recorded_cycles().is_none() && !settings.decide_once)
                .then(|| LastAtBin::new(array)),
            changes: None,
            pixels: source.addresses(),
        })
    }

    /// Writes `requested` as the settings file.
    #[must_use]
    pub fn with_settings(self, requested: SettingsFile) -> Self {
        let settings = requested;
        Self { settings, ..self }
    }

    /// Shows dynamic depth in the report, if there are `options` for it.
    ///
    /// # Errors
    /// Fails if the threshold is too low.
    pub fn with_changes(mut self, options: Option<&DynamicDepth>) -> Result<Self> {
        let changes = options.map(|options| Changes::new(options, self.ranges.clone()));
        self.changes = changes.transpose()?;
        Ok(self)
    }

    /// Shows this echo of each exposure in maps and report. By default maps show the strongest, and the
    /// report all events.
    #[must_use]
    pub fn with_echo(mut self, echo: Option<Echo>, settings: &Settings) -> Self {
        self.echo = echo;
        self.selection = selection(echo, settings);
        self
    }

    /// Writes no `events.csv` if `without`; one of an earlier run is removed.
    #[must_use]
    pub fn without_csv(self, without: bool) -> Self {
        let csv = self.csv.filter(|_| !without);
        Self { csv, ..self }
    }

    fn show_selected(&mut self) {
        while let Some(event) = self.selection.as_mut().and_then(EchoSelection::next) {
            self.show(&event);
        }
    }

    /// Adds a selected event to maps and report.
    fn show(&mut self, event: &DepthEvent) {
        self.maps.add(event, &self.ranges);
        if self.echo.is_some() {
            self.sample.add(event, range_mm(event, &self.ranges));
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
        let several = settings.configuration.echoes > EchoNumber::FIRST;
        several.then(|| ("echoes shown".to_owned(), text.to_owned()))
    }

    /// Draws the maps and moves every file to its place. The report has `sections` beside the totals. Other settings
    /// that were in the folder are kept; returns where.
    ///
    /// # Errors
    /// Fails if the folder cannot be written.
    pub fn finish(
        mut self,
        summary: &Summary,
        title: &str,
        lead: &str,
        sections: &[Section],
    ) -> Result<Option<PathBuf>> {
        let nouns = summary.settings.reports();
        let map = self.map.as_ref();
        let pictures = pictures(&self.maps, map, self.axis_names, nouns)?;
        let changes = self.changes.as_ref();
        let changes = changes.map(|changes| changes.picture(summary.cycles, nouns[1]));
        let changes = changes.transpose()?.flatten();
        let of_maps = pictures.iter().filter_map(|picture| {
            let Picture { svg, caption, .. } = picture;
            Some((svg, caption.as_ref()?))
        });
        let of_changes = changes.iter().map(|(svg, caption)| (svg, caption));
        // Few pixels are shown in a table, not in a map.
        let few = self.maps.array.pixels() as usize <= crate::report::FEW;
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
        let mut pixels = few.then(|| self.maps.rows(self.axis_names, nouns));
        for (pixels, map) in pixels.iter_mut().zip(map) {
            for ((_, text), depth) in pixels.iter_mut().zip(&map.depth_mm) {
                *text = match depth.is_nan() {
                    true => format!("no depth; {text}"),
                    false => format!("depth {depth:.1} mm, decided on all photons; {text}"),
                };
            }
        }
        if let Some(pixels) = &pixels {
            all.insert(0, section("Pixels", pixels));
        }
        all.push(section("Settings", &settings));
        let decisions = self.decisions.as_ref();
        let decisions = decisions.filter(|(_, all)| !all.is_empty());
        let cloud = Cloud {
            array: self.maps.array,
            axis_names: self.axis_names,
            cycles: summary.cycles,
            laser_hz: summary.laser_hz,
            sample: &mut self.sample,
            is_chosen: self.echo.is_some_and(|echo| echo != Echo::All),
            pixels: &self.maps.spread(),
            nouns,
            decisions: decisions.map(|(kept, all)| Decisions {
                settings: &summary.settings,
                kept: *kept,
                all,
                array: self.maps.array,
            }),
        };
        let report = crate::report::html(title, lead, &all, &figures, cloud);

        let name = |file: &str| self.folder.join(file).display().to_string();
        let written = |content: &[u8], file: &'static str| -> Result<_> {
            let mut aside = BufWriter::new(temporary_file(&self.folder, UNFINISHED)?);
            let content = aside.write_all(content).map_err(Error::from);
            let whole = content.and_then(|()| flush_to_disk(aside));
            Ok((whole.with_context(|| name(file))?, file))
        };
        // All files are written before the first is moved to its place.
        let aer = self
            .aer
            .finish()
            .map_err(Error::from)
            .and_then(flush_to_disk);
        let mut files = vec![(aer.with_context(|| name(AER))?, AER)];
        // Without a summary the folder does not look complete. A file that this run does not write would be
        // that of another run.
        let mut removed = vec![SUMMARY];
        let array = self.maps.array;
        let means = self.maps.pixels.iter().map(|pixel| pixel.mean_mm());
        let means: Vec<f64> = means.map(|mean| mean.unwrap_or(f64::NAN)).collect();
        let ages = self.last_events.as_ref().zip(map);
        let ages = ages.map(|(last, map)| last.ages(&map.positions, summary.cycles));
        let arrays = [
            (depth::EVENTS, map.map(|_| &means)),
            (depth::CONFIDENCE, map.map(|map| &map.confidence)),
            (depth::BEST, map.map(|map| &map.best_mm)),
            (depth::AGE, ages.as_ref()),
        ];
        for (name, values) in arrays {
            match values {
                Some(values) => files.push(written(&depth::array(array, values), name)?),
                None => removed.push(name),
            }
        }
        let [nearest, farthest] = depth::LAYERS;
        let layers = map.and_then(|map| map.echoes_mm.as_ref());
        for (names, depths) in [
            (
                [depth::ARRAY, depth::TABLE],
                Some(map.map_or(&means, |map| &map.depth_mm)),
            ),
            (nearest, layers.map(|[nearest, _]| nearest)),
            (farthest, layers.map(|[_, farthest]| farthest)),
        ] {
            let Some(depths) = depths else {
                removed.extend(names);
                continue;
            };
            files.push(written(&depth::array(array, depths), names[0])?);
            let table = depth::table(array, depths, map);
            files.push(written(table.as_bytes(), names[1])?);
        }
        match self.csv {
            Some(csv) => files.push((flush_to_disk(csv).with_context(|| name(CSV))?, CSV)),
            None => removed.push(CSV),
        }
        for picture in &pictures {
            files.push(written(picture.svg.as_bytes(), picture.name)?);
        }
        if map.is_none() {
            removed.push(pictures::DEPTH);
        }
        files.push(written(report.as_bytes(), REPORT)?);
        let settings_text = self.settings.to_toml()?;
        files.push(written(settings_text.as_bytes(), SETTINGS)?);
        let summary = serde_json::to_string_pretty(summary)? + "\n";
        files.push(written(summary.as_bytes(), SUMMARY)?);

        // Files may have appeared there during the run.
        may_hold_results(&self.folder, &self.inputs)?;
        let kept = keep_edited(&self.folder.join(SETTINGS), &settings_text)?;
        for name in removed {
            remove(&self.folder.join(name))?;
        }
        for (file, name) in files {
            let place = self.folder.join(name);
            let moved = file.persist(&place).map_err(|error| error.error);
            moved.with_context(|| place.display().to_string())?;
        }
        Ok(kept)
    }
}

impl Sink for Output {
    /// Asks the engine to keep the last decisions of pixels, for the report.
    fn begin(&mut self, source: &dyn PhotonSource, engine: &mut dyn Engine) {
        let kept = KeptPixels::new(source.array(), self.bins);
        engine.keep_decisions(&|pixel| kept.contains(pixel));
        self.decisions = Some((kept, Vec::new()));
    }

    fn take(&mut self, slice: &Slice, events: &[DepthEvent]) -> Result<()> {
        self.maps.count(&self.pixels, slice);
        for event in events {
            let csv = self.csv.as_mut();
            csv.map_or(Ok(()), |csv| events_csv::write(csv, event, &self.ranges))
                .and_then(|()| self.aer.write(&aer_file::Event::Depth(*event)))
                .with_context(|| self.folder.display().to_string())?;
            if let Some(changes) = &mut self.changes {
                changes.add(event);
            }
            if self.echo.is_none() {
                self.sample.add(event, range_mm(event, &self.ranges));
            }
            if let Some(last) = &mut self.last_events {
                last.add(event);
            }
            match &mut self.selection {
                Some(selection) => selection.push(*event),
                None => self.show(event),
            }
            self.show_selected();
        }
        Ok(())
    }

    /// Shows the events that still waited for another echo of their exposure.
    fn end(&mut self, engine: &dyn Engine, map: Option<&DepthMap>) {
        if let Some(selection) = &mut self.selection {
            selection.finish();
        }
        self.show_selected();
        if let Some((_, decisions)) = &mut self.decisions {
            *decisions = engine.decisions();
        }
        self.map = map.cloned();
    }
}

/// The header of an AER file with the events of `source`.
///
/// # Errors
/// Fails if the number of bins does not fit 32 bits.
pub fn header(settings: &Settings, source: &dyn PhotonSource) -> Result<aer_file::Header> {
    Ok(aer_file::Header {
        bins: u32::try_from(settings.bins)?,
        array: source.array(),
        bin_width_ps: settings.configuration.bin_width_ps,
        offset_mm: settings.configuration.offset_mm,
        offsets_mm: settings.pixel_offsets(),
        laser_millihertz: source.laser_hz().map_or(0, |hz| hz.saturating_mul(1000)),
        start_us: 0,
    })
}

/// The selection of one echo of each exposure, if a pixel reports several and not all are shown.
fn selection(echo: Option<Echo>, settings: &Settings) -> Option<EchoSelection> {
    let echo = echo.unwrap_or(Echo::Strongest);
    let several = settings.configuration.echoes > EchoNumber::FIRST && echo != Echo::All;
    several.then(|| {
        EchoSelection::new(
            echo,
            settings.configuration.echoes,
            settings.longest_exposure(),
        )
    })
}

/// Names of results, and the mark near the start of each.
fn results() -> impl Iterator<Item = (&'static str, &'static str)> {
    let pictures = pictures::NAMES.map(|name| (name, svg::MARK));
    let layers = depth::LAYERS.into_iter();
    let layers = layers.flat_map(|[array, table]| [(array, depth::MARK), (table, depth::HEADER)]);
    let arrays = [
        depth::ARRAY,
        depth::EVENTS,
        depth::BEST,
        depth::CONFIDENCE,
        depth::AGE,
    ];
    let arrays = arrays.map(|name| (name, depth::MARK));
    pictures.into_iter().chain(layers).chain(arrays).chain([
        (CSV, events_csv::HEADER),
        (AER, aer_file::MAGIC),
        (depth::TABLE, depth::HEADER),
        (REPORT, crate::report::MARK),
        (SUMMARY, summary::MARK),
    ])
}

/// Checks that no result would replace one of `inputs`, or a file that no run has written.
fn may_hold_results(folder: &Path, inputs: &[PathBuf]) -> Result<()> {
    let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
    // Settings that were there are kept, whoever wrote them.
    destination(&folder.join(SETTINGS), &inputs)?;
    results().try_for_each(|(name, mark)| may_replace(&folder.join(name), mark, &inputs))
}

/// Creates an unfinished file and locks it, so that other runs see that this one is alive. Files that a killed run has
/// left are removed; failures of that are ignored. Those of an export or a recording stay: it may still run.
///
/// # Errors
/// Fails if nothing can be written there, or if another run is alive.
fn lock(folder: &Path, inputs: &[PathBuf]) -> Result<NamedTempFile> {
    // Locked before it looks: of two runs that begin together one sees the other.
    let own = temporary_file(folder, UNFINISHED)?;
    // Not every file system has locks.
    let _ = own.as_file().try_lock();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        let name = entry.file_name();
        let is_own = own.path().file_name() == Some(&name);
        let name = name.to_string_lossy();
        let is_unfinished = name.starts_with(UNFINISHED) && name.ends_with(PARTIAL);
        let is_read = inputs.iter().any(|input| is_same_file(input, &path));
        if is_own || is_read || !is_unfinished {
            continue;
        }
        let other = File::open(&path).map(|file| file.try_lock());
        ensure!(
            !matches!(other, Ok(Err(TryLockError::WouldBlock))),
            "{}: another run writes there; take another folder, or wait for it",
            folder.display()
        );
        let _ = fs::remove_file(path);
    }
    Ok(own)
}
