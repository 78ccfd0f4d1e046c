//! The samples of one laser cycle, and the photons in them.

/// What a pin was at 128 clocks one after the other, and at the clock before. Two shift
/// registers take turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Samples {
    /// The top bit is the pin right before bin 0; nobody reads the others.
    pub before: u32,
    /// Bit `n` of word `w` is the pin at bin `64 w + 2 n`.
    pub even: [u32; 2],
    /// Bit `n` of word `w` is the pin at bin `64 w + 2 n + 1`.
    pub odd: [u32; 2],
}

impl Samples {
    /// Whether the pin was low all the time.
    #[inline]
    #[must_use]
    pub const fn is_dark(&self) -> bool {
        let ([even, next_even], [odd, next_odd]) = (self.even, self.odd);
        even | next_even | odd | next_odd == 0
    }

    /// The bins at which the pin was high and right before was not. A pulse that has begun
    /// before bin 0 is none of them.
    #[inline]
    pub fn photons(&self, mut photon: impl FnMut(u16)) {
        let ([even, next_even], [odd, next_odd]) = (self.even, self.odd);
        // A bit is an edge, of the bin that the second number and the bit's place say.
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
