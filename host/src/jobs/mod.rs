//! What commands do, less files and terminal: the options of each, and what comes of them.
//!
//! A command of the program parses its options, does the job and writes what comes of it. A
//! binding to another language does the same with options of its own.

pub mod calibrate;
pub mod compare;
pub mod glass;
pub mod operation;
pub mod recording;
pub mod replay;
pub mod simulate;
pub mod tune;
