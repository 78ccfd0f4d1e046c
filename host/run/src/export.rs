//! Depth events in formats that other programs read.
//!
//! | format | for |
//! |---|---|
//! | CSV | tables |
//! | PCD, PLY | programs for point clouds and meshes |
//! | MCAP | Foxglove |
//! | ROS 2 | a bag of point clouds |
//! | EVT2 | tools for event cameras |
//!
//! `export` turns an AER file into one of them. It reads the file twice and holds only a few events, so memory stays
//! constant. The output appears under its name when it is whole. `points` gives points of events in memory.
//!
//! ## Example
//!
//! ```rust
//! use dtof_core::fixed::types::{I24F8, U16F16};
//! use dtof_core::{Array, Histogram, LaserCycle, PixelAddress, PixelConfig};
//! use dtof_data::events::aer_file::{Event, Header};
//! use dtof_run::export::{Options, points};
//!
//! // Nine photons in bin 60 of the only pixel of an array.
//! let config = PixelConfig::<128>::paper().build()?;
//! let mut histogram = Histogram::<128>::new();
//! histogram.add_batch(&[60; 9]);
//! let detection = config.detect(&histogram).expect("nine photons against none");
//! let event = Event::Depth(detection.event(PixelAddress::new(0), LaserCycle::new(99), 100));
//!
//! let header = Header {
//!     bins: 128,
//!     array: Array::new(1, 1).unwrap(),
//!     bin_width_ps: U16F16::lit("250"),
//!     offset_mm: I24F8::ZERO,
//!     offsets_mm: Vec::new(),
//!     laser_millihertz: 10_000_000_000, // 10 MHz
//!     start_us: 0,
//! };
//! // Records of 31 bytes, which begin with x, y and z in metres.
//! let record = points([&event], &header, &Options::default())?;
//! let z = f32::from_le_bytes(record[8..12].try_into()?);
//! assert_eq!((z * 1000.0).round(), 2267.0); // straight ahead, 60.5 bins away
//! # Ok::<(), anyhow::Error>(())
//! ```
//!
//! ## What it does not know
//!
//! - It needs no photons and no device: events come from an AER file, or from the caller.
//! - It draws nothing. [`report`](crate::report) and `dtof-live` do.
//! - An AER file has no angles. Without a calibration file, pixels are those of a pinhole camera of 60 degrees.
//! - If the laser rate is not known, times are for 10 MHz, and a warning says so.
//! - EVT2 holds 2³⁴ microseconds and 2048 pixels a side. More is refused.
//!
//! ## From events to a file
//!
//! The AER file is read twice: to count the events up to its end or to where it is damaged, and to
//! write them. `docs/export.md` describes each format.

mod csv;
mod depth_map;
mod events;
mod evt2;
pub mod foxglove;
mod mcap;
mod pcd;
mod ply;
pub mod points;
pub mod projection;
mod reorder;
mod ros2;
mod span;

use std::fmt::Write;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use dtof_link::DynamicDepth;
use tempfile::NamedTempFile;

use dtof_data::events::aer_file::{self, Event, EventKind, Header};
use dtof_data::events::clock::LaserClock;
use dtof_data::events::echoes::Echo;
use dtof_data::events::histories::PixelHistories;
use dtof_data::named_values;
use dtof_data::options::files::{destination, flush_to_disk, is_new_or_marked, temporary_file};
use dtof_data::options::keys::{Key, Kind, names};
use dtof_data::options::numbers::boolean;
use dtof_data::options::progress::Progress;
use dtof_data::options::rows::grouped;
use dtof_data::options::{Refused, named};
use dtof_engine::settings::{RaySettings, SensorSettings, SettingsFile};

use depth_map::{DepthMap, depth_map};
use events::Survey;
use mcap::Slices;
use points::Points;
use projection::Projection;
use span::Span;

named_values! {
    /// The format of an exported file.
    #[derive(Debug, PartialEq, Eq)]
    pub enum Format {
        /// Comma-separated values
        Csv = "csv",
        /// Points, in the format of PCL
        Pcd = "pcd",
        /// Points, as vertices of a mesh
        Ply = "ply",
        /// Points slice by slice and statistics, for Foxglove
        Mcap = "mcap",
        /// Points slice by slice as a bag of ROS 2 (MCAP)
        Ros2 = "ros2",
        /// Changes of depth as an event camera's RAW file (EVT2)
        Evt2 = "evt2",
    }
}

