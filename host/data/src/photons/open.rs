//! Opens recordings of all formats.

use std::borrow::Cow;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use dtof_core::Array;
use dtof_core::fixed::types::{I24F8, U16F16};

use crate::options::files::is_file;
use crate::options::rows::Row;
use crate::options::{Refused, plain};
use crate::photons::axes::Axes;
use crate::photons::bins::BinFit;
use crate::photons::capture_log::{self, CaptureLog};
use crate::photons::histograms::Histograms;
use crate::photons::input::Input;
use crate::photons::npy::histograms::ArrayHistograms;
use crate::photons::npy::records::{self, RecordReader};
use crate::photons::npy::{archive, header, histograms};
use crate::photons::photon_csv::CsvReader;
use crate::photons::photon_list::{CountedSource, ListOptions, PhotonList, PhotonReader};
use crate::photons::pixel_counts::RecordedCounts;
use crate::photons::recorded::{ListTimes, RecordedHistograms, RecordingLength};
use crate::photons::source::PhotonSource;
use crate::photons::{tmf8820, warnings};
use dtof_sensors::tmf8829::OFFSET_MM;

/// The default bin width in picoseconds, if neither the user nor the file gives one.
pub const BIN_WIDTH_PS: U16F16 = U16F16::lit("250");
/// The default of the most laser cycles of histograms: their photons come in random ones, so more show little else.
pub const HISTOGRAM_CYCLES: u64 = 10_000;
/// The default number of bins of a photon list.
const LIST_BINS: u16 = 128;

/// Options for reading a recording. The file gives what is left out.
#[derive(Clone, Debug)]
pub struct ReadOptions {
    /// Photon lists: columns of the array; one row if left out.
    pub columns: Option<u32>,
    /// Bins of a run. By default 128 for a photon list; histograms keep theirs, or get the next
    /// power of two. Later bins of histograms are cut off.
    pub bins: Option<u16>,
    /// How many neighbouring bins are summed, at least 1.
    pub rebin: u16,
    /// Arrays of histograms: the meaning of each axis. By default the last is the bins.
    pub axes: Option<Axes>,
    /// `.npz`: the name of the array, which may be left out if there is only one.
    pub array: Option<String>,
    /// Histograms: the capture to use, counted from 0; all if left out.
    pub capture: Option<u32>,
    /// Picoseconds a bin of the recording.
    pub bin_width_ps: Option<U16F16>,
    /// Histograms: the length of the recording; by default one photon a laser cycle.
    pub length: Option<RecordingLength>,
    /// The most laser cycles to replay. By default all of a photon list, and [`HISTOGRAM_CYCLES`] of histograms.
    pub cycles: Option<u64>,
    /// The seed for the random laser cycles of recorded photons.
    pub seed: u64,
    /// Pixels that do not count for the length of histograms.
    pub masked: Vec<u16>,
    /// Histograms: the bins of the run for which the TDC was blind after a photon.
    pub dead_time: u16,
    /// Photon lists: photons of one pixel, laser cycle and bin count once in histograms of all of them.
    pub once_per_bin: bool,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            columns: None,
            bins: None,
            rebin: 1,
            axes: None,
            array: None,
            capture: None,
            bin_width_ps: None,
            length: None,
            cycles: None,
            seed: 1,
            masked: Vec::new(),
            dead_time: 0,
            once_per_bin: false,
        }
    }
}

/// An opened recording.
pub struct Recording {
    /// Its photons.
    pub photons: Box<dyn PhotonSource>,
    /// Its metadata.
    pub metadata: Metadata,
}

/// All photons of a recording, summed over its laser cycles.
#[derive(Clone, Debug)]
pub struct Counts {
    /// The array of one capture.
    pub array: Array,
    /// The names of its columns and rows.
    pub axis_names: [&'static str; 2],
    /// A histogram of each pixel. Captures follow each other in the address space.
    pub histograms: Histograms,
    /// Photon lists: what they tell beside the histograms.
    pub times: Option<ListTimes>,
    /// Laser cycles of the recording, if known, as for photon lists.
    pub cycles: Option<u64>,
    /// The true distance of each pixel in millimetres, if the file gives it.
    pub truth_mm: Option<Vec<Option<f64>>>,
    /// Its metadata.
    pub metadata: Metadata,
}

impl Counts {
    /// Captures: how often the array was recorded.
    #[must_use]
    pub fn captures(&self) -> usize {
        self.histograms.len() / self.array.pixels() as usize
    }

