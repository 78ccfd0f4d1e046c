//! The counters of a histogram: their widths, and searches through many of them.
//!
//! A counter saturates at `2^BITS - 1`. Nothing is scaled to fit, because Poisson
//! statistics need real counts.
//!
//! ```
//! use dtof_core::{Count10, CounterWidth};
//! use dtof_core::rule::PhotonCount;
//!
//! assert_eq!(Count10::MAX, 1023);
//! let counts = [3u16, 9, 1, 0];
//! assert_eq!(u16::highest(&counts), 9);
//! assert!(u16::any_reaches(&counts, 9) && !u16::any_reaches(&counts, 10));
//! ```
//!
//! Cost on a Cortex-M4: [`PhotonCount::highest`] takes three instructions a 16-bit
//! count. [`PhotonCount::any_reaches`] stops at the first count that is high enough.
//!
//! Source: 10 bits are those of the paper's FPGA (section IV-B).

mod sealed {
    pub trait Sealed {}
}

/// How wide the counters of a histogram are.
///
/// The decision is the same for all widths. Only the square root needs more iterations
/// for wider counts.
pub trait CounterWidth: sealed::Sealed + Copy + core::fmt::Debug + Send + Sync + 'static {
    /// The integer that holds one counter.
    type Counter: PhotonCount + Ord + core::fmt::Debug + Send + Sync;
    /// An empty counter.
    const ZERO: Self::Counter;
    /// Bits a counter uses; it saturates at `2^BITS - 1`.
    const BITS: u32;
    /// The count at which a counter is full.
    const MAX: u32 = (1 << Self::BITS) - 1;

    /// `count`, which is at most [`Self::MAX`], as a counter.
    fn counter(count: u32) -> Self::Counter;
}

/// 8-bit counters (0..=255): half the memory. A pixel decides on no counts that have lost photons:
/// [`Statistics::ended_full`](crate::Statistics::ended_full).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Count8 {}
/// 10-bit counters (0..=1023), those of the paper's FPGA and the default.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Count10 {}
/// 16-bit counters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Count16 {}
/// 20-bit counters, for 512 and 1024 bins: a count and its bin have to fit into 32 bits together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Count20 {}
/// 24-bit counters, those of commercial sensors that send whole histograms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Count24 {}

macro_rules! counter_width {
    ($name:ident, $counter:ty, $bits:literal) => {
        impl sealed::Sealed for $name {}
        impl CounterWidth for $name {
            type Counter = $counter;
            const ZERO: $counter = 0;
            const BITS: u32 = $bits;
            #[inline]
            #[allow(clippy::cast_possible_truncation)] // at most 2^BITS - 1, which fits
            fn counter(count: u32) -> $counter {
                count as $counter
            }
        }
    };
}
counter_width!(Count8, u8, 8);
counter_width!(Count10, u16, 10);
counter_width!(Count16, u16, 16);
counter_width!(Count20, u32, 20);
counter_width!(Count24, u32, 24);

/// An integer that counts the photons of one bin.
pub trait PhotonCount: Copy + Into<u32> {
    /// The highest of some counts, 0 without any.
    #[inline(always)]
    fn highest(counts: &[Self]) -> u32 {
        // Not `max()`, which carries a reference along with each count.
        fold(counts, 0, |highest: u32, count| highest.max(count.into()))
    }

    /// The highest of some counts, 0 without any, and their sum, wrapping.
    #[inline(always)]
    fn highest_and_sum(counts: &[Self]) -> (u32, u32) {
        fold(counts, (0, 0), |(highest, sum): (u32, u32), count| {
            (highest.max(count.into()), sum.wrapping_add(count.into()))
        })
    }

    /// Whether one of some counts is `level` or more.
    #[inline(always)]
    fn any_reaches(counts: &[Self], level: u32) -> bool {
        // Four an iteration, for little loop overhead.
        let reaches = |&count: &Self| count.into() >= level;
        let (fours, rest) = counts.as_chunks::<4>();
        let one_of =
            |[a, b, c, d]: &[Self; 4]| reaches(a) || reaches(b) || reaches(c) || reaches(d);
        fours.iter().any(one_of) || rest.iter().any(reaches)
    }

    /// The index of the first of some counts that is `level` or more.
    #[inline(always)]
    fn first_reaching(counts: &[Self], level: u32) -> Option<usize> {
        let reaches = |&count: &Self| count.into() >= level;
        let (fours, _) = counts.as_chunks::<4>();
        let four = fours.iter().position(|four| four.iter().any(reaches));
        let start = 4 * four.unwrap_or(fours.len());
        let place = counts.get(start..)?.iter().position(reaches)?;
        Some(start + place)
    }
}

impl PhotonCount for u8 {}
impl PhotonCount for u32 {}
impl PhotonCount for u16 {
    #[inline(always)]
    fn highest(counts: &[Self]) -> u32 {
        // Tracks the room above the highest: two instructions a count with Arm's DSP
        // extension, one less than a comparison.
        let room = fold(counts, Self::MAX, |room: Self, count| {
            room.saturating_add(count) - count
        });
        (!room).into()
    }

    #[inline(always)]
    fn highest_and_sum(counts: &[Self]) -> (u32, u32) {
        let start = (Self::MAX, 0u32);
        let (room, sum) = fold(counts, start, |(room, sum), count| {
            let room = room.saturating_add(count) - count;
            (room, sum.wrapping_add(count.into()))
        });
        ((!room).into(), sum)
    }
}

/// Sixteen an iteration, for little loop overhead.
#[inline(always)]
fn fold<C: Copy, A>(counts: &[C], start: A, next: impl Fn(A, C) -> A) -> A {
    let eight = |so_far, &[a, b, c, d, e, f, g, h]: &[C; 8]| {
        let so_far = next(next(next(next(so_far, a), b), c), d);
        next(next(next(next(so_far, e), f), g), h)
    };
    let (eights, rest) = counts.as_chunks::<8>();
    let (pairs, last) = eights.as_chunks::<2>();
    let folded = pairs.iter().fold(start, |so_far, [one, other]| {
        eight(eight(so_far, one), other)
    });
    let folded = last.iter().fold(folded, eight);
    rest.iter()
        .fold(folded, |so_far, &count| next(so_far, count))
}
