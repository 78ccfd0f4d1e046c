//! The output folder: `events.csv`, `events.aer`, `summary.json`, the maps as
//! SVG, and `report.html` that shows them.
//!
//! Every file is written beside its place. When all are whole they are moved
//! there, the summary last: a folder with a summary is complete.

mod pictures;

use std::fs;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use dtof_core::{DepthEvent, RangeScale};
use tempfile::NamedTempFile;

use crate::aer_file;
use crate::events_csv::{self, range_mm};
use crate::maps::Maps;
use crate::report::{self, Cloud, Figure, Section};
use crate::sample::Sample;
use crate::settings::Settings;
use crate::source::Geometry;
use crate::summary::Summary;
use pictures::pictures;

/// What makes a folder complete: moved to its place last.
const SUMMARY: &str = "summary.json";
/// Names of files of a run that are not complete begin so.
const OF_A_RUN: &str = ".dtof-run-";
/// Names of files that are not complete end so.
const ASIDE: &str = ".partial";

/// Files on their way into the output folder.
pub struct Output {
    folder: PathBuf,
    csv: BufWriter<NamedTempFile>,
    aer: aer_file::Writer<BufWriter<NamedTempFile>>,
    scale: RangeScale,
    maps: Maps,
    sample: Sample,
}

impl Output {
    /// Makes the folder if it is not there and begins the event files.
    ///
    /// # Errors
    /// If nothing can be written there, or the settings do not give a range.
    pub fn create(folder: &Path, settings: &Settings, geometry: Geometry) -> Result<Self> {
        let scale = settings.range_scale()?;
        fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot be the output folder", folder.display()))?;
        remove_leftovers(folder);
        let mut csv = BufWriter::new(aside(folder, OF_A_RUN)?);
        writeln!(csv, "{}", events_csv::HEADER)?;
        let header = aer_file::Header {
            bins: u32::try_from(settings.bins)?,
            geometry,
            bin_width_ps: settings.bin_width_ps.0,
            offset_mm: settings.offset_mm.0,
        };
        let aer = aer_file::Writer::new(BufWriter::new(aside(folder, OF_A_RUN)?), &header)?;
        Ok(Self {
            folder: folder.to_owned(),
            csv,
            aer,
            scale,
            maps: Maps::new(geometry),
            sample: Sample::new(Sample::LIMIT),
        })
    }

    /// Writes events in the order they come.
    ///
    /// # Errors
    /// If the disk does not take them.
    pub fn write(&mut self, events: &[DepthEvent]) -> Result<()> {
        for event in events {
            events_csv::write(&mut self.csv, event, &self.scale)
                .and_then(|()| self.aer.write(&aer_file::Event::Depth(*event)))
                .with_context(|| self.folder.display().to_string())?;
            self.maps.add(event, &self.scale);
            self.sample.add(event, range_mm(event, &self.scale));
        }
        Ok(())
    }

    /// The events so far, pixel by pixel.
    #[must_use]
    pub fn maps(&self) -> &Maps {
        &self.maps
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
        let pictures = pictures(&self.maps, called)?;
        let figures: Vec<Figure> = pictures
            .iter()
            .filter_map(|picture| {
                Some(Figure {
                    svg: &picture.svg,
                    caption: picture.caption.as_deref()?,
                })
            })
            .collect();
        let bytes = figures.iter().map(|figure| figure.svg.len()).sum();
        self.sample.limit(report::room_for_events(bytes));
        let totals = summary.rows();
        let settings = summary.settings.rows();
        let mut all = vec![Section {
            heading: "Totals",
            rows: &totals,
        }];
        all.extend(sections.iter().map(|section| Section {
            heading: section.heading,
            rows: section.rows,
        }));
        all.push(Section {
            heading: "Settings",
            rows: &settings,
        });
        let cloud = Cloud {
            geometry: self.maps.geometry,
            cycles: summary.cycles,
            sample: &self.sample,
            pixels: &self.maps.spread(),
            called,
        };
        let report = report::html(title, lead, &all, &figures, &cloud);

        let aside = |text: &str| -> Result<NamedTempFile> {
            let mut file = aside(&self.folder, OF_A_RUN)?;
            file.write_all(text.as_bytes())
                .with_context(|| self.folder.display().to_string())?;
            Ok(file)
        };
        // Everything is written before anything is moved to its place.
        let mut files = vec![
            (flushed(self.csv)?, "events.csv"),
            (flushed(self.aer.finish()?)?, "events.aer"),
        ];
        for picture in &pictures {
            files.push((aside(&picture.svg)?, picture.name));
        }
        files.push((aside(&report)?, "report.html"));
        files.push((
            aside(&(serde_json::to_string_pretty(summary)? + "\n"))?,
            SUMMARY,
        ));

        // Without a summary the folder does not look complete.
        let old = self.folder.join(SUMMARY);
        match fs::remove_file(&old) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(error).with_context(|| old.display().to_string());
            }
            _ => {}
        }
        for (file, name) in files {
            let place = self.folder.join(name);
            let moved = file.persist(&place).map_err(|error| error.error);
            moved.with_context(|| place.display().to_string())?;
        }
        Ok(())
    }
}

/// What a run that was killed has left, and nothing of an export or a recording, which
/// may be under way. None of it is worth an error.
fn remove_leftovers(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with(OF_A_RUN) && name.ends_with(ASIDE) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Where a file is to be.
pub(crate) struct Place {
    /// The folder it is written in.
    pub folder: PathBuf,
    /// The file.
    pub file: PathBuf,
}

/// Where `out` is: what it leads to, if it is a link. Only a file is ever replaced.
///
/// # Errors
/// If something else is there, or there is no folder for it.
pub(crate) fn place_of(out: &Path) -> Result<Place> {
    let name = || out.display().to_string();
    let mut file = out.to_owned();
    if let Ok(there) = fs::canonicalize(out) {
        ensure!(there.is_file(), "{}: is there, and is no file", name());
        file = there;
    } else {
        ensure!(
            !out.is_symlink(),
            "{}: is a link to what is not there",
            name()
        );
    }
    let folder = match file.parent() {
        Some(folder) if folder == Path::new("") => Path::new("."),
        Some(folder) => folder,
        None => Path::new("/"),
    };
    ensure!(
        folder.is_dir(),
        "{}: there is no folder {}",
        name(),
        folder.display()
    );
    let folder = folder.to_owned();
    Ok(Place { folder, file })
}

/// A file in `folder` that vanishes unless it is moved to its place. Its name begins
/// with `prefix`, which says whose it is.
pub(crate) fn aside(folder: &Path, prefix: &str) -> Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(prefix).suffix(ASIDE);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // As any other new file: the umask takes away what it should.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder
        .tempfile_in(folder)
        .with_context(|| folder.display().to_string())
}

/// What was buffered is on disk, or an error says that it is not.
pub(crate) fn flushed(file: BufWriter<NamedTempFile>) -> Result<NamedTempFile> {
    let file = file
        .into_inner()
        .map_err(std::io::IntoInnerError::into_error)?;
    file.as_file().sync_all()?;
    Ok(file)
}