    /// The photons, each in a random laser cycle of the recording. For a photon list use [`open`]:
    /// its photons have laser cycles.
    ///
    /// # Errors
    /// Fails if there are more pixels than addresses, more photons than can be counted, or photons in
    /// the dead time of others.
    pub fn photons(&self, options: &ReadOptions) -> Result<RecordedHistograms> {
        let length = options.length;
        let length = length.unwrap_or(RecordingLength::PhotonsPerCycle(1.0));
        let cycles = options.cycles.unwrap_or(HISTOGRAM_CYCLES);
        let seed = options.seed;
        let (masked, dead_time) = (&options.masked, options.dead_time);
        let (array, histograms) = (self.array, &self.histograms);
        let photons =
            RecordedHistograms::with_masked(array, histograms, length, cycles, seed, masked);
        let photons = photons?.with_dead_time(histograms, masked, dead_time)?;
        Ok(photons.with_axis_names(self.axis_names))
    }
}

/// What a file and the options say about a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Metadata {
    /// Whether it is a list of photons rather than histograms.
    pub is_list: bool,
    /// Bins of a run: a power of two from 8 to 1024.
    pub bins: usize,
    /// Picoseconds a bin of the run: from the options or the file, else [`BIN_WIDTH_PS`], times
    /// [`ReadOptions::rebin`].
    pub bin_width_ps: U16F16,
    /// Whether neither options nor file give a bin width.
    pub is_width_assumed: bool,
    /// Millimetres to be added to every range, if the format has an offset.
    pub offset_mm: Option<I24F8>,
    /// The first and the last bin that were recorded in full, if not all were.
    pub gate: Option<(u16, u16)>,
    /// Whether rows and columns are known. A list without columns is taken for one row, and so are histograms in two axes
    /// without names; the first of more than three axes without names may be captures.
    pub has_shape: bool,
    /// Whether another axis than the last looks like the bins. Then no histogram is one.
    pub looks_swapped: bool,
    /// The captures of the file, whether one or all are used.
    pub captures: usize,
    /// Photons in bins that were cut off.
    pub cut_off: u64,
    /// The changes made to the recording, as a table.
    pub rows: Vec<Row>,
    /// Warnings, one a line.
    pub warnings: Vec<String>,
}

/// The content of a file.
enum Content {
    Histograms(Counts),
    Photons(Box<dyn CountedSource>, Metadata),
}

/// A recording that has been checked, before its length and masked pixels are settled.
pub struct CheckedRecording {
    input: Input,
    content: Content,
}

impl CheckedRecording {
    /// Its metadata.
    #[must_use]
    pub const fn metadata(&self) -> &Metadata {
        match &self.content {
            Content::Histograms(counts) => &counts.metadata,
            Content::Photons(_, metadata) => metadata,
        }
    }

    /// The array of one capture.
    #[must_use]
    pub fn array(&self) -> Array {
        match &self.content {
            Content::Histograms(counts) => counts.array,
            Content::Photons(photons, _) => photons.array(),
        }
    }

    /// Its histograms. Photon lists are summed over the laser cycles that were requested.
    ///
    /// # Errors
    /// Fails if the file has changed since it was checked.
    pub fn counts(&mut self) -> Result<Cow<'_, Counts>> {
        match &mut self.content {
            Content::Histograms(counts) => Ok(Cow::Borrowed(counts)),
            Content::Photons(photons, metadata) => {
                Ok(Cow::Owned(counts_of(photons.as_mut(), metadata.clone())?))
            }
        }
    }

    /// Its photons. Of `options` only those count that settle the length of histograms: `length`, `cycles`,
    /// `seed`, `masked` and `dead_time`.
    ///
    /// # Errors
    /// Those of [`Counts::photons`], after the name of the recording.
    pub fn photons(self, options: &ReadOptions) -> Result<Recording> {
        Ok(self.photons_and_counts(options)?.0)
    }

    /// The same, and all photons of histograms.
    ///
    /// # Errors
    /// As for [`Self::photons`].
    pub fn photons_and_counts(
        self,
        options: &ReadOptions,
    ) -> Result<(Recording, Option<RecordedCounts>)> {
        match self.content {
            Content::Photons(photons, metadata) => Ok((Recording { photons, metadata }, None)),
            Content::Histograms(counts) => {
                let photons = counts.photons(options);
                let photons = photons.with_context(|| self.input.to_string())?;
                let (histograms, metadata) = (counts.histograms, counts.metadata);
                let cycles = photons.cycles_left();
                let all = RecordedCounts { histograms, cycles };
                let photons = Box::new(photons);
                Ok((Recording { photons, metadata }, Some(all)))
            }
        }
    }
}