impl Format {
    /// Near the start of each file of this format.
    fn mark(self) -> &'static str {
        match self {
            Self::Csv => csv::COLUMNS,
            Self::Pcd => "# .PCD v0.7",
            Self::Ply => "ply\nformat binary_little_endian",
            Self::Mcap | Self::Ros2 => "MCAP0",
            Self::Evt2 => "% evt 2.0",
        }
    }
}

/// How events become points in space and time, or changes of depth.
#[derive(Clone, Debug)]
pub struct Options {
    /// The rays of the pixels.
    pub rays: RaySettings,
    /// The settings file that was read, which is not replaced.
    pub settings: Option<PathBuf>,
    /// The rate of the laser, by default that of the file, else the paper's 10 MHz.
    pub clock: Option<LaserClock>,
    /// The kind of events to export, if the file has depth events and changes of depth.
    pub kind: Option<EventKind>,
    /// Which echo of each exposure, of depth events.
    pub echo: Echo,
    /// CSV, PCD and PLY: one point for each pixel, at the depth of its `depth.npy`.
    pub one_per_pixel: bool,
    /// MCAP and ROS 2: nanoseconds of a slice, not 0; by default 1/100 of the run, see
    /// docs/export.md.
    pub slice_ns: Option<u64>,
    /// EVT2: how changes are found in depth events.
    pub dynamic_depth: DynamicDepth,
}

impl Default for Options {
    /// A pinhole camera, the laser rate of the file, and the paper's dynamic depth: 0.1 m
    /// between the means of adjacent events (section III-E).
    fn default() -> Self {
        Self {
            rays: RaySettings::default(),
            settings: None,
            clock: None,
            kind: None,
            echo: Echo::All,
            one_per_pixel: false,
            slice_ns: None,
            dynamic_depth: DynamicDepth::default(),
        }
    }
}

/// How events become points, as given by options.
#[derive(Clone, Debug, Default)]
pub struct ProjectionOptions {
    /// Which echo of each exposure.
    pub echo: Option<Echo>,
    /// Whether each pixel has one point, at its depth.
    pub one_per_pixel: bool,
    /// The rays and the laser rate, which override those of a settings file.
    pub given: SettingsFile,
}

impl dtof_data::options::Options for ProjectionOptions {
    const KEYS: &'static [&'static [Key]] = &[&[
    Key::of(RaySettings::KEYS, "field_of_view_degrees").with_help(
        "Field of view in degrees from edge to edge [default: 60 along the longer side, with square \
         pixels]",
    ),
    Key::of(RaySettings::KEYS, "calibration").with_help(
        "TOML file with a direction and a range bias for each pixel; docs/export.md lists its keys",
    ),
    Key::of(SensorSettings::KEYS, "laser_hz").with_help(
        "Laser cycles a second, if the file has none or is wrong [default: the file's, else 10000000 \
         with a warning]",
    ),
    Key::new(
        "echo",
        Kind::OneOf(names::<Echo>),
        "ECHO",
        "Depth events: echo of each exposure of a pixel or block [default: all; the strongest with \
         `one_per_pixel`]",
    ),
    Key::new(
        "one_per_pixel",
        Kind::Switch,
        "YES",
        "CSV, PCD and PLY: one point a pixel, at the depth of depth-events.npy, in place of a point \
         an event",
    ),
    ]];

    fn set(&mut self, key: &'static str, text: &str) -> Result<(), String> {
        match key {
            "echo" => self.echo = Some(named(text)?),
            "one_per_pixel" => self.one_per_pixel = boolean(text)?,
            _ => self.given.set(key, text)?,
        }
        Ok(())
    }

    fn file(&mut self, key: &str) -> Option<&mut Option<PathBuf>> {
        (key == "calibration").then_some(&mut self.given.rays.calibration)
    }

    fn check(&self) -> Result<(), Refused> {
        self.given.check()
    }
}

impl ProjectionOptions {
    /// These options, and the settings of `file` that they do not override.
    ///
    /// # Errors
    /// Fails if the laser rate is 0.
    pub fn options(self, file: SettingsFile) -> Result<Options> {
        let SettingsFile {
            sensor, rays, file, ..
        } = self.given.or(file);
        Ok(Options {
            rays,
            settings: file.map(|file| file.path),
            clock: sensor.laser_hz.map(LaserClock::new).transpose()?,
            echo: self.echo.unwrap_or(match self.one_per_pixel {
                true => Echo::Strongest, // as the maps of a run
                false => Echo::All,
            }),
            one_per_pixel: self.one_per_pixel,
            ..Options::default()
        })
    }
}

