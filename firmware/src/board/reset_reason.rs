//! Why a board has started: from a word that the previous image has left in RAM, or else from the chip.

#[cfg(all(target_os = "none", feature = "handlers"))]
pub use self::word::{remember, take};

use dtof_link::StopReason;

/// Words that are unlikely in uninitialised RAM, for the reasons that an image leaves there.
const WORDS: [(ResetReason, u32); 3] = [
    (ResetReason::Panic, 0xd70f_9a21),
    (ResetReason::Fault, 0xd70f_fa17),
    (ResetReason::BrownOut, 0xd70f_b0f7),
];

/// The reason that a word in RAM stands for.
#[must_use]
pub fn of_word(word: u32) -> Option<ResetReason> {
    let entry = WORDS.iter().find(|&&(_, of)| of == word);
    entry.map(|&(reason, _)| reason)
}

/// Why a board has started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ResetReason {
    /// It was switched on. RP2040 reports a brown-out the same way, and so does STM32F405 unless its
    /// option bytes (`BOR_LEV`) switch the brown-out reset on.
    PowerOn,
    /// The image panicked.
    Panic,
    /// The image had a hard fault; a stack overflow is one.
    Fault,
    /// The watchdog was not fed.
    Watchdog,
    /// The supply was too low for a while, by the chip's reset or by the image's own detector.
    BrownOut,
    /// The reset pin, a debugger, or the image itself.
    Reset,
}

impl From<ResetReason> for Option<StopReason> {
    /// The reason for the host: nothing stopped if the board was switched on.
    // Part of a large function it would become a jump that hides where it goes.
    #[inline(never)]
    fn from(reason: ResetReason) -> Self {
        match reason {
            ResetReason::PowerOn => None,
            ResetReason::Panic => Some(StopReason::Panic),
            ResetReason::Fault => Some(StopReason::Fault),
            ResetReason::Watchdog => Some(StopReason::Watchdog),
            ResetReason::BrownOut => Some(StopReason::BrownOut),
            ResetReason::Reset => Some(StopReason::Reset),
        }
    }
}

impl ResetReason {
    /// The word in RAM that stands for it; 0 if an image leaves none.
    #[must_use]
    pub fn word(self) -> u32 {
        let entry = WORDS.iter().find(|&&(of, _)| of == self);
        entry.map_or(0, |&(_, word)| word)
    }

    /// From the registers of an RP2040: `REASON` of its watchdog and `CHIP_RESET` of `VREG_AND_CHIP_RESET`
    /// (RP2040 datasheet, 4.7.6 and 2.12.8). `watched` is whether the image had started the
    /// watchdog: the boot ROM ends the copying of an image by the same watchdog.
    #[must_use]
    pub const fn of_rp2040(reason: u32, chip_reset: u32, watched: bool) -> Self {
        /// Power-on or brown-out.
        const HAD_POR: u32 = 1 << 8;
        let of_chip = if chip_reset & HAD_POR != 0 {
            Self::PowerOn
        } else {
            Self::Reset
        };
        of_chip.or_watchdog(reason, watched)
    }

    /// The same of an RP2350: `REASON` of its watchdog and `CHIP_RESET` of `POWMAN` (RP2350 datasheet,
    /// 12.9.7 and 6.4).
    #[must_use]
    pub const fn of_rp2350(reason: u32, chip_reset: u32, watched: bool) -> Self {
        const HAD_POR: u32 = 1 << 16;
        const HAD_BOR: u32 = 1 << 17;
        let of_chip = if chip_reset & HAD_POR != 0 {
            Self::PowerOn
        } else if chip_reset & HAD_BOR != 0 {
            Self::BrownOut
        } else {
            Self::Reset
        };
        of_chip.or_watchdog(reason, watched)
    }

    /// This reason of a reset of the whole chip, unless the watchdog or the processor was reset after it.
    const fn or_watchdog(self, reason: u32, watched: bool) -> Self {
        const TIMER: u32 = 1 << 0;
        const FORCE: u32 = 1 << 1;
        // Resets of the whole chip clear `REASON` and what the image has left of the watchdog; `CHIP_RESET`
        // outlives the others.
        if reason & TIMER != 0 && watched {
            Self::Watchdog
        } else if reason & (TIMER | FORCE) == 0 && !watched {
            self
        } else {
            Self::Reset
        }
    }

    /// From `RCC_CSR` of an STM32F405 (RM0090, 7.3.21). More than one flag is set: a
    /// power-on is a brown-out as well, and every reset shows at the reset pin.
    #[must_use]
    pub const fn of_stm32f4(csr: u32) -> Self {
        const BORRSTF: u32 = 1 << 25;
        const PORRSTF: u32 = 1 << 27;
        const IWDGRSTF: u32 = 1 << 29;
        const WWDGRSTF: u32 = 1 << 30;
        if csr & PORRSTF != 0 {
            Self::PowerOn
        } else if csr & BORRSTF != 0 {
            Self::BrownOut
        } else if csr & (IWDGRSTF | WWDGRSTF) != 0 {
            Self::Watchdog
        } else {
            Self::Reset
        }
    }
}

