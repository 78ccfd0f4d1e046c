#![doc = include_str!("../README.md")]
//! ## From events to a file
//!
//! The AER file is read once to count the events up to its end, or to where it is damaged, and once
//! to write them. `docs/export.md` says what is in each format.

#![deny(clippy::print_stderr, clippy::print_stdout)]

mod csv;
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
use dtof_core::{Array, RangeScale};
use dtof_link::DynamicDepth;
use tempfile::NamedTempFile;

use dtof_engine::settings::{Rays as SaidRays, SettingsFile};
use dtof_events::aer_file::{Event, EventKind, Header};
use dtof_events::clock::LaserClock;
use dtof_events::echoes::Echo;
use dtof_options::files::{aside, flushed, place_of};
use dtof_options::numbers::{MOST_WHOLE, whole};
use dtof_options::progress::Progress;
use dtof_options::{NO_OPTION, Named, Refused, named};
use dtof_photons::geometry::{FieldOfView, FieldOfViewError, Rays};

use events::Survey;
use mcap::Slices;
use points::Points;
use projection::Projection;
use span::Span;

/// The format of an exported file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Comma-separated values
    Csv,
    /// Points, in the format of PCL
    Pcd,
    /// Points, as vertices of a mesh
    Ply,
    /// Points slice by slice and statistics, for Foxglove
    Mcap,
    /// Points slice by slice as a bag of ROS 2 (MCAP)
    Ros2,
    /// Changes of depth as an event camera's RAW file (EVT2)
    Evt2,
}

impl Named for Format {
    const NAMES: &'static [(&'static str, Self, &'static str)] = &[
        ("csv", Self::Csv, "Comma-separated values"),
        ("pcd", Self::Pcd, "Points, in the format of PCL"),
        ("ply", Self::Ply, "Points, as vertices of a mesh"),
        (
            "mcap",
            Self::Mcap,
            "Points slice by slice and statistics, for Foxglove",
        ),
        (
            "ros2",
            Self::Ros2,
            "Points slice by slice as a bag of ROS 2 (MCAP)",
        ),
        (
            "evt2",
            Self::Evt2,
            "Changes of depth as an event camera's RAW file (EVT2)",
        ),
    ];
}

/// Where the rays of the pixels come from.
#[derive(Clone, Debug)]
pub enum Optics {
    /// A pinhole camera; [`FieldOfView::of`] the array unless given.
    Pinhole(Option<FieldOfView>),
    /// A calibration file.
    Calibration(PathBuf),
}

impl Optics {
    /// As a settings file says.
    ///
    /// # Errors
    /// If its field of view is none.
    pub fn of(said: &SaidRays) -> Result<Self> {
        Ok(match (&said.calibration, said.field_of_view_degrees) {
            (Some(file), _) => Self::Calibration(file.into()),
            (None, Some(degrees)) => Self::Pinhole(Some(FieldOfView::new(degrees)?)),
            (None, None) => Self::Pinhole(None),
        })
    }

    /// The rays, and what they are for people.
    ///
    /// # Errors
    /// If a calibration cannot be read, or is of another array.
    pub fn rays(&self, array: Array) -> Result<(Rays, String)> {
        Ok(match self {
            Self::Pinhole(view) => {
                let view = view.unwrap_or_else(|| FieldOfView::of([array.columns(), array.rows()]));
                (Rays::pinhole(array, view), format!("{view} degrees, "))
            }
            Self::Calibration(path) => (Rays::read(path, array)?, format!("{}, ", path.display())),
        })
    }
}

/// How events become points in space and time, or changes of depth.
#[derive(Clone, Debug)]
pub struct Options {
    /// Where pixels look.
    pub optics: Optics,
    /// How long a laser cycle is; what the file says unless given, and if it does not the
    /// paper's 10 MHz.
    pub clock: Option<LaserClock>,
    /// Which events of a file that holds both kinds.
    pub kind: Option<EventKind>,
    /// Which echo of each exposure, of depth events.
    pub echo: Echo,
    /// MCAP and ROS 2: nanoseconds of a slice, not 0; 1/100 of the run unless given, see docs/export.md.
    pub slice_ns: Option<u64>,
    /// EVT2: what is made of depth events.
    pub dynamic_depth: DynamicDepth,
}

