//! Integers that count photons, and what is asked of many of them.
//!
//! ```
//! use dtof_core::PhotonCount;
//!
//! let counts = [3u16, 9, 1, 0];
//! assert_eq!(u16::highest(&counts), 9);
//! assert!(u16::any_reaches(&counts, 9) && !u16::any_reaches(&counts, 10));
//! ```

/// An integer that counts the photons of one bin.
pub trait PhotonCount: Copy + Into<u32> {
    /// The highest of some counts, 0 of none.
    #[inline(always)]
    fn highest(counts: &[Self]) -> u32 {
        // Not `max()`, which carries a reference along with each count.
        fold(counts, 0, |highest: u32, count| highest.max(count.into()))
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
}

/// Eight a turn, so that the loop itself costs little.
#[inline(always)]
fn fold<C: Copy, A>(counts: &[C], start: A, next: impl Fn(A, C) -> A) -> A {
    let (eights, rest) = counts.as_chunks::<8>();
    let folded = eights
        .iter()
        .fold(start, |so_far, &[a, b, c, d, e, f, g, h]| {
            let so_far = next(next(next(next(so_far, a), b), c), d);
            next(next(next(next(so_far, e), f), g), h)
        });
    rest.iter()
        .fold(folded, |so_far, &count| next(so_far, count))
}