#[cfg(all(target_os = "none", feature = "handlers"))]
mod word {
    use core::ptr;
    use core::sync::atomic::{AtomicU32, Ordering};

    use super::{ResetReason, of_word};

    /// A reset leaves it as it is.
    #[unsafe(link_section = ".uninit.RESET_REASON")]
    #[allow(unsafe_code, reason = "its place is given by the section's name")]
    static WORD: AtomicU32 = AtomicU32::new(0);

    /// Leaves word of a panic, a fault or a low supply for the start after the reset that follows.
    pub fn remember(reason: ResetReason) {
        // The first: a report of a fault may panic.
        if of_word(WORD.load(Ordering::Relaxed)).is_none() {
            WORD.store(reason.word(), Ordering::Relaxed);
        }
    }

    /// What the image before this reset has left, once.
    #[must_use]
    pub fn take() -> Option<ResetReason> {
        // SAFETY: it is valid, aligned, and shared with nothing that interrupts this.
        #[allow(unsafe_code, reason = "the compiler takes its value to be 0")]
        let word = unsafe { ptr::read_volatile(WORD.as_ptr()) };
        WORD.store(0, Ordering::Relaxed);
        of_word(word)
    }
}

#[cfg(test)]
mod tests {
    use super::ResetReason::{self, *};
    use super::of_word;

    #[test]
    fn a_word_in_memory_stands_for_one_reason() {
        for reason in [Panic, Fault, BrownOut] {
            assert_eq!(of_word(reason.word()), Some(reason));
        }
        for reason in [PowerOn, Watchdog, Reset] {
            assert_eq!(of_word(reason.word()), None);
        }
        for word in [0, u32::MAX, Panic.word() ^ 1] {
            assert_eq!(of_word(word), None);
        }
    }

    #[test]
    fn rp2040() {
        const POR: u32 = 1 << 8;
        const RUN: u32 = 1 << 16;
        const PSM: u32 = 1 << 20;
        for (reason, chip_reset, watched, expected) in [
            (0, POR, false, PowerOn),
            // Of the processor alone.
            (0, POR, true, Reset),
            (0, RUN, false, Reset),
            (0, PSM, true, Reset),
            (0, 0, false, Reset),
            // The chip's last reset of its own stays to be seen.
            (1, POR, true, Watchdog),
            (1, RUN, true, Watchdog),
            (1, POR, false, Reset),
            (2, POR, true, Reset),
            (2, RUN, false, Reset),
            (3, POR, true, Watchdog),
            (3, POR, false, Reset),
        ] {
            let found = ResetReason::of_rp2040(reason, chip_reset, watched);
            assert_eq!(found, expected, "{reason:#x} {chip_reset:#x} {watched}");
        }
    }

    #[test]
    fn rp2350() {
        const POR: u32 = 1 << 16;
        const BOR: u32 = 1 << 17;
        const RUN: u32 = 1 << 18;
        const RSM: u32 = 1 << 28;
        for (reason, chip_reset, watched, expected) in [
            (0, POR, false, PowerOn),
            (0, POR | BOR, false, PowerOn),
            (0, BOR, false, BrownOut),
            // Of the processor alone.
            (0, POR, true, Reset),
            (0, BOR, true, Reset),
            (0, RUN, false, Reset),
            (0, 0, false, Reset),
            (1, RSM, true, Watchdog),
            (1, POR, true, Watchdog),
            // The boot ROM's own.
            (1, RSM, false, Reset),
            (2, RSM, true, Reset),
            (2, POR, false, Reset),
        ] {
            let found = ResetReason::of_rp2350(reason, chip_reset, watched);
            assert_eq!(found, expected, "{reason:#x} {chip_reset:#x} {watched}");
        }
    }

    #[test]
    fn stm32f4() {
        const BOR: u32 = 1 << 25;
        const PIN: u32 = 1 << 26;
        const POR: u32 = 1 << 27;
        const SFT: u32 = 1 << 28;
        const IWDG: u32 = 1 << 29;
        const WWDG: u32 = 1 << 30;
        const LPWR: u32 = 1 << 31;
        /// Not flags of resets: the internal oscillator runs.
        const LSI: u32 = 0b11;
        for (csr, expected) in [
            (POR | BOR | PIN, PowerOn),
            (POR | BOR | PIN | LSI, PowerOn),
            (POR | BOR | PIN | IWDG | SFT, PowerOn),
            (BOR | PIN, BrownOut),
            (BOR | PIN | IWDG, BrownOut),
            (PIN | IWDG, Watchdog),
            (PIN | IWDG | LSI, Watchdog),
            (PIN | WWDG, Watchdog),
            (PIN | SFT | IWDG, Watchdog),
            (PIN | SFT, Reset),
            (PIN | LPWR, Reset),
            (PIN, Reset),
            (LSI, Reset),
            (0, Reset),
        ] {
            assert_eq!(ResetReason::of_stm32f4(csr), expected, "{csr:#x}");
        }
    }
}
