//! Square roots of 10 bits: that of the core, and what else there is.

use core::hint::black_box;

use dtof_core::paper::isqrt;

use crate::State;
use crate::counter::{Counter, Operation};
use crate::report;

/// Every number of 10 bits.
const VALUES: u32 = 1024;

/// A Cortex-M0+ has no floating point.
const WAYS: usize = if cfg!(feature = "pico") { 3 } else { 4 };

/// Measures all.
pub fn run(counter: &Counter, state: &mut State) {
    let ways: [(&str, Operation); WAYS] = [
        ("isqrt::<5> out of line", trial_square),
        ("core u32::isqrt out of line", of_core),
        ("table of 1 KiB out of line", table),
        #[cfg(not(feature = "pico"))]
        ("VSQRT.F32 out of line", vsqrt),
    ];
    for (name, way) in ways {
        let total = (0..VALUES).map(|value| counter.measure(way, state, value));
        report::line("root", name, total.sum(), VALUES);
    }
    // The same loop without the root takes the rest.
    let with_root = counter.measure(inlined, state, VALUES);
    let without = counter.measure(no_root, state, VALUES);
    report::line("root", "isqrt::<5> inlined", with_root - without, VALUES);
}

extern "C" fn trial_square(_: &mut State, value: u32) -> u32 {
    isqrt::<5>(value)
}

extern "C" fn of_core(_: &mut State, value: u32) -> u32 {
    value.isqrt()
}

extern "C" fn table(_: &mut State, value: u32) -> u32 {
    static ROOTS: [u8; VALUES as usize] = {
        let mut roots = [0; VALUES as usize];
        let mut value = 0;
        while value < VALUES {
            roots[value as usize] = value.isqrt().to_le_bytes()[0];
            value += 1;
        }
        roots
    };
    ROOTS.get(value as usize).copied().unwrap_or(31).into()
}

#[cfg(not(feature = "pico"))]
#[allow(unsafe_code, reason = "the library has no square root without std")]
#[allow(improper_ctypes_definitions, reason = "only Rust calls it")]
#[unsafe(naked)]
extern "C" fn vsqrt(_: &mut State, _value: u32) -> u32 {
    core::arch::naked_asm!(
        "vmov s0, r1",
        "vcvt.f32.u32 s0, s0",
        "vsqrt.f32 s0, s0",
        "vcvt.u32.f32 s0, s0",
        "vmov r0, s0",
        "bx lr",
    )
}

extern "C" fn inlined(_: &mut State, values: u32) -> u32 {
    (0..values).fold(0, |sum, value| sum ^ isqrt::<5>(black_box(value)))
}

extern "C" fn no_root(_: &mut State, values: u32) -> u32 {
    (0..values).fold(0, |sum, value| sum ^ black_box(value))
}
