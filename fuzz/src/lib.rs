//! What has to hold for any input, one function a target. A fuzzer calls them with inputs of its
//! own, `tests/corpus.rs` with those that are kept.

#![allow(
    clippy::cast_possible_truncation,
    reason = "numbers of pixels, and bytes of a pattern"
)]

mod aer;
#[cfg(feature = "host")]
mod aer_file;
mod link;
mod memory;
#[cfg(feature = "host")]
mod recordings;
mod sensors;
#[cfg(feature = "host")]
mod settings;
mod sidecar;

pub use aer::aer;
#[cfg(feature = "host")]
pub use aer_file::aer_file;
pub use link::link;
#[cfg(feature = "host")]
pub use recordings::recordings;
pub use sensors::sensors;
#[cfg(feature = "host")]
pub use settings::settings;
pub use sidecar::sidecar;

/// In memory where there is such a file system.
#[cfg(feature = "host")]
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir());
    folder.expect("a folder")
}

#[cfg(feature = "host")]
fn is_one_line(error: &anyhow::Error) {
    let line = format!("{error:#}");
    assert!(!line.is_empty() && !line.contains('\n'), "{line:?}");
}

/// Numbers out of an input; 0 behind its end.
struct Input<'a> {
    left: &'a [u8],
}

impl<'a> Input<'a> {
    const fn new(data: &'a [u8]) -> Self {
        Self { left: data }
    }

    const fn is_empty(&self) -> bool {
        self.left.is_empty()
    }

    fn byte(&mut self) -> u8 {
        match self.left.split_first() {
            Some((byte, rest)) => {
                self.left = rest;
                *byte
            }
            None => 0,
        }
    }

    /// So many bytes, or those that are left.
    fn bytes(&mut self, length: usize) -> &'a [u8] {
        let (taken, left) = self.left.split_at(length.min(self.left.len()));
        self.left = left;
        taken
    }
}
