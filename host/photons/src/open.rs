//! Opens a recording of any format that this program reads.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use dtof_core::Array;
use dtof_core::fixed::types::{I24F8, U16F16};

use crate::axes::Axes;
use crate::bins::Fit;
use crate::capture_log::{self, CaptureLog};
use crate::medium::Medium;
use crate::npy::histograms::Histograms;
use crate::npy::records::{self, Records};
use crate::npy::{archive, histograms};
use crate::photon_csv::CsvRows;
use crate::photon_list::{Listed, PhotonList, Rows, Shape};
use crate::recorded::{Capture, RecordedHistograms, RecordingLength, Whole};
use crate::source::PhotonSource;
use crate::{tmf8820, tmf8829, warnings};
use dtof_options::rows::Row;
use dtof_options::{Refused, plain};

/// Picoseconds a bin, if neither the user nor the file says.
pub const BIN_WIDTH_PS: U16F16 = U16F16::lit("250");
/// Bins of a photon list, unless the user says.
const LIST_BINS: u16 = 128;

/// What a user says of a recording. What is left out the file says.
#[derive(Clone, Debug)]
pub struct Opening {
    /// Photon lists: columns of the array, one row without.
    pub columns: Option<u32>,
    /// Bins of a run: if left out 128 of a photon list, and of histograms as many as they have,
    /// or the next power of two. Later bins of histograms are cut off.
    pub bins: Option<u16>,
    /// Neighbouring bins that are added up, 1 or more.
    pub rebin: u16,
    /// Arrays of histograms: which axis is what; without, the last is the bins.
    pub axes: Option<Axes>,
    /// `.npz`: the name of the array; a single one needs none.
    pub array: Option<String>,
    /// Picoseconds a bin of the recording.
    pub bin_width_ps: Option<U16F16>,
    /// Histograms: how long they lasted, one photon a laser cycle if left out.
    pub length: Option<RecordingLength>,
    /// Laser cycles to read, at most.
    pub cycles: u64,
    /// Seed of the laser cycles that recorded photons are given.
    pub seed: u64,
    /// Arrays of histograms: the recording that these are a part of.
    pub whole: Option<Whole>,
    /// Pixels that say nothing of how long histograms lasted.
    pub masked: Vec<u16>,
}

impl Default for Opening {
    fn default() -> Self {
        Self {
            columns: None,
            bins: None,
            rebin: 1,
            axes: None,
            array: None,
            bin_width_ps: None,
            length: None,
            cycles: u64::MAX,
            seed: 1,
            whole: None,
            masked: Vec::new(),
        }
    }
}

/// An opened recording, and what is known of it.
pub struct Recording {
    /// Its photons.
    pub photons: Box<dyn PhotonSource>,
    /// What is known besides.
    pub known: Known,
}

/// All photons of a recording, summed over its laser cycles.
#[derive(Clone, Debug)]
pub struct Counts {
    /// The array of one capture.
    pub array: Array,
    /// The names of its columns and rows.
    pub sides: [&'static str; 2],
    /// Histograms that were recorded together, one a pixel. Captures lie one after the other
    /// in the address space.
    pub captures: Vec<Capture>,
    /// Laser cycles of the recording, if they are known: of photon lists.
    pub cycles: Option<u64>,
    /// The true distance of each pixel in millimetres, where the file has it.
    pub truth_mm: Option<Vec<Option<f64>>>,
    /// What is known besides.
    pub known: Known,
}

impl Counts {
    /// Their photons, each in a random laser cycle of the recording. Those of a photon list
    /// have laser cycles of their own: [`open`] gives them.
    ///
    /// # Errors
    /// If there are more pixels than addresses, or more photons than can be counted.
    pub fn photons(&self, opening: &Opening) -> Result<RecordedHistograms> {
        let length = opening.length;
        let length = length.unwrap_or(RecordingLength::PhotonsPerCycle(1.0));
        let (most, seed) = (opening.cycles, opening.seed);
        let whole = match &opening.whole {
            None => Whole::of(self.array, &self.captures)?,
            Some(whole) => whole.clone(),
        };
        let whole = whole.with_masked(opening.masked.clone());
        let photons = RecordedHistograms::part(&whole, &self.captures, length, most, seed);
        Ok(photons?.with_sides(self.sides))
    }
}

/// What is known of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Known {
    /// Whether it is a list of photons, and not histograms.
    pub is_list: bool,
    /// Bins of a run: a power of two from 8 to 1024.
    pub bins: usize,
    /// Picoseconds a bin of the run: as the user says or the file, or [`BIN_WIDTH_PS`], times
    /// [`Opening::rebin`].
    pub bin_width_ps: U16F16,
    /// Millimetres to be added to every range, if the format says.
    pub offset_mm: Option<I24F8>,
    /// The first and the last bin that were recorded in full, if not all were.
    pub gate: Option<(u16, u16)>,
    /// Whether rows and columns are known, and not a list taken for one row.
    pub has_shape: bool,
    /// Photons in bins that were cut off.
    pub cut_off: u64,
    /// What was done to the recording.
    pub rows: Vec<Row>,
    /// What is surely wrong with it, a line each.
    pub warnings: Vec<String>,
}

