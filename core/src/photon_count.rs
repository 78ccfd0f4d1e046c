//! Integers that count photons, and what is asked of many of them.
//!
//! ```
//! use dtof_core::PhotonCount;
//!
//! let counts = [3u16, 9, 1, 0];
//! assert_eq!(u16::highest(&counts), 9);
//! assert_eq!(u16::union(&counts), 0b1011);
//! assert!(u16::any_reaches(&counts, 9) && !u16::any_reaches(&counts, 10));
//! assert_eq!(u16::first_reaching(&counts, 3), Some(0));
//! ```

/// An integer that counts the photons of one bin.
pub trait PhotonCount: Copy + Into<u32> {
    /// The highest of some counts, 0 of none.
    #[inline(always)]
    fn highest(counts: &[Self]) -> u32 {
        // Not `max()`, which carries a reference along with each count.
        fold(counts, 0, |highest: u32, count| highest.max(count.into()))
    }

    /// The bits set in any of some counts: at least the highest of them, less than
    /// twice it. The highest bit set is the same.
    #[inline(always)]
    fn union(counts: &[Self]) -> u32 {
        fold(counts, 0, |union: u32, count| union | count.into())
    }

    /// Whether one of some counts is `level` or more.
    #[inline(always)]
    fn any_reaches(counts: &[Self], level: u32) -> bool {
        // Four a turn, so that the loop itself costs little.
        let reaches = |&count: &Self| count.into() >= level;
        let (fours, rest) = counts.as_chunks::<4>();
        let one_of =
            |[a, b, c, d]: &[Self; 4]| reaches(a) || reaches(b) || reaches(c) || reaches(d);
        fours.iter().any(one_of) || rest.iter().any(reaches)
    }

    /// Which is the first of some counts that is `level` or more.
    #[inline(always)]
    fn first_reaching(counts: &[Self], level: u32) -> Option<usize> {
        let reaches = |&count: &Self| count.into() >= level;
        let (fours, rest) = counts.as_chunks::<4>();
        for (index, [a, b, c, d]) in fours.iter().enumerate() {
            let place = if reaches(a) {
                0
            } else if reaches(b) {
                1
            } else if reaches(c) {
                2
            } else if reaches(d) {
                3
            } else {
                continue;
            };
            return Some(4 * index + place);
        }
        let place = rest.iter().position(reaches)?;
        Some(counts.len() - rest.len() + place)
    }
}

impl PhotonCount for u8 {}
impl PhotonCount for u32 {}
impl PhotonCount for u16 {
    #[inline(always)]
    fn highest(counts: &[Self]) -> u32 {
        // How much room is left above the highest: two instructions a count with
        // Arm's DSP extension, one less than a comparison.
        let room = fold(counts, Self::MAX, |room: Self, count| {
            room.saturating_add(count) - count
        });
        (!room).into()
    }

    #[inline(always)]
    fn union(counts: &[Self]) -> u32 {
        // Two a word.
        let word = |low: Self, high: Self| u32::from(low) | u32::from(high) << 16;
        let eight = |union, &[a, b, c, d, e, f, g, h]: &[Self; 8]| {
            union | word(a, b) | word(c, d) | word(e, f) | word(g, h)
        };
        let union = fold_eights(counts, 0, eight, |union, count| union | u32::from(count));
        (union | union >> 16) & u32::from(Self::MAX)
    }
}

#[inline(always)]
fn fold<C: Copy, A>(counts: &[C], start: A, next: impl Fn(A, C) -> A) -> A {
    let eight = |so_far, &[a, b, c, d, e, f, g, h]: &[C; 8]| {
        let so_far = next(next(next(next(so_far, a), b), c), d);
        next(next(next(next(so_far, e), f), g), h)
    };
    fold_eights(counts, start, eight, &next)
}

/// Sixteen a turn, so that the loop itself costs little.
#[inline(always)]
fn fold_eights<C: Copy, A>(
    counts: &[C],
    start: A,
    eight: impl Fn(A, &[C; 8]) -> A,
    next: impl Fn(A, C) -> A,
) -> A {
    let (eights, rest) = counts.as_chunks::<8>();
    let (pairs, last) = eights.as_chunks::<2>();
    let folded = pairs.iter().fold(start, |so_far, [one, other]| {
        eight(eight(so_far, one), other)
    });
    let folded = last.iter().fold(folded, eight);
    rest.iter()
        .fold(folded, |so_far, &count| next(so_far, count))
}
