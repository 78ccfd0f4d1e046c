//! Photons in, depth events out, on the host: simulated and recorded photons,
//! the engine that turns them into events, and the files they are written to.
//!
//! ```text
//! simulation, recorded histograms, photon list   PhotonSource
//!   → Slice          some hundred laser cycles of photons, pixel by pixel
//!   → Engine         dtof-core, on this computer
//!   → DepthEvent
//!   → Output         events.csv, events.aer, summary.json, pictures, report
//! ```

pub mod aer_file;
pub mod chart;
pub mod detection;
pub mod device;
pub mod dynamic_depth;
pub mod engine;
pub mod events_csv;
pub mod export;
pub mod failures;
pub mod figures;
pub mod frame;
pub mod geometry;
pub mod maps;
pub mod methods;
pub mod monitor;
pub mod movie;
pub mod npy;
pub mod output;
pub mod palette;
pub mod photon_csv;
pub mod picture;
pub mod progress;
pub mod recorded;
pub mod report;
pub mod run;
pub mod sample;
pub mod scene;
pub mod settings;
pub mod simulation;
pub mod source;
pub mod summary;
pub mod svg;
pub mod sweep;
pub mod theory;
pub mod tmf8820;
