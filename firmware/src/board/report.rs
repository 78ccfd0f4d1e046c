//! The last words of an image, over defmt.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

#[cfg(not(feature = "pico"))]
use cortex_m::peripheral::SCB;
use cortex_m_rt::ExceptionFrame;

/// Reports a panic.
pub fn panic(info: &PanicInfo<'_>) {
    once(|| defmt::error!("{}", defmt::Display2Format(info)));
}

/// Reports a hard fault: where it happened. A Cortex-M0+ says no more of it.
#[cfg(feature = "pico")]
pub fn hard_fault(frame: &ExceptionFrame) {
    once(|| {
        defmt::error!(
            "hard fault at {=u32:#010x}: LR {=u32:#010x}",
            frame.pc(),
            frame.lr(),
        );
    });
}

/// Reports a hard fault: where it happened, and what the processor says of it.
#[cfg(not(feature = "pico"))]
pub fn hard_fault(frame: &ExceptionFrame) {
    // SAFETY: the registers are only read, and reading them changes nothing.
    #[allow(unsafe_code, reason = "nobody can hand over the peripherals here")]
    let scb = unsafe { &*SCB::PTR };
    once(|| {
        defmt::error!(
            "hard fault at {=u32:#010x}: LR {=u32:#010x}, CFSR {=u32:#010x}, HFSR {=u32:#010x}, \
             MMFAR {=u32:#010x}, BFAR {=u32:#010x}",
            frame.pc(),
            frame.lr(),
            scb.cfsr.read(),
            scb.hfsr.read(),
            scb.mmfar.read(),
            scb.bfar.read(),
        );
    });
}

/// Does not report what goes wrong while reporting, or without end.
fn once(report: impl FnOnce()) {
    static REPORTED: AtomicBool = AtomicBool::new(false);
    // Nobody comes between: not every processor can do both in one step.
    if !REPORTED.load(Ordering::Relaxed) {
        REPORTED.store(true, Ordering::Relaxed);
        report();
        defmt::flush();
    }
}