/// The result of an export.
#[derive(Debug)]
pub struct ExportSummary {
    /// Events or points in the file.
    pub written: u64,
    /// Events that came too late to be put in order; they are left out.
    pub late: u64,
    /// Where and how the AER file is damaged, if it is. Everything before is written.
    pub damage: Option<String>,
    /// The assumptions behind points and times: "60x32.2 degrees, 10 MHz".
    pub assumptions: String,
    /// That the laser rate is not the file's, and why nothing was written, a line each.
    pub warnings: Vec<String>,
}

/// A temporary file.
type Out = BufWriter<NamedTempFile>;

/// A complete file.
struct Finished {
    out: Out,
    written: u64,
    late: u64,
}

/// Writes events to a file.
trait Sink {
    fn write(&mut self, event: &Event) -> Result<()>;
    fn finish(self: Box<Self>) -> Result<Finished>;
}

/// Writes the events of the AER file `input` to `out`.
///
/// # Errors
/// Fails if `input` is not an AER file, holds what the format cannot, or `out` cannot be written;
/// `out` stays as it was. Damage of `input` is not an error: see [`ExportSummary::damage`].
pub fn export(
    input: &Path,
    out: &Path,
    format: Format,
    options: &Options,
    progress: &mut dyn Progress,
) -> Result<ExportSummary> {
    let name = || input.display().to_string();
    let others = [&options.rays.calibration, &options.settings];
    let others = others.into_iter().flatten().map(PathBuf::as_path);
    let inputs: Vec<&Path> = [input].into_iter().chain(others).collect();
    let place = destination(out, &inputs)?;
    ensure!(
        is_new_or_marked(out, format.mark(), &inputs)?,
        "{}: is there and no {} file; move it away, or take another name",
        out.display(),
        format.name()
    );
    let survey =
        Survey::read(input, format, options.clock, options.echo, progress).with_context(name)?;
    let kind = survey.kind(options.kind).with_context(name)?;
    ensure!(
        kind == EventKind::Depth || !options.one_per_pixel,
        Refused::new("one_per_pixel", "is only for depth events")
    );
    ensure!(
        kind == EventKind::Depth || options.echo == Echo::All,
        Refused::new("echo", "is only for depth events")
    );
    ensure!(
        !options.one_per_pixel || matches!(format, Format::Csv | Format::Pcd | Format::Ply),
        Refused::new("one_per_pixel", "is only for csv, pcd and ply")
    );
    let (header, clock) = (&survey.header, survey.clock);
    let array = header.array;
    let (rays, assumed_rays) = options.rays.rays(array)?;
    let ranges = header.ranges().with_context(name)?;
    let mut all = Events {
        input,
        survey: &survey,
        kind,
        echo: options.echo,
        progress,
    };
    let depth_map = match options.one_per_pixel {
        true => {
            let mut histories = PixelHistories::new(array);
            all.read(&mut |event| {
                if let Event::Depth(event) = event {
                    histories.add(event, &ranges);
                }
                Ok(())
            })?;
            Some(depth_map(&histories))
        }
        false => None,
    };
    let projection = Projection {
        rays,
        ranges,
        clock,
        depths_mm: depth_map
            .as_ref()
            .map_or(Vec::new(), |map| map.depths_mm.clone()),
    };
    let mut assumptions = match format {
        Format::Evt2 => clock.to_string(),
        _ => format!("{assumed_rays}, {clock}"),
    };
    let span = Span::new(format, &clock, header, survey.latest).with_context(name)?;
    let slice_ns = options
        .slice_ns
        .unwrap_or_else(|| mcap::slice_of(span.end_ns));
    let to = || out.display().to_string();
    let file = temporary_file(&place.folder, ".dtof-export-").with_context(to)?;
    let file = BufWriter::new(file);
    let points = match &depth_map {
        Some(map) => map.events.len() as u64,
        None => survey.chosen(kind),
    };
    let sink: Result<Box<dyn Sink>> = match format {
        Format::Csv => csv::begin(file, projection, kind).map(boxed),
        Format::Pcd => Points::packed(file, projection, &pcd::header(kind, points)).map(boxed),
        Format::Ply => Points::packed(file, projection, &ply::header(kind, points)).map(boxed),
        Format::Mcap | Format::Ros2 => {
            let _ = write!(
                assumptions,
                ", clouds every {} µs",
                slice_ns as f64 / 1000.0
            );
            let for_ros2 = format == Format::Ros2;
            let slices = Slices { span, slice_ns };
            mcap::Mcap::new(file, projection, array, kind, slices, for_ros2).map(boxed)
        }
        Format::Evt2 => {
            let changes = &options.dynamic_depth;
            let config = changes.config(projection.ranges.scale()).map_err(|error| {
                Refused::value("threshold_mm", changes.threshold_mm, error.to_string())
            })?;
            evt2::Evt2::new(file, array, clock, config, options.echo).map(boxed)
        }
    };
    let mut sink = sink.with_context(to)?;

    let mut write = |event: &Event| sink.write(event).with_context(to);
    match &depth_map {
        Some(map) => map.events.iter().try_for_each(write)?,
        None => all.read(&mut write)?,
    }
    let finished = sink.finish().with_context(to)?;
    let moved = flush_to_disk(finished.out)
        .with_context(to)?
        .persist(&place.file);
    moved.map_err(|error| error.error).with_context(to)?;
    let empty = (finished.written == 0).then(|| match points {
        0 => "no events, so the new file has none".to_owned(),
        _ => format!(
            "no change of depth above {} mm in {} events, so the new file has none",
            options.dynamic_depth.threshold_mm,
            grouped(points)
        ),
    });
    Ok(ExportSummary {
        written: finished.written,
        late: finished.late,
        damage: survey.damage,
        assumptions,
        warnings: survey.warning.into_iter().chain(empty).collect(),
    })
}

