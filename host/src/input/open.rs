//! Opens a recording of any format that this program reads, by the name of the file.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use dtof_core::fixed::types::{I24F8, U16F16};

use crate::input::photon_csv::PhotonCsv;
use crate::input::recorded::{Capture, RecordedHistograms, RecordingLength};
use crate::input::source::{Geometry, PhotonSource};
use crate::input::{npy, tmf8820};
use crate::rows::Row;

/// What a user says of a recording. What is left out the file says.
#[derive(Clone, Debug)]
pub struct Opening {
    /// Photon lists: columns of the array, one row without.
    pub columns: Option<u32>,
    /// Bins of a run: 128 of a photon list if left out.
    pub bins: Option<u16>,
    /// Histograms: how long they lasted, one photon a laser cycle if left out.
    pub length: Option<RecordingLength>,
    /// Laser cycles to read, at most.
    pub cycles: u64,
    /// Seed of the laser cycles that recorded photons are given.
    pub seed: u64,
}

impl Default for Opening {
    fn default() -> Self {
        Self {
            columns: None,
            bins: None,
            length: None,
            cycles: u64::MAX,
            seed: 1,
        }
    }
}

/// An opened recording, and what its format says of it.
pub struct Recording {
    /// Its photons.
    pub photons: Box<dyn PhotonSource>,
    /// What is known besides.
    pub format: Known,
}

/// All photons of a recording, summed over its laser cycles.
#[derive(Clone, Debug)]
pub struct Counts {
    /// The array.
    pub geometry: Geometry,
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
    pub format: Known,
}

/// What a recording says of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Known {
    /// Bins of a histogram: a power of two from 8 to 1024.
    pub bins: usize,
    /// Picoseconds a bin.
    pub bin_width_ps: Option<U16F16>,
    /// Millimetres to be added to every range.
    pub offset_mm: Option<I24F8>,
    /// The first and the last bin that were measured, if not all were.
    pub gate: Option<(u16, u16)>,
    /// What was done to fit the recording to the bins.
    pub rows: Vec<Row>,
    /// What is surely wrong with it, a line each.
    pub warnings: Vec<String>,
}

impl Known {
    const fn new(bins: usize) -> Self {
        Self {
            bins,
            bin_width_ps: None,
            offset_mm: None,
            gate: None,
            rows: Vec::new(),
            warnings: Vec::new(),
        }
    }
}

/// What a file holds.
enum Content {
    Histograms(Counts),
    Photons(PhotonCsv, Known),
}

/// Opens `path` as photons. Everything in it is checked.
///
/// # Errors
/// What is wrong with the file or what was said of it; the file's name first.
pub fn open(path: &Path, opening: &Opening) -> Result<Recording> {
    match read(path, opening)? {
        Content::Photons(photons, format) => Ok(Recording {
            photons: Box::new(photons),
            format,
        }),
        Content::Histograms(counts) => {
            let length = opening
                .length
                .unwrap_or(RecordingLength::PhotonsPerCycle(1.0));
            let photons = RecordedHistograms::new(
                counts.geometry,
                &counts.captures,
                length,
                opening.cycles,
                opening.seed,
            );
            let photons = photons.with_context(|| path.display().to_string())?;
            Ok(Recording {
                photons: Box::new(photons.with_sides(counts.sides)),
                format: counts.format,
            })
        }
    }
}

/// Reads `path` as histograms. Those of photon lists are summed over their laser cycles.
///
/// # Errors
/// What is wrong with the file or what was said of it; the file's name first.
pub fn counts(path: &Path, opening: &Opening) -> Result<Counts> {
    let (mut photons, format) = match read(path, opening)? {
        Content::Histograms(counts) => return Ok(counts),
        Content::Photons(photons, format) => (photons, format),
    };
    let geometry = photons.geometry();
    let addresses = photons.addresses();
    let mut capture = vec![vec![0; format.bins]; geometry.addresses()];
    let mut left = photons.cycles();
    while left > 0 {
        let next = u16::try_from(left).unwrap_or(u16::MAX);
        let slice = photons.next_slice(next)?;
        for (address, pixel) in addresses.iter().zip(&slice.pixels) {
            for photon in &pixel.photons {
                capture[usize::from(address.0)][usize::from(photon.code)] += 1;
            }
        }
        left -= u64::from(next);
    }
    Ok(Counts {
        geometry,
        sides: photons.sides(),
        captures: vec![capture],
        cycles: Some(photons.cycles()),
        truth_mm: None,
        format,
    })
}