/// The kinds of files, told by their names.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Array,
    Archive,
    Log,
    Csv,
}

/// Reads a recording and checks all of it.
///
/// # Errors
/// Returns what is wrong with the recording or its options, after its name.
pub fn check(input: impl Into<Input>, options: &ReadOptions) -> Result<CheckedRecording> {
    let input = input.into();
    let content = read(&input, options)?;
    Ok(CheckedRecording { input, content })
}

/// Opens a recording as photons and checks all of it.
///
/// # Errors
/// Returns what is wrong with the recording or its options, after its name.
pub fn open(input: impl Into<Input>, options: &ReadOptions) -> Result<Recording> {
    check(input, options)?.photons(options)
}

/// Reads a recording as histograms. Photon lists are summed over their laser cycles.
///
/// # Errors
/// Returns what is wrong with the recording or its options, after its name.
pub fn counts(input: impl Into<Input>, options: &ReadOptions) -> Result<Counts> {
    match read(&input.into(), options)? {
        Content::Histograms(counts) => Ok(counts),
        Content::Photons(mut photons, metadata) => counts_of(photons.as_mut(), metadata),
    }
}

fn counts_of(photons: &mut dyn CountedSource, metadata: Metadata) -> Result<Counts> {
    let (histograms, times) = photons.counts()?;
    Ok(Counts {
        array: photons.array(),
        axis_names: photons.axis_names(),
        histograms,
        times: Some(times),
        cycles: Some(photons.cycles()),
        truth_mm: None,
        metadata,
    })
}

fn read(input: &Input, options: &ReadOptions) -> Result<Content> {
    if let Some(path) = input.file() {
        is_file(path).with_context(|| input.to_string())?;
    }
    let kind = input.file().map_or(Ok(Kind::Array), kind)?;
    let opened = match kind {
        Kind::Array => Some(header::Array::open(input).with_context(|| input.to_string())?),
        _ => None,
    };
    // Three columns that `axes` names are pixels.
    let has_axes = options.axes.is_some();
    let of_records = |array: &header::Array<_>| records::other_fields(&array.header, has_axes);
    let has_records = opened.as_ref().and_then(of_records);
    let is_list = kind == Kind::Csv || has_records.is_some();
    check_options(input, options, kind, is_list)?;
    if let Some(others) = has_records {
        let mut content = list::<RecordReader>(input, options)?;
        if let (false, Content::Photons(_, metadata)) = (others.is_empty(), &mut content) {
            let row = ("fields not read".to_owned(), others.join(", "));
            metadata.rows.push(row);
        }
        return Ok(content);
    }
    let (axes, name) = (options.axes.as_ref(), options.array.as_deref());
    let mut content = match (kind, opened) {
        (Kind::Csv, _) => list::<CsvReader>(input, options)?,
        (Kind::Log, _) => log(input.file().context("a log is a file")?, options)?,
        (_, Some(opened)) => {
            let read = histograms::read(opened, axes).with_context(|| input.to_string())?;
            array(input, options, read)?
        }
        (_, None) => {
            let path = input.file().context("an archive is a file")?;
            array(input, options, archive::read(path, name, axes)?)?
        }
    };
    if let (Content::Histograms(counts), Some(RecordingLength::Cycles(cycles))) =
        (&mut content, options.length)
    {
        let highest = counts.histograms.iter();
        let highest = highest.filter_map(|counts| counts.into_iter().max());
        let warning = warnings::few_cycles(highest.collect(), cycles, options.rebin);
        counts.metadata.warnings.extend(warning);
    }
    if let (Content::Histograms(counts), Some(columns)) = (&content, options.columns) {
        let has = counts.array.columns();
        ensure!(
            columns == has,
            Refused::value(
                "columns",
                columns,
                format!("{} has {has}; this is for photon lists", plain(input))
            )
        );
    }
    Ok(content)
}

