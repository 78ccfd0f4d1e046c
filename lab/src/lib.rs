//! The evidence: Monte-Carlo studies of the paper's claims and of each method, and the
//! figures and result pages made from them.
//!
//! ```text
//! studies    points, trials, and results
//!   → sweep  trials of a range of seeds, as a part; parts add up bit for bit
//!   → pages  figures, captions, verdicts: docs/figures and docs/results
//! ```

#![forbid(unsafe_code)]

pub mod pages;
pub mod studies;
pub mod sweep;
