//! The proof that `dtof-core`, `dtof-link` and `dtof-sensors` run on a microcontroller as they say: an image
//! that uses all of them and links only if nothing in them can panic.
//!
//! The panic handler calls a function that exists nowhere, so one reachable
//! panic anywhere makes the linker refuse the image. What links is then searched
//! for floating point and allocation: `cargo xtask check-image` does both, with
//! `--all` for every target and profile.
//!
//! Every value comes from [`values::word`], about which the optimiser knows nothing, and
//! ends in [`values::keep`], so that nothing is worked out while compiling and nothing
//! is dropped. So do the bytes of a line, and what pins and buses of sensors answer. Each part in
//! the modules is a function of its own, whose name `check-image` looks for in the image.
//!
//! The image is there to be linked and looked at, not to be run.

#![no_std]
#![no_main]

#[cfg(not(target_os = "none"))]
compile_error!("library-image is for targets without an operating system: cargo xtask check-image");

mod arrays;
mod awaited;
mod devices;
mod events;
mod histograms;
mod link;
mod pixels;
mod sensors;
mod values;

use core::panic::PanicInfo;
use core::ptr;

#[allow(unsafe_code, reason = "the linker knows the entry by this name")]
#[unsafe(no_mangle)]
extern "C" fn _start() -> ! {
    loop {
        events::all();
        histograms::all();
        pixels::all();
        arrays::all();
        link::all();
        sensors::all();
        awaited::all();
    }
}

#[allow(unsafe_code, reason = "what is declared here is never linked")]
// SAFETY: it exists nowhere, so that nothing calls it.
unsafe extern "C" {
    safe fn dtof_has_a_reachable_panic(info: *const ()) -> !;
}

/// Hands on what it is given, so that the place of a panic is still in the
/// image when `check-image` looks for it.
///
/// Each `async fn` has a panic of the compiler, for a caller that polls it again once it is done. No `await` does.
/// If it is the only panic of the image, the optimiser sees here that no other one comes.
#[panic_handler]
#[allow(
    unused_attributes,
    reason = "the optimiser of the whole image does see it"
)]
#[inline(always)]
fn panic(info: &PanicInfo) -> ! {
    if info.message().as_str() == Some("`async fn` resumed after completion") {
        loop {}
    }
    dtof_has_a_reachable_panic(ptr::from_ref(info).cast())
}
