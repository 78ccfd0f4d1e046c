//! The last words of an image, over defmt.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

#[cfg(not(armv6m))]
use cortex_m::peripheral::SCB;
use cortex_m_rt::ExceptionFrame;

/// Reports a panic.
pub fn panic(info: &PanicInfo<'_>) {
    once(|| defmt::error!("{}", defmt::Display2Format(info)));
}

/// Reports a hard fault: where it happened, if `frame` is left, and what the processor says of
/// it.
pub fn hard_fault(is_overflow: bool, frame: Option<&ExceptionFrame>) {
    once(|| {
        if is_overflow {
            defmt::error!("stack overflow");
        }
        if let Some(frame) = frame {
            defmt::error!(
                "hard fault at {=u32:#010x}: LR {=u32:#010x}",
                frame.pc(),
                frame.lr(),
            );
        }
        registers();
    });
}

/// A Cortex-M0+ has none of a fault.
#[cfg(armv6m)]
const fn registers() {}

#[cfg(not(armv6m))]
fn registers() {
    // SAFETY: the registers are only read, and reading them changes nothing.
    #[allow(unsafe_code, reason = "there is no handle of the peripheral here")]
    let scb = unsafe { &*SCB::PTR };
    defmt::error!(
        "CFSR {=u32:#010x}, HFSR {=u32:#010x}, MMFAR {=u32:#010x}, BFAR {=u32:#010x}",
        scb.cfsr.read(),
        scb.hfsr.read(),
        scb.mmfar.read(),
        scb.bfar.read(),
    );
}

/// Does not report what goes wrong while reporting, or without end.
fn once(report: impl FnOnce()) {
    static REPORTED: AtomicBool = AtomicBool::new(false);
    // No interrupt handler runs in between: not every processor has an atomic swap.
    if !REPORTED.load(Ordering::Relaxed) {
        REPORTED.store(true, Ordering::Relaxed);
        report();
        defmt::flush();
    }
}
