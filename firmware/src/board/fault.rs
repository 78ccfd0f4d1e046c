//! The end of an image by a panic or a hard fault: first the laser goes off.
//!
//! The stack is lowest in RAM (see the linker scripts), so that its overflow is a fault and
//! reaches no static. The handler cannot use a full stack: it resets the stack pointer first.

use core::ops::Range;

#[cfg(all(target_os = "none", feature = "board"))]
pub use self::handlers::on_panic;

/// Bytes that the processor pushes for an exception: eight registers. Those of the
/// floating-point unit lie above (Armv7-M Architecture Reference Manual, DDI 0403, B1.5.6;
/// Armv6-M, DDI 0419, B1.5.6).
const FRAME: usize = 32;
/// Bytes that one instruction pushes at most: `vpush` of sixteen double words.
const LARGEST_PUSH: usize = 128;

/// A hard fault, and the registers that survived it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The stack has overflowed.
    pub is_overflow: bool,
    /// The registers that the processor has pushed are on the stack.
    pub has_frame: bool,
}

impl Fault {
    /// `pointer` is the stack pointer when the handler begins. `stack` is from the end of the
    /// stack, its lowest address, to its start. `address` is the one whose access failed, if the
    /// processor reports it.
    #[must_use]
    pub fn new(pointer: usize, stack: &Range<usize>, address: Option<usize>) -> Self {
        // A push that fails leaves the stack pointer where it was; a buffered one has no address.
        let pushed = stack.start - LARGEST_PUSH..stack.start;
        Self {
            is_overflow: pointer < stack.start + FRAME + LARGEST_PUSH
                || address.is_some_and(|address| pushed.contains(&address)),
            has_frame: pointer.is_multiple_of(4)
                && stack.contains(&pointer)
                && stack.end - pointer >= FRAME,
        }
    }
}

#[cfg(all(target_os = "none", feature = "board"))]
mod handlers {
    use core::arch::naked_asm;
    use core::panic::PanicInfo;
    use core::ptr;

    #[cfg(not(feature = "pico"))]
    use cortex_m::peripheral::SCB;
    use cortex_m_rt::ExceptionFrame;

    use super::Fault;
    use crate::board::reset_reason::{self, ResetReason};
    use crate::board::{chip, report};

    /// Drops registers of the floating-point unit that the processor has not saved yet, as the stack
    /// may be full: LSPACT of FPCCR (DDI 0403, B3.2.21).
    #[cfg(not(feature = "pico"))]
    macro_rules! give_up_float_registers {
        () => {
            "ldr r1, =0xe000ef34
             ldr r2, [r1]
             bic r2, r2, #1
             str r2, [r1]
             dsb
             isb"
        };
    }
    /// A Cortex-M0+ has none.
    #[cfg(feature = "pico")]
    macro_rules! give_up_float_registers {
        () => {
            ""
        };
    }

    /// The handler in the vector table. It pushes nothing before the stack pointer is reset.
    #[unsafe(naked)]
    #[unsafe(no_mangle)]
    #[unsafe(link_section = ".HardFault.board")]
    #[allow(non_snake_case, reason = "cortex-m-rt knows it by this name")]
    #[allow(unsafe_code, reason = "the stack pointer is set in assembly alone")]
    unsafe extern "C" fn HardFault() -> ! {
        naked_asm!(
            "mov r0, sp",
            "ldr r1, =_stack_start",
            "mov sp, r1",
            give_up_float_registers!(),
            "bl {on_hard_fault}",
            ".pool",
            on_hard_fault = sym on_hard_fault,
        )
    }

    /// `pointer` is the stack pointer before.
    extern "C" fn on_hard_fault(pointer: usize) -> ! {
        chip::laser_off();
        #[allow(unsafe_code, reason = "the linker script knows where the stack is")]
        // SAFETY: nothing is read of them but their address.
        unsafe extern "C" {
            static _stack_end: u32;
            static _stack_start: u32;
        }
        let stack = (&raw const _stack_end).addr()..(&raw const _stack_start).addr();
        let fault = Fault::new(pointer, &stack, failed_address());
        let frame = fault.has_frame.then(|| {
            // SAFETY: it lies on the stack, aligned, and any bits are a frame. The handler's own
            // stack may have overwritten it, which reports another address at worst.
            #[allow(unsafe_code, reason = "the processor has put it there")]
            unsafe {
                ptr::read_volatile(ptr::with_exposed_provenance::<ExceptionFrame>(pointer))
            }
        });
        reset_reason::remember(ResetReason::Fault);
        report::hard_fault(fault.is_overflow, frame.as_ref());
        chip::end()
    }

    /// A Cortex-M0+ does not report it.
    #[cfg(feature = "pico")]
    const fn failed_address() -> Option<usize> {
        None
    }

    /// BFAR, if CFSR says that it is valid (DDI 0403, B3.2.15 and B3.2.18).
    #[cfg(not(feature = "pico"))]
    fn failed_address() -> Option<usize> {
        const BFARVALID: u32 = 1 << 15;
        // SAFETY: the registers are only read, and reading them changes nothing.
        #[allow(unsafe_code, reason = "a handler is given no peripherals")]
        let scb = unsafe { &*SCB::PTR };
        (scb.cfsr.read() & BFARVALID != 0).then(|| scb.bfar.read() as usize)
    }

    /// Switches the laser off, reports a panic, and resets the board or ends its emulator.
    pub fn on_panic(info: &PanicInfo<'_>) -> ! {
        chip::laser_off();
        reset_reason::remember(ResetReason::Panic);
        report::panic(info);
        chip::end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STACK: Range<usize> = 0x2000_0000..0x2000_4c00;

    fn fault(pointer: usize, address: Option<usize>) -> (bool, bool) {
        let Fault {
            is_overflow,
            has_frame,
        } = Fault::new(pointer, &STACK, address);
        (is_overflow, has_frame)
    }

    #[test]
    fn a_frame_is_read_only_where_all_of_it_is_stack() {
        assert_eq!(fault(0x2000_00a0, None), (false, true));
        assert_eq!(fault(0x2000_4be0, None), (false, true));
        assert_eq!(fault(0x2000_4be4, None), (false, false));
        assert_eq!(fault(0x2000_4c00, None), (false, false));
        assert_eq!(fault(0xffff_fff0, None), (false, false));
        assert_eq!(fault(0x2000_1002, None), (false, false));
    }

    #[test]
    fn an_overflow_shows_in_the_stack_pointer_or_in_a_push_that_failed() {
        assert_eq!(fault(0x1fff_fffc, None), (true, false));
        assert_eq!(fault(0, None), (true, false));
        // Too near the end for a push and the registers of the fault.
        assert_eq!(fault(0x2000_0000, None), (true, true));
        assert_eq!(fault(0x2000_009c, None), (true, true));
        assert_eq!(fault(0x2000_1000, Some(0x1fff_fffc)), (true, true));
        assert_eq!(fault(0x2000_1000, Some(0x1fff_ff80)), (true, true));
        // Pointers that are wrong in other ways.
        assert_eq!(fault(0x2000_1000, Some(0x1fff_ff7f)), (false, true));
        assert_eq!(fault(0x2000_1000, Some(0x2000_0000)), (false, true));
        assert_eq!(fault(0x2000_1000, Some(0)), (false, true));
    }
}
