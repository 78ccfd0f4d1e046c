//! The words of the photon FIFO.

/// A word of the photon FIFO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Word {
    /// A photon of a macropixel, with its TDC code.
    Photon(u8, u16),
    /// So many laser cycles end, one or more.
    CyclesEnd(u16),
    /// None waits.
    Empty,
    /// None will come: the testbench's photons are used up.
    End,
}

impl Word {
    const EMPTY: u32 = u32::MAX;
    const END: u32 = u32::MAX - 1;
    const CYCLES_END: u32 = 1 << 31;

    /// The word as it is read from the register.
    #[allow(clippy::cast_possible_truncation, reason = "fields of 16 and 8 bits")]
    #[inline(always)]
    #[must_use]
    pub const fn from_raw(raw: u32) -> Self {
        if raw & Self::CYCLES_END == 0 {
            Self::Photon((raw >> 16) as u8, raw as u16)
        } else if raw == Self::EMPTY {
            Self::Empty
        } else if raw == Self::END {
            Self::End
        } else {
            Self::CyclesEnd(raw as u16)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_the_words_of_the_fifo() {
        assert_eq!(Word::from_raw(0x0003_007f), Word::Photon(3, 127));
        assert_eq!(Word::from_raw(0x8000_0001), Word::CyclesEnd(1));
        assert_eq!(Word::from_raw(0x8000_ffff), Word::CyclesEnd(0xffff));
        assert_eq!(Word::from_raw(0xffff_fffe), Word::End);
        assert_eq!(Word::from_raw(0xffff_ffff), Word::Empty);
    }
}
