//! From the first instruction to the program, and where it ends otherwise.

use core::arch::{asm, global_asm};
use core::panic::PanicInfo;

use crate::{io, println};

/// The paint that the start lays over the stack.
const PAINT: u32 = 0xcccc_cccc;

/// The run failed: the program reported it, or panicked.
const FAILED: u32 = 1;
/// The run ended in a trap: less its cause.
const TRAP: u32 = 0xfa00;

// Processors start at the first word; Ibex 0x80 above that. The trap handler's
// address is a multiple of 256, which every processor takes.
global_asm!(
    ".section .start, \"ax\"",
    ".option push",
    ".option norvc",
    ".option norelax",
    ".option arch, +zicsr",
    ".globl _entry",
    "_entry:",
    "    j 1f",
    ".balign 128",
    "    j 1f",
    ".balign 256",
    "softcore_trap:",
    "    la sp, _stack_start",
    "    call {trap}",
    "1:",
    "    la sp, _stack_start",
    "    la t0, _bss_start",
    "    la t1, _bss_end",
    "    bgeu t0, t1, 3f",
    "2:  sw zero, 0(t0)",
    "    addi t0, t0, 4",
    "    bltu t0, t1, 2b",
    "3:  la t0, _stack_end",
    "    li t1, {paint}",
    "4:  sw t1, 0(t0)",
    "    addi t0, t0, 4",
    "    bltu t0, sp, 4b",
    "    la t0, softcore_trap",
    "    csrw mtvec, t0",
    "    call {begin}",
    ".option pop",
    trap = sym trap,
    begin = sym begin,
    paint = const PAINT,
);

#[allow(unsafe_code, reason = "symbols of the linker script and of the image")]
unsafe extern "C" {
    static _stack_end: u32;
    static _stack_start: u32;
    safe fn softcore_program() -> bool;
}

extern "C" fn begin() -> ! {
    let succeeded = softcore_program();
    println!("stack {}", used_stack());
    io::exit(if succeeded { 0 } else { FAILED })
}

/// Bytes of the stack that have lost their paint.
fn used_stack() -> usize {
    let (mut word, start) = (&raw const _stack_end, &raw const _stack_start);
    #[allow(unsafe_code, reason = "the stack is no object of Rust's")]
    // SAFETY: aligned words between two symbols of the linker script, all of them RAM.
    while word < start && unsafe { word.read_volatile() } == PAINT {
        word = word.wrapping_add(1);
    }
    start as usize - word as usize
}

extern "C" fn trap() -> ! {
    let cause: u32;
    #[allow(unsafe_code, reason = "only an instruction reads the cause")]
    // SAFETY: reads a register that every processor with a trap handler has.
    unsafe {
        asm!(".option push", ".option arch, +zicsr", "csrr {}, mcause", ".option pop",
            out(reg) cause);
    }
    let what = match cause {
        0 | 4 | 6 => "misaligned address",
        1 | 5 | 7 => "no memory at that address",
        2 => "illegal instruction",
        3 => "breakpoint",
        _ => "unexpected",
    };
    println!("trap: {what}, mcause {cause:#x}");
    io::exit(TRAP | cause & 0xff)
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    println!("{info}");
    io::exit(FAILED)
}
