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
        let mut before = self.before >> 31;
        for (first, (&even, &odd)) in [0, 64].into_iter().zip(self.even.iter().zip(&self.odd)) {
            each(even & !(odd << 1 | before), |bit| photon(first + 2 * bit));
            each(odd & !even, |bit| photon(first + 2 * bit + 1));
            before = odd >> 31;
        }
    }
}

/// Calls `found` with the place of each bit that is set. On a Cortex-M0+ `trailing_zeros` is a
/// multiplication and a look into a table.
#[inline]
fn each(mut word: u32, mut found: impl FnMut(u16)) {
    while word != 0 {
        #[allow(clippy::cast_possible_truncation, reason = "less than 32")]
        found(word.trailing_zeros() as u16);
        word &= word - 1;
    }
}