impl Default for Options {
    /// A pinhole camera, the laser rate of the file, and the paper's dynamic depth: 0.1 m
    /// between the means of adjacent events (section III-E).
    fn default() -> Self {
        Self {
            optics: Optics::Pinhole(None),
            clock: None,
            kind: None,
            echo: Echo::All,
            slice_ns: None,
            dynamic_depth: DynamicDepth::default(),
        }
    }
}

/// How events become points, as options give it. What is not given is as in the settings file.
#[derive(Clone, Debug, Default)]
pub struct Projected {
    /// Which echo of each exposure.
    pub echo: Option<Echo>,
    /// The field of view of a pinhole camera.
    pub fov: Option<FieldOfView>,
    /// A calibration file.
    pub calibration: Option<PathBuf>,
    /// Laser cycles a second.
    pub laser_hz: Option<u64>,
}

impl dtof_options::Options for Projected {
    const KEYS: &'static [&'static [&'static str]] =
        &[&["field_of_view_degrees", "calibration", "laser_hz", "echo"]];

    fn set(&mut self, key: &'static str, text: &str) -> Result<(), String> {
        match key {
            "field_of_view_degrees" => {
                let view = text
                    .parse()
                    .map_err(|error: FieldOfViewError| error.to_string());
                self.fov = Some(view?);
            }
            "laser_hz" => self.laser_hz = Some(whole(1..=MOST_WHOLE)(text)?),
            "echo" => self.echo = Some(named(text)?),
            _ => return Err(NO_OPTION.to_owned()),
        }
        Ok(())
    }

    fn file(&mut self, key: &str) -> Option<&mut Option<PathBuf>> {
        (key == "calibration").then_some(&mut self.calibration)
    }

    fn check(&self) -> Result<(), Refused> {
        if self.fov.is_some() && self.calibration.is_some() {
            let reason = "cannot be used with `calibration`";
            return Err(Refused::new("field_of_view_degrees", reason));
        }
        Ok(())
    }
}

impl Projected {
    /// These, and of `file` what these do not say.
    ///
    /// # Errors
    /// If the file has no field of view or laser rate that can be.
    pub fn options(self, file: &SettingsFile) -> Result<Options> {
        let laser_hz = self.laser_hz.or(file.sensor.laser_hz);
        Ok(Options {
            optics: match (self.calibration, self.fov) {
                (Some(file), _) => Optics::Calibration(file),
                (None, Some(view)) => Optics::Pinhole(Some(view)),
                (None, None) => Optics::of(&file.rays)?,
            },
            clock: laser_hz.map(LaserClock::new).transpose()?,
            echo: self.echo.unwrap_or(Echo::All),
            ..Options::default()
        })
    }
}

/// The result of an export.
#[derive(Debug)]
pub struct Exported {
    /// Events or points in the file.
    pub written: u64,
    /// Events that came too late to be put in order, and are left out.
    pub late: u64,
    /// Where the AER file is damaged and how, if it is. What came before is written.
    pub damage: Option<String>,
    /// The assumptions behind points and times: "60x32.2 degrees, 10 MHz".
    pub assumed: String,
    /// What is to be said of the laser rate, if it is not the file's.
    pub warning: Option<String>,
}

/// A file on its way.
type Out = BufWriter<NamedTempFile>;

/// A file that is whole.
struct Finished {
    out: Out,
    written: u64,
    late: u64,
}

/// Takes events, writes a file.
trait Sink {
    fn write(&mut self, event: &Event) -> Result<()>;
    fn finish(self: Box<Self>) -> Result<Finished>;
}

/// Writes the events of the AER file `input` to `out`.
///
/// # Errors
/// If `input` is not an AER file, holds what the format cannot, or `out` cannot be
/// written; `out` is what it was then. Damage of `input` is no error: see
/// [`Exported::damage`].
pub fn export(
    input: &Path,
    out: &Path,
    format: Format,
    options: &Options,
    progress: &mut dyn Progress,
) -> Result<Exported> {
    let name = || input.display().to_string();
    let inputs = match &options.optics {
        Optics::Pinhole(_) => vec![input],
        Optics::Calibration(calibration) => vec![input, calibration],
    };
    let place = place_of(out, &inputs)?;
    let survey =
        Survey::of(input, format, options.clock, options.echo, progress).with_context(name)?;
    let kind = survey.kind(options.kind).with_context(name)?;
    ensure!(
        kind == EventKind::Depth || options.echo == Echo::All,
        Refused::new("echo", "is only for depth events")
    );
    let (header, clock) = (survey.header, survey.clock);
    let array = header.array;
    let (rays, mut assumed) = options.optics.rays(array)?;
    let projection = Projection {
        rays,
        scale: RangeScale::new(header.bin_width_ps, header.offset_mm).with_context(name)?,
        clock,
    };
    if format == Format::Evt2 {
        assumed.clear();
    }
    assumed += &clock.to_string();
    let span = Span::of(format, &clock, &header, survey.latest).with_context(name)?;
    let slice_ns = options
        .slice_ns
        .unwrap_or_else(|| mcap::slice_of(span.end_ns));
    let file = BufWriter::new(aside(&place.folder, ".dtof-export-")?);
    let points = survey.chosen(kind);
    let to = || out.display().to_string();
    let sink: Result<Box<dyn Sink>> = match format {
        Format::Csv => csv::begin(file, projection, kind).map(boxed),
        Format::Pcd => Points::packed(file, projection, &pcd::header(kind, points)).map(boxed),
        Format::Ply => Points::packed(file, projection, &ply::header(kind, points)).map(boxed),
        Format::Mcap | Format::Ros2 => {
            let _ = write!(assumed, ", clouds every {} µs", slice_ns as f64 / 1000.0);
            let for_ros2 = format == Format::Ros2;
            let slices = Slices { span, slice_ns };
            mcap::Mcap::new(file, projection, array, kind, slices, for_ros2).map(boxed)
        }
        Format::Evt2 => {
            let changes = &options.dynamic_depth;
            let config = changes.config(&projection.scale).map_err(|error| {
                Refused::value("threshold_mm", changes.threshold_mm, error.to_string())
            })?;
            evt2::Evt2::new(file, array, clock, config, options.echo).map(boxed)
        }
    };
    let mut sink = sink.with_context(to)?;

    progress.begin(survey.all(), "events");
    let mut events = events::open(input).with_context(name)?;
    let mut selection = events::chosen(options.echo);
    for done in 1..=survey.all() {
        let event = events.next_event().with_context(name)?;
        let event = event.with_context(|| format!("{} changed while it was read", name()))?;
        match event {
            _ if event.kind() != kind => {}
            Event::Depth(event) => selection.push(event),
            Event::DynamicDepth(_) => sink.write(&event).with_context(to)?,
        }
        for event in selection.by_ref() {
            sink.write(&Event::Depth(event)).with_context(to)?;
        }
        if done.is_multiple_of(4096) {
            progress.at(done)?;
        }
    }
    selection.finish();
    for event in selection {
        sink.write(&Event::Depth(event)).with_context(to)?;
    }
    progress.end();
    let finished = sink.finish().with_context(to)?;
    let moved = flushed(finished.out).with_context(to)?.persist(&place.file);
    moved.map_err(|error| error.error).with_context(to)?;
    Ok(Exported {
        written: finished.written,
        late: finished.late,
        damage: survey.damage,
        assumed,
        warning: survey.warning,
    })
}

/// `events` of an array with this header as points: the records of the `pcd` format, without its
/// header.
///
/// # Errors
/// If there are no such rays, or the header gives no range.
pub fn points<'a>(
    events: impl IntoIterator<Item = &'a Event>,
    header: &Header,
    options: &Options,
) -> Result<Vec<u8>> {
    let (clock, _) = LaserClock::choose(options.clock, header);
    let projection = Projection {
        rays: options.optics.rays(header.array)?.0,
        scale: RangeScale::new(header.bin_width_ps, header.offset_mm)?,
        clock,
    };
    let mut records = Vec::new();
    for event in events {
        records.extend(points::record(event, &projection)?);
    }
    Ok(records)
}

fn boxed<S: Sink + 'static>(sink: S) -> Box<dyn Sink> {
    Box::new(sink)
}
