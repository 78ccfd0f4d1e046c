//! Counts what an operation takes, exactly.
//!
//! No emulator has the processor's own counter. QEMU, told by `-icount shift=8`
//! that an instruction takes 256 ns, has a `SysTick` whose clock of 25 MHz then
//! advances by 6.4 an instruction: more than one, so that the difference of two
//! readings is the number of instructions, without a remainder to be guessed.
//! `SysTick` comes round after 2.6 million. The emulator of the Pico, told by `--count`,
//! advances it by 1 an instruction.
//!
//! The STM32F405 and the Pico 2 have the counter: there it is clock cycles, as on a real Pico.

use crate::State;

/// An operation to measure. It takes a state and a number and returns something, so
/// that nothing is optimised away.
pub type Operation<S = State> = extern "C" fn(&mut S, u32) -> u32;

/// A running counter, and what measuring itself takes.
pub struct Counter {
    overhead: u32,
}

impl Counter {
    /// Starts it. `None` if it does not count what it should.
    pub fn start(state: &mut State) -> Option<Self> {
        hardware::start()?;
        let mut counter = Self { overhead: 0 };
        // The return belongs to the operation, the call does not.
        counter.overhead = counter.measure(only_return, state, 0).checked_sub(1)?;
        counter.is_right_for(state).then_some(counter)
    }

    /// Whether an operation on such a state measures as what it takes.
    pub fn is_right_for<S>(&self, state: &mut S) -> bool {
        hardware::is_right(self.measure(hundred, state, 0))
    }

    /// Instructions (on a board clock cycles) from the first of `operation` up to
    /// its return and including it.
    #[inline(never)]
    pub fn measure<S>(&self, operation: Operation<S>, state: &mut S, number: u32) -> u32 {
        let before = hardware::now();
        core::hint::black_box(operation(state, number));
        let after = hardware::now();
        hardware::between(before, after).wrapping_sub(self.overhead)
    }
}

#[allow(unsafe_code, reason = "there is no other function of one instruction")]
#[allow(improper_ctypes_definitions, reason = "only Rust calls it")]
#[unsafe(naked)]
extern "C" fn only_return(_: &mut State, _: u32) -> u32 {
    core::arch::naked_asm!("bx lr")
}

#[allow(unsafe_code, reason = "a known number of instructions")]
#[allow(improper_ctypes_definitions, reason = "only Rust calls it")]
#[unsafe(naked)]
extern "C" fn hundred<S>(_: &mut S, _: u32) -> u32 {
    core::arch::naked_asm!(".rept 99", "nop", ".endr", "bx lr")
}

#[cfg(any(feature = "mps2-an386", feature = "pico"))]
mod hardware {
    use cortex_m::peripheral::SYST;
    use cortex_m::peripheral::syst::SystClkSource;

    const RELOAD: u32 = 0x00ff_ffff;

    pub fn start() -> Option<()> {
        let mut timer = cortex_m::Peripherals::take()?.SYST;
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(RELOAD);
        timer.clear_current();
        timer.enable_counter();
        Some(())
    }

    pub fn now() -> u32 {
        SYST::get_current()
    }

    /// It counts down. In QEMU a tick is 40 ns and an instruction 256.
    pub fn between(before: u32, after: u32) -> u32 {
        let ticks = before.wrapping_sub(after) & RELOAD;
        if cfg!(feature = "pico") {
            ticks
        } else {
            (ticks * 5 + 16) / 32
        }
    }

    /// On a real Pico an instruction takes a clock or more; `cargo xtask bench` compares.
    pub fn is_right(hundred: u32) -> bool {
        hundred == 100 || cfg!(feature = "pico") && hundred > 100
    }
}

#[cfg(any(feature = "pico2", feature = "stm32f405"))]
mod hardware {
    use cortex_m::peripheral::DWT;

    pub fn start() -> Option<()> {
        let mut core = cortex_m::Peripherals::take()?;
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
        Some(())
    }

    pub fn now() -> u32 {
        DWT::cycle_count()
    }

    pub fn between(before: u32, after: u32) -> u32 {
        after.wrapping_sub(before)
    }

    /// How long a `nop` takes is up to the processor; an emulator counts nothing.
    pub fn is_right(hundred: u32) -> bool {
        hundred > 0
    }
}