/// What a file holds.
enum Content {
    Histograms(Counts),
    Photons(Box<dyn Listed>, Known),
}

/// What files hold, told by their names.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Array,
    Archive,
    Log,
    Csv,
}

/// Opens a recording, a file or an array in memory, as photons. Everything in it is checked.
///
/// # Errors
/// What is wrong with it or what was said of it; its name first.
pub fn open(input: impl Into<Medium>, opening: &Opening) -> Result<Recording> {
    let medium = input.into();
    match read(&medium, opening)? {
        Content::Photons(photons, known) => Ok(Recording { photons, known }),
        Content::Histograms(counts) => {
            let photons = counts.photons(opening);
            Ok(Recording {
                photons: Box::new(photons.with_context(|| medium.to_string())?),
                known: counts.known,
            })
        }
    }
}

/// Reads a recording, a file or an array in memory, as histograms. Those of photon lists are summed over their laser cycles.
///
/// # Errors
/// What is wrong with it or what was said of it; its name first.
pub fn counts(input: impl Into<Medium>, opening: &Opening) -> Result<Counts> {
    let (mut photons, known) = match read(&input.into(), opening)? {
        Content::Histograms(counts) => return Ok(counts),
        Content::Photons(photons, known) => (photons, known),
    };
    Ok(Counts {
        array: photons.array(),
        sides: photons.sides(),
        captures: vec![photons.counts()?],
        cycles: Some(photons.cycles()),
        truth_mm: None,
        known,
    })
}

