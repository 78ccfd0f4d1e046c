//! The detector and the link for firmware in C.
//!
//! `include/dtof.h` is made of this crate; `bindings/c/README.md` says how to use it. Names
//! here are those of the header. State lies in the caller's memory, nothing is allocated, and
//! nothing panics. Each function checks its pointers and its numbers, calls `dtof-core` or
//! `dtof-link`, and returns a [`dtof_status_t`].
//!
//! What is left out: blocks of pixels, dynamic depth, running means, reflectivity, and rules of
//! one's own.
//!
//! # Safety
//!
//! A function that takes pointers is safe to call if each points to memory of its type, as long
//! as said, that nobody else writes meanwhile. No two of them overlap unless both are `const`.
//! Null, misalignment and memory that was never initialised are answered by an error where they
//! can be seen.
//!
//! | module | what it has |
//! |---|---|
//! | `version` | of the library, and its number of bins |
//! | `status` | every error |
//! | `memory` | pointers of C's, checked |
//! | `config` | settings, and the configuration that is made of them |
//! | `event`, `statistics`, `range` | plain values, counts, millimetres |
//! | `pixel`, `histogram` | pixels, and histograms that arrive whole |
//! | `aer` | events as words of 16 bytes |
//! | `link`, `records`, `histogram_message` | the device's end of the link, and the bodies of its messages |

#![cfg_attr(target_os = "none", no_std)]
#![allow(unsafe_code, reason = "pointers of C's")]
#![allow(non_camel_case_types, reason = "the names of the header")]
#![allow(clippy::missing_safety_doc, reason = "the same for all: see above")]
#![allow(clippy::doc_markdown, reason = "the header is plain text")]
#![deny(
    clippy::expect_used,
    clippy::float_arithmetic,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used
)]

mod aer;
mod config;
mod event;
mod histogram;
mod histogram_message;
mod link;
mod memory;
mod pixel;
mod range;
mod records;
mod statistics;
mod status;
mod version;

pub use aer::*;
pub use config::*;
pub use event::*;
pub use histogram::*;
pub use histogram_message::*;
pub use link::*;
pub use pixel::*;
pub use range::*;
pub use records::*;
pub use statistics::*;
pub use status::*;
pub use version::*;

/// Nothing panics; a library without an operating system must have this all the same.
#[cfg(all(target_os = "none", not(test)))]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        core::hint::spin_loop();
    }
}