/// The selected events of a file.
struct Events<'a> {
    input: &'a Path,
    survey: &'a Survey,
    kind: EventKind,
    echo: Echo,
    progress: &'a mut dyn Progress,
}

impl Events<'_> {
    /// Gives them to `each`, in the order of the file.
    fn read(&mut self, each: &mut dyn FnMut(&Event) -> Result<()>) -> Result<()> {
        let name = || self.input.display().to_string();
        let all = self.survey.all();
        self.progress.begin(all, "events");
        let mut events = aer_file::open(self.input).with_context(name)?;
        let mut selection = events::selection(self.echo);
        for done in 1..=all {
            let event = events.next_event().with_context(name)?;
            let event = event.with_context(|| format!("{} changed while it was read", name()))?;
            match event {
                _ if event.kind() != self.kind => {}
                Event::Depth(event) => selection.push(event),
                Event::DynamicDepth(_) => each(&event)?,
            }
            for event in selection.by_ref() {
                each(&Event::Depth(event))?;
            }
            if done.is_multiple_of(4096) {
                self.progress.at(done)?;
            }
        }
        selection.finish();
        for event in selection {
            each(&Event::Depth(event))?;
        }
        self.progress.end();
        Ok(())
    }
}

/// `events` of an array with this header as points: the records of the `pcd` format, without its
/// header.
///
/// # Errors
/// Fails if the rays cannot be read, or the header has no valid scale.
pub fn points<'a>(
    events: impl IntoIterator<Item = &'a Event>,
    header: &Header,
    options: &Options,
) -> Result<Vec<u8>> {
    let (clock, _) = LaserClock::for_file(options.clock, header);
    let mut projection = Projection {
        rays: options.rays.rays(header.array)?.0,
        ranges: header.ranges()?,
        clock,
        depths_mm: Vec::new(),
    };
    let mut events: Vec<Event> = events.into_iter().copied().collect();
    if options.one_per_pixel {
        let mut histories = PixelHistories::new(header.array);
        for event in &events {
            if let Event::Depth(event) = event {
                histories.add(event, &projection.ranges);
            }
        }
        DepthMap {
            events,
            depths_mm: projection.depths_mm,
        } = depth_map(&histories);
    }
    let mut records = Vec::new();
    for event in &events {
        records.extend(points::record(event, &projection)?);
    }
    Ok(records)
}

fn boxed<S: Sink + 'static>(sink: S) -> Box<dyn Sink> {
    Box::new(sink)
}

#[cfg(test)]
mod tests;
