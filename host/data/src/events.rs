//! What becomes of depth events after the engine. The module reads and writes AER files, writes CSV, and keeps a history of
//! each pixel for maps. It selects one echo out of several and finds changes of depth. A sample for reports stays small
//! however many events there are.
//!
//! An AER file is a header, words of 16 bytes, and a checksum. The header says how to turn words into ranges. A reader of a
//! damaged file gives all events before the damage.
//!
//! ## Example
//!
//! ```rust
//! use dtof_core::fixed::types::{I24F8, U16F16};
//! use dtof_core::{Array, Histogram, LaserCycle, PixelAddress, PixelConfig};
//! use dtof_data::events::aer_file::{Event, Header, Reader, Writer};
//!
//! // Nine photons in bin 60 of pixel 3, in laser cycles 0 to 99.
//! let config = PixelConfig::<128>::paper().build()?;
//! let mut histogram = Histogram::<128>::new();
//! histogram.add_batch(&[60; 9]);
//! let detection = config.detect(&histogram).expect("nine photons against none");
//! let event = Event::Depth(detection.event(PixelAddress::new(3), LaserCycle::new(99), 100));
//!
//! let mut writer = Writer::new(Vec::new(), &Header {
//!     bins: 128,
//!     array: Array::new(2, 2).unwrap(),
//!     bin_width_ps: U16F16::lit("250"),
//!     offset_mm: I24F8::ZERO,
//!     offsets_mm: Vec::new(),
//!     laser_millihertz: 0, // not known
//!     start_us: 0,
//! })?;
//! writer.write(&event)?;
//! let bytes = writer.finish()?;
//!
//! let mut reader = Reader::new(&bytes[..])?;
//! assert_eq!(reader.next_event()?, Some(event));
//! assert_eq!(reader.next_event()?, None); // the checksum is right
//! # Ok::<(), anyhow::Error>(())
//! ```
//!
//! ## What it does not know
//!
//! - It knows no engine and no settings. It takes events from a simulation, a recording or a device alike.
//! - It knows no camera and no time: `dtof_run::export` makes points in space and seconds of them.
//! - It opens no files, but reads and writes any `Read` and `Write`.
//! - An array has at most 65,536 pixels. `docs/aer-format.md` of the project defines the format.

pub mod aer_file;
pub mod clock;
pub mod dynamic;
pub mod echoes;
pub mod events_csv;
pub mod fixtures;
pub mod histories;
pub mod last_events;
pub mod sample;