fn kind(path: &Path) -> Result<Kind> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let name = name.to_ascii_lowercase();
    let kinds = [
        (".npy", Kind::Array),
        (".npz", Kind::Archive),
        (".json", Kind::Log),
        (".json.gz", Kind::Log),
        (".csv", Kind::Csv),
    ];
    let kind = kinds.iter().find(|(end, _)| name.ends_with(end));
    let Some((_, kind)) = kind else {
        ensure!(
            !name.ends_with(".gz"),
            "{}: only the log of a sensor, .json.gz, is read compressed; unpack it with gunzip",
            path.display()
        );
        bail!(
            "{}: the name must end in .npy, .npz, .json, .json.gz or .csv; save another format \
             from Python as an array of counts with numpy.save",
            path.display()
        );
    };
    Ok(*kind)
}

/// Refuses options that do not apply to such a file.
fn check_options(input: &Input, options: &ReadOptions, kind: Kind, is_list: bool) -> Result<()> {
    ensure!(
        options.axes.is_none() || (matches!(kind, Kind::Array | Kind::Archive) && !is_list),
        Refused::new(
            "axes",
            format!(
                "is for arrays of histograms; {} is something else",
                plain(input)
            )
        )
    );
    ensure!(
        options.capture.is_none() || !is_list,
        Refused::new(
            "capture",
            format!("is for histograms; {} holds photons", plain(input))
        )
    );
    ensure!(
        options.array.is_none() || kind == Kind::Archive,
        Refused::new(
            "array",
            format!("is for .npz files; {} is another file", plain(input))
        )
    );
    Ok(())
}

fn list<R: PhotonReader + 'static>(input: &Input, options: &ReadOptions) -> Result<Content> {
    let shape = ListOptions {
        bins: options.bins.unwrap_or(LIST_BINS),
        rebin: options.rebin.max(1),
        columns: options.columns,
        once_per_bin: options.once_per_bin,
    };
    let mut metadata =
        metadata(shape.bins.into(), None, options).with_context(|| input.to_string())?;
    let cycles = options.cycles.unwrap_or(u64::MAX);
    let photons = PhotonList::<R>::open(input, shape, cycles)?;
    metadata.is_list = true;
    metadata
        .warnings
        .extend(warnings::late_photons(photons.first_cycle(), cycles));
    metadata.warnings.extend(photons.times_as_cycles());
    metadata
        .warnings
        .extend(warnings::list_shape(photons.pixels(), shape.columns));
    metadata.has_shape = shape.columns.is_some() || photons.array().pixels() == 1;
    if shape.rebin > 1 {
        let sums = format!("{} sums of {}", shape.bins, shape.rebin);
        metadata.rows.push(("neighbours added up".to_owned(), sums));
    }
    Ok(Content::Photons(Box::new(photons), metadata))
}

fn array(input: &Input, options: &ReadOptions, read: ArrayHistograms) -> Result<Content> {
    let ArrayHistograms {
        layout,
        axes,
        histograms,
    } = read;
    let (mut swapped, mut perhaps) = (None, None);
    if options.axes.is_none() {
        swapped = warnings::swapped_axes(&axes, &histograms);
        perhaps = warnings::bins_may_be_first(&axes, &histograms).filter(|_| swapped.is_none());
    }
    let counts = fit_bins(layout.array, histograms, layout.bins(), None, options);
    let mut counts = counts.with_context(|| input.to_string())?;
    counts.axis_names = layout.axis_names;
    counts.metadata.has_shape = layout.is_shape_known;
    counts.metadata.looks_swapped = swapped.is_some();
    counts.metadata.warnings.extend(swapped.or(perhaps));
    Ok(Content::Histograms(counts))
}