fn read(path: &Path, opening: &Opening) -> Result<Content> {
    let extension = path.extension().and_then(|extension| extension.to_str());
    let extension = extension.map(str::to_ascii_lowercase);
    let content = match extension.as_deref() {
        Some("npy") => {
            let npy = npy::read(path)?;
            expect_bins(path, opening, npy.bins)?;
            Content::Histograms(Counts {
                geometry: npy.geometry,
                sides: ["column", "row"],
                captures: vec![npy.capture],
                cycles: None,
                truth_mm: None,
                format: Known::new(npy.bins),
            })
        }
        Some("json") => {
            let log = tmf8820::read(path)?;
            expect_bins(path, opening, tmf8820::BINS)?;
            Content::Histograms(Counts {
                geometry: log.geometry,
                sides: tmf8820::SIDES,
                captures: log.captures,
                cycles: None,
                truth_mm: log.truth_mm,
                format: Known {
                    bin_width_ps: Some(tmf8820::BIN_WIDTH_PS),
                    offset_mm: Some(tmf8820::OFFSET_MM),
                    ..Known::new(tmf8820::BINS)
                },
            })
        }
        Some("csv") => {
            ensure!(
                opening.length.is_none(),
                "--photons-per-cycle and --recorded-cycles are for histograms; {} holds photons",
                path.display()
            );
            let bins = opening.bins.unwrap_or(128).into();
            let photons = PhotonCsv::open(path, bins, opening.columns, opening.cycles)?;
            Content::Photons(photons, Known::new(bins))
        }
        _ => bail!(
            "{}: the name must end in .npy, .json or .csv",
            path.display()
        ),
    };
    if let (Content::Histograms(counts), Some(columns)) = (&content, opening.columns) {
        ensure!(
            columns == counts.geometry.columns,
            "--columns {columns}: {} has {}",
            path.display(),
            counts.geometry.columns
        );
    }
    Ok(content)
}

/// A file that says how many bins it has is not read as another.
fn expect_bins(path: &Path, opening: &Opening, bins: usize) -> Result<()> {
    let wanted = opening.bins.map_or(bins, usize::from);
    ensure!(
        wanted == bins,
        "{}: --bins {wanted}, but the file has {bins}; leave --bins out",
        path.display()
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts_of(name: &str, text: &str) -> Counts {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        counts(&path, &Opening::default()).unwrap()
    }

    #[test]
    fn photon_lists_are_summed_over_their_laser_cycles() {
        let counts = counts_of(
            "a.csv",
            "pixel,cycle,bin\n2,0,5\n2,7,5\n0,70000,127\n2,70000,6\n",
        );
        assert_eq!(counts.geometry, Geometry::new(3, 1));
        assert_eq!(counts.cycles, Some(70_001));
        let [pixels] = &counts.captures[..] else {
            panic!("one capture")
        };
        let sums: Vec<u64> = pixels.iter().map(|bins| bins.iter().sum()).collect();
        assert_eq!(sums, [1, 0, 3]);
        assert_eq!([pixels[2][5], pixels[2][6], pixels[0][127]], [2, 1, 1]);
    }

    #[test]
    fn the_truth_of_a_log_is_that_of_its_centre_zones() {
        let zone = format!("[{}]", ["3"; 128].join(","));
        let zones = format!("\"hists\": [{}]", [zone.as_str(); 9].join(","));
        let log = format!("[{{{zones}}}, {{{zones}, \"dist_to_plane\": 0.25}}]");
        let counts = counts_of("a.json", &log);
        assert_eq!(counts.captures.len(), 2);
        let truth = counts.truth_mm.unwrap();
        let expected = |address: usize| (address == 9 + 4).then_some(250.0);
        assert_eq!(truth, (0..18).map(expected).collect::<Vec<_>>());
        assert_eq!(counts.format.bin_width_ps, Some(tmf8820::BIN_WIDTH_PS));
    }
}
