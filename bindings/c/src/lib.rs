//! The detector and the link for firmware in C.
//!
//! cbindgen generates `include/dtof.h` from this crate; `bindings/c/README.md` shows how to use it.
//! State lies in the caller's memory, nothing is allocated, and nothing panics. Each function
//! checks its pointers and its numbers, calls `dtof-core` or `dtof-link`, and returns a
//! [`dtof_status_t`].
//!
//! Not included: dynamic depth, running means, reflectivity, and custom rules.
//!
//! # Safety
//!
//! A function that takes pointers is safe to call if each points to memory of its type, of the
//! documented length, that no other thread writes during the call. No two of them overlap unless
//! both are `const`. Null, misaligned pointers and objects without the tag of their type get an
//! error.
//!
//! Memory that a function reads must be initialised, with any value: Rust may not read an object
//! that was never written, not even its tag. Memory that a function only writes need not be. If an
//! object has the tag of its type, the initialiser of that type wrote it.
//!
//! | module | contents |
//! |---|---|
//! | `version` | the version of the library, and its number of bins |
//! | `status` | every error |
//! | `memory` | checks of pointers and objects |
//! | `config` | settings, and the configuration built from them |
//! | `event`, `statistics`, `range` | plain values, counts, millimetres |
//! | `array` | an array that is driven, with blocks or neighbours |
//! | `pixel`, `histogram` | single pixels, and histograms counted by the sensor |
//! | `aer` | events as words of 16 bytes |
//! | `link`, `records`, `histogram_message` | the device's end of the link, and the bodies of its messages |

#![cfg_attr(target_os = "none", no_std)]
#![allow(unsafe_code, reason = "pointers from C")]
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
mod array;
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
pub use array::*;
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

/// Never called, but required without an operating system.
#[cfg(all(target_os = "none", not(test)))]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        core::hint::spin_loop();
    }
}