fn log(path: &Path, options: &ReadOptions) -> Result<Content> {
    let in_file = || path.display().to_string();
    let counts = match capture_log::read(path)? {
        CaptureLog::Tmf8820(log) => {
            let width = Some(log.bin_width_ps);
            let counts = fit_bins(log.array, log.histograms, tmf8820::BINS, width, options);
            let mut counts = counts.with_context(in_file)?;
            counts.axis_names = log.axis_names;
            // Of the capture that is used.
            let first = options.capture.unwrap_or(0) * log.array.pixels();
            let used = counts.histograms.len();
            let truth = log.truth_mm.map(|all| {
                let of_used = all.into_iter().skip(first as usize).take(used);
                of_used.collect::<Vec<_>>()
            });
            counts.truth_mm = truth.filter(|truth| truth.iter().any(Option::is_some));
            counts.metadata.offset_mm = log.offset_mm;
            counts
        }
        CaptureLog::Tmf8829(log) => {
            let width = Some(log.bin_width_ps);
            let counts = fit_bins(log.array, log.histograms, log.measured_bins, width, options);
            let mut counts = counts.with_context(in_file)?;
            counts.metadata.offset_mm = Some(OFFSET_MM);
            if let (Some(shift), None) = (log.assumed_shift, options.bin_width_ps) {
                let width = log.bin_width_ps;
                counts.metadata.warnings.push(format!(
                    "the log has no bin_shift: {shift} is taken, the sensor's default, with bins of {width:.1} ps; \
                     --bin-width-ps gives another width"
                ));
            }
            counts.metadata.rows.splice(0..0, log.rows);
            counts
        }
    };
    Ok(Content::Histograms(counts))
}

/// Histograms with the bins of a run, from those of a recording, whose first `measured` bins were measured in full.
fn fit_bins(
    array: Array,
    mut histograms: Histograms,
    measured: usize,
    width_ps: Option<U16F16>,
    options: &ReadOptions,
) -> Result<Counts> {
    let each = array.pixels() as usize;
    let all = histograms.len() / each;
    if let Some(capture) = options.capture {
        let place = usize::try_from(capture)?;
        let reason = match all {
            1 => "there is 1; `axes` says which axis of an array has captures".to_owned(),
            _ => format!("there are {all}, counted from 0"),
        };
        ensure!(place < all, Refused::value("capture", capture, reason));
        let pixels = place * each..(place + 1) * each;
        histograms = Histograms::of(pixels.map(|pixel| histograms.histogram(pixel)))?;
    }
    let recorded = histograms.bins();
    let fit = BinFit::new(recorded, measured, options.rebin.into(), options.bins)?;
    let mut metadata = metadata(fit.bins(), width_ps, options)?;
    let (histograms, cut_off) = fit.apply(histograms);
    metadata.cut_off = cut_off;
    let is_empty = |bins: Vec<u64>| bins.iter().all(|&count| count == 0);
    let empty = warnings::empty_histograms(histograms.iter().map(is_empty));
    metadata.captures = all;
    metadata.gate = fit.gate();
    metadata.rows = fit.rows(metadata.cut_off);
    if let Some(capture) = options.capture {
        let row = (
            "capture".to_owned(),
            format!("{capture} of {all}, counted from 0"),
        );
        metadata.rows.insert(0, row);
    }
    metadata.warnings.extend(empty);
    Ok(Counts {
        array,
        axis_names: ["column", "row"],
        histograms,
        times: None,
        cycles: None,
        truth_mm: None,
        metadata,
    })
}

/// The metadata of a run with so many bins. `width_ps` is the bin width in the file, if it has one.
fn metadata(bins: usize, width_ps: Option<U16F16>, options: &ReadOptions) -> Result<Metadata> {
    let known = options.bin_width_ps.or(width_ps);
    let requested = known.unwrap_or(BIN_WIDTH_PS);
    let width = requested.checked_mul_int(options.rebin.max(1).into());
    Ok(Metadata {
        bins,
        bin_width_ps: width.ok_or_else(|| {
            let reason = format!("makes bins of {requested} ps too wide");
            Refused::value("rebin", options.rebin, reason)
        })?,
        is_width_assumed: known.is_none(),
        offset_mm: None,
        gate: None,
        is_list: false,
        has_shape: true,
        looks_swapped: false,
        captures: 1,
        cut_off: 0,
        rows: Vec::new(),
        warnings: warnings::narrow_bins(requested).into_iter().collect(),
    })
}

#[cfg(test)]
mod tests;
