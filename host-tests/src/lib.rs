//! The reference for the integer code: the paper in floating point, written from the paper and not from
//! `dtof-core`.

pub mod reference;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;
