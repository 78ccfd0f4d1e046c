//! The end of an image by a panic or a hard fault: first the laser goes off.
//!
//! A board says with `LaserOff` how. An image of any crate has these handlers with the feature `handlers`:
//!
//! ```text
//! struct Board;
//! impl LaserOff for Board {
//!     fn laser_off() { /* the pin of the laser goes low */ }
//! }
//! dtof_firmware::hard_fault!(Board);
//! #[panic_handler]
//! fn panic(info: &PanicInfo<'_>) -> ! { on_panic::<Board>(info) }
//! ```
//!
//! The stack is lowest in RAM (see the linker scripts), so that its overflow is a fault and
//! reaches no static. The handler cannot use a full stack: it resets the stack pointer first.

use core::ops::Range;

#[cfg(all(target_os = "none", feature = "handlers"))]
pub use self::handlers::{LaserOff, after_hard_fault, on_panic};

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

#[cfg(all(target_os = "none", feature = "handlers"))]
mod handlers {
    use core::panic::PanicInfo;
    use core::ptr;

    use cortex_m::peripheral::SCB;
    use cortex_m_rt::ExceptionFrame;

    use super::Fault;
    #[cfg(feature = "defmt")]
    use crate::board::report;
    use crate::board::reset_reason::{self, ResetReason};

    /// What a board does when its image has lost control. The handlers are made for it: [`on_panic`] and
    /// [`hard_fault!`](crate::hard_fault).
    pub trait LaserOff {
        /// Holds the laser off, in a register write or two. What runs without the processor stops here, such as DMA, and
        /// a second core. It may be called at any time, also before the board has started, with interrupts off. It must
        /// not panic or wait.
        fn laser_off();

        /// Ends the image with a reset. This one is by AIRCR, which leaves some peripherals of some chips as they are,
        /// those of an RP2040 for instance: reset all of such a chip.
        fn end() -> ! {
            SCB::sys_reset()
        }
    }

    /// What the handler of hard faults does: switches the laser off, reports the fault, and ends the image.
    ///
    /// # Safety
    /// For `hard_fault!` alone: `pointer` is the stack pointer before it.
    #[doc(hidden)]
    #[allow(unsafe_code, reason = "the pointer is read")]
    pub unsafe extern "C" fn after_hard_fault<B: LaserOff>(pointer: usize) -> ! {
        B::laser_off();
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
        #[cfg(feature = "defmt")]
        report::hard_fault(fault.is_overflow, frame.as_ref());
        #[cfg(not(feature = "defmt"))]
        let _ = (fault.is_overflow, frame);
        B::end()
    }

    /// A Cortex-M0+ does not report it.
    #[cfg(armv6m)]
    const fn failed_address() -> Option<usize> {
        None
    }

    /// BFAR, if CFSR says that it is valid (DDI 0403, B3.2.15 and B3.2.18).
    #[cfg(not(armv6m))]
    fn failed_address() -> Option<usize> {
        const BFARVALID: u32 = 1 << 15;
        // SAFETY: the registers are only read, and reading them changes nothing.
        #[allow(unsafe_code, reason = "a handler is given no peripherals")]
        let scb = unsafe { &*SCB::PTR };
        (scb.cfsr.read() & BFARVALID != 0).then(|| scb.bfar.read() as usize)
    }

    /// For the panic handler of an image: switches the laser off, reports the panic, and ends the image.
    pub fn on_panic<B: LaserOff>(info: &PanicInfo<'_>) -> ! {
        // No handler of an interrupt switches it on again.
        cortex_m::interrupt::disable();
        B::laser_off();
        reset_reason::remember(ResetReason::Panic);
        #[cfg(feature = "defmt")]
        report::panic(info);
        #[cfg(not(feature = "defmt"))]
        let _ = info;
        B::end()
    }

    /// The first instructions of the handler, without a push, as the stack may be full. Registers of the floating-point
    /// unit that the processor has not saved yet are dropped: LSPACT of FPCCR (DDI 0403, B3.2.21). Without the unit the
    /// register reads as 0.
    #[cfg(not(armv6m))]
    #[doc(hidden)]
    #[macro_export]
    macro_rules! __reset_stack {
        () => {
            "mov r0, sp
             ldr r1, =_stack_start
             mov sp, r1
             ldr r1, =0xe000ef34
             ldr r2, [r1]
             bic r2, r2, #1
             str r2, [r1]
             dsb
             isb"
        };
    }
    /// The same of a Cortex-M0+, which has no such unit.
    #[cfg(armv6m)]
    #[doc(hidden)]
    #[macro_export]
    macro_rules! __reset_stack {
        () => {
            "mov r0, sp
             ldr r1, =_stack_start
             mov sp, r1"
        };
    }

    /// Defines the handler of hard faults of an image, for a board that is [`LaserOff`](crate::board::fault::LaserOff):
    /// it resets the stack pointer, switches the laser off, reports the fault, and ends the image.
    ///
    /// The linker script has `_stack_start` and `_stack_end`; that of cortex-m-rt does. The stack is the main one: under
    /// an operating system with stacks of its own the report may call a fault an overflow. A crate that forbids
    /// `unsafe_code` cannot use it, as a handler is named by `no_mangle`.
    #[macro_export]
    macro_rules! hard_fault {
        ($board:ty) => {
            // The vector table of cortex-m-rt has it by this name.
            #[unsafe(naked)]
            #[unsafe(no_mangle)]
            #[unsafe(link_section = ".HardFault.board")]
            #[allow(non_snake_case, unsafe_code, reason = "a handler of an exception")]
            unsafe extern "C" fn HardFault() -> ! {
                ::core::arch::naked_asm!(
                    $crate::__reset_stack!(),
                    "bl {after}",
                    ".pool",
                    after = sym $crate::board::fault::after_hard_fault::<$board>,
                )
            }
        };
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
