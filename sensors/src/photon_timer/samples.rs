//! The samples of one laser cycle, and the photons in them.

/// The levels of a pin at 128 successive clocks and at the clock before. Two shift registers
/// alternate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Samples {
    /// The top bit is the pin right before bin 0; the others are not used.
    pub before: u32,
    /// Bit `n` of word `w` is the pin at bin `64 w + 2 n`.
    pub even: [u32; 2],
    /// Bit `n` of word `w` is the pin at bin `64 w + 2 n + 1`.
    pub odd: [u32; 2],
}

impl Samples {
    /// The pin is low all the time.
    pub const DARK: Self = Self {
        before: 0,
        even: [0; 2],
        odd: [0; 2],
    };

    /// Whether the pin was low all the time.
    #[inline]
    #[must_use]
    pub const fn is_dark(&self) -> bool {
        let ([even, next_even], [odd, next_odd]) = (self.even, self.odd);
        even | next_even | odd | next_odd == 0
    }

    /// Calls `photon` with each bin of a rising edge. A pulse that began before bin 0 has none.
    #[inline]
    pub fn photons(&self, mut photon: impl FnMut(u16)) {
        let ([even, next_even], [odd, next_odd]) = (self.even, self.odd);
        // A set bit is an edge. Its bin is the second number plus twice its position.
        let edges = [
            (even & !(odd << 1 | self.before >> 31), 0),
            (odd & !even, 1),
            (next_even & !(next_odd << 1 | odd >> 31), 64),
            (next_odd & !next_even, 65),
        ];
        for (mut word, first) in edges {
            while word != 0 {
                // On a Cortex-M0+ a multiplication and a look into a table.
                let place = word.trailing_zeros();
                #[allow(clippy::cast_possible_truncation, reason = "less than 128")]
                photon((first + 2 * place) as u16);
                word &= word - 1;
            }
        }
    }
}
