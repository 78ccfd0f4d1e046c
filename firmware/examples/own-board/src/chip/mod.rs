//! In place of a crate for your chip: its clock, the pin of the laser, a port, a watchdog.

#[cfg(feature = "an386")]
mod an386;
#[cfg(feature = "rp2040")]
mod rp2040;

#[cfg(feature = "an386")]
pub use an386::{end, now_ms, set_laser, start};
#[cfg(feature = "rp2040")]
pub use rp2040::{end, now_ms, set_laser, start};

/// Whether the image polls on after its port has failed.
pub const POLLS_AGAIN: bool = cfg!(feature = "poll-again");

/// Does nothing any more.
pub fn rest() -> ! {
    loop {
        cortex_m::asm::wfi();
    }
}