fn read(medium: &Medium, opening: &Opening) -> Result<Content> {
    let kind = medium.file().map_or(Ok(Kind::Array), kind)?;
    let has_records = match kind {
        Kind::Array => records::other_fields(medium)?,
        _ => None,
    };
    let is_list = kind == Kind::Csv || has_records.is_some();
    suits(medium, opening, kind, is_list)?;
    if let Some(others) = has_records {
        let mut content = list::<Records>(medium, opening)?;
        if let (false, Content::Photons(_, known)) = (others.is_empty(), &mut content) {
            let row = ("fields not read".to_owned(), others.join(", "));
            known.rows.push(row);
        }
        return Ok(content);
    }
    let (axes, name) = (opening.axes.as_ref(), opening.array.as_deref());
    let content = match kind {
        Kind::Csv => list::<CsvRows>(medium, opening)?,
        Kind::Log => log(medium.file().context("a log is a file")?, opening)?,
        Kind::Array => array(medium, opening, histograms::read(medium, axes)?)?,
        Kind::Archive => {
            let path = medium.file().context("an archive is a file")?;
            array(medium, opening, archive::read(path, name, axes)?)?
        }
    };
    if let (Content::Histograms(counts), Some(columns)) = (&content, opening.columns) {
        let has = counts.array.columns();
        ensure!(
            columns == has,
            Refused::value(
                "columns",
                columns,
                format!("{} has {has}; this is for photon lists", plain(medium))
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
        bail!(
            "{}: the name must end in .npy, .npz, .json, .json.gz or .csv; save another format \
             from Python as an array of counts with numpy.save",
            path.display()
        );
    };
    Ok(*kind)
}

/// Options that say nothing about such a file are refused.
fn suits(medium: &Medium, opening: &Opening, kind: Kind, is_list: bool) -> Result<()> {
    ensure!(
        opening.axes.is_none() || (matches!(kind, Kind::Array | Kind::Archive) && !is_list),
        Refused::new(
            "axes",
            format!("is for arrays of histograms; {} is none", plain(medium))
        )
    );
    ensure!(
        opening.array.is_none() || kind == Kind::Archive,
        Refused::new(
            "array",
            format!("is for .npz files; {} is none", plain(medium))
        )
    );
    Ok(())
}

fn list<R: Rows + 'static>(medium: &Medium, opening: &Opening) -> Result<Content> {
    let shape = Shape {
        bins: opening.bins.unwrap_or(LIST_BINS),
        rebin: opening.rebin.max(1),
        columns: opening.columns,
    };
    let mut known = known(shape.bins.into(), None, opening).with_context(|| medium.to_string())?;
    let photons = PhotonList::<R>::open(medium, shape, opening.cycles)?;
    known.is_list = true;
    known.has_shape = shape.columns.is_some() || photons.array().pixels() == 1;
    if shape.rebin > 1 {
        let sums = format!("{} sums of {}", shape.bins, shape.rebin);
        known.rows.push(("neighbours added up".to_owned(), sums));
    }
    Ok(Content::Photons(Box::new(photons), known))
}

fn array(medium: &Medium, opening: &Opening, read: Histograms) -> Result<Content> {
    let Histograms {
        layout,
        first,
        pixels,
    } = read;
    // A part is too little to tell.
    let axes = match (&opening.axes, &opening.whole) {
        (None, None) => warnings::of_axes(first, &pixels),
        _ => None,
    };
    let bins = layout.bins();
    let captures = pixels.chunks(layout.array.pixels() as usize);
    let captures = captures.map(<[_]>::to_vec).collect();
    let counts = fitted(layout.array, captures, [bins, bins], None, opening);
    let mut counts = counts.with_context(|| medium.to_string())?;
    counts.sides = layout.sides;
    counts.known.warnings.extend(axes);
    Ok(Content::Histograms(counts))
}

fn log(path: &Path, opening: &Opening) -> Result<Content> {
    let in_file = || path.display().to_string();
    let counts = match capture_log::read(path)? {
        CaptureLog::Tmf8820(log) => {
            let width = Some(tmf8820::BIN_WIDTH_PS);
            let (array, bins) = (tmf8820::ARRAY, [tmf8820::BINS; 2]);
            let counts = fitted(array, log.captures, bins, width, opening);
            let mut counts = counts.with_context(in_file)?;
            counts.sides = tmf8820::SIDES;
            counts.truth_mm = log.truth_mm;
            counts.known.offset_mm = Some(tmf8820::OFFSET_MM);
            counts
        }
        CaptureLog::Tmf8829(log) => {
            let width = Some(log.bin_width_ps);
            let bins = [tmf8829::BINS, log.measured_bins];
            let counts = fitted(log.array, log.captures, bins, width, opening);
            let mut counts = counts.with_context(in_file)?;
            counts.known.offset_mm = Some(tmf8829::OFFSET_MM);
            counts.known.rows.splice(0..0, log.rows);
            counts
        }
    };
    Ok(Content::Histograms(counts))
}

/// Histograms with the bins of a run. The recording has `recorded` bins, the first `measured`
/// of them in full.
fn fitted(
    array: Array,
    captures: Vec<Capture>,
    [recorded, measured]: [usize; 2],
    width_ps: Option<U16F16>,
    opening: &Opening,
) -> Result<Counts> {
    let fit = Fit::new(recorded, measured, opening.rebin.into(), opening.bins)?;
    let mut known = known(fit.bins(), width_ps, opening)?;
    let mut fit_one = |histogram| {
        let (histogram, cut_off) = fit.apply(histogram);
        known.cut_off = known.cut_off.saturating_add(cut_off);
        histogram
    };
    let captures = captures.into_iter();
    let captures: Vec<Capture> = captures
        .map(|capture| capture.into_iter().map(&mut fit_one).collect())
        .collect();
    // A part says what is known of the whole.
    let empty = match &opening.whole {
        None => {
            let histograms = captures.iter().flatten();
            warnings::of_photons(histograms.map(|bins| bins.iter().all(|&count| count == 0)))
        }
        Some(whole) => {
            warnings::of_photons(whole.captures.iter().flatten().map(|&total| total == 0))
        }
    };
    known.cut_off = opening
        .whole
        .as_ref()
        .map_or(known.cut_off, |whole| whole.cut_off);
    known.gate = fit.gate();
    known.rows = fit.rows(known.cut_off);
    known.warnings.extend(empty);
    Ok(Counts {
        array,
        sides: ["column", "row"],
        captures,
        cycles: None,
        truth_mm: None,
        known,
    })
}

/// What is known of a run with so many bins, if the file says how wide its own are.
fn known(bins: usize, width_ps: Option<U16F16>, opening: &Opening) -> Result<Known> {
    let said = opening.bin_width_ps.or(width_ps).unwrap_or(BIN_WIDTH_PS);
    let width = said.checked_mul_int(opening.rebin.max(1).into());
    Ok(Known {
        bins,
        bin_width_ps: width.ok_or_else(|| {
            let reason = format!("makes bins of {said} ps too wide");
            Refused::value("rebin", opening.rebin, reason)
        })?,
        offset_mm: None,
        gate: None,
        is_list: false,
        has_shape: true,
        cut_off: 0,
        rows: Vec::new(),
        warnings: warnings::of_bin_width(said).into_iter().collect(),
    })
}
