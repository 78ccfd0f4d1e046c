//! From events to millimetres: the scale of all pixels, and the offset of each.
//!
//! ```
//! use dtof_core::fixed::types::{I24F8, U16F16};
//! use dtof_core::{Array, BinPosition, BlockLevel, PixelAddress};
//! use dtof_data::photons::ranges::Ranges;
//!
//! // Two pixels of 250 ps bins, of which the second sees everything 12 mm too near.
//! let offsets = vec![Some(I24F8::ZERO), Some(I24F8::lit("12"))];
//! let array = Array::new(2, 1).unwrap();
//! let ranges = Ranges::new(array, U16F16::lit("250"), I24F8::ZERO, offsets)?;
//! let position = BinPosition::new(40 << 8).unwrap();
//! let mm = |pixel| ranges.of(PixelAddress::new(pixel), BlockLevel::PIXEL, position);
//! assert_eq!(mm(1) - mm(0), I24F8::lit("12"));
//! # Ok::<(), dtof_data::photons::ranges::RangesError>(())
//! ```
//!
//! A block adds up the photons of its pixels. So its offset is the mean of theirs, without those of pixels
//! that are left out.

use std::fmt;

use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{Array, BinPosition, BlockLevel, PixelAddress, RangeScale, RangeScaleError};

/// Turns positions of events into millimetres.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ranges {
    scale: RangeScale,
    array: Array,
    /// Of each pixel; `None` if it is left out. Empty if no pixel has an offset of its own.
    offsets: Vec<Option<I24F8>>,
}

/// Ranges that cannot be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RangesError {
    /// The bin width or the offset of all pixels is out of range.
    Scale(RangeScaleError),
    /// There is not one offset for each pixel.
    Number {
        /// Offsets.
        offsets: usize,
        /// Pixels of the array.
        pixels: u32,
    },
    /// With the offset of a pixel a range could lie beyond ±8,388 m.
    Pixel(usize),
}

impl fmt::Display for RangesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scale(error) => error.fmt(f),
            Self::Number { offsets, pixels } => {
                write!(f, "has {offsets} numbers, but there are {pixels} pixels")
            }
            Self::Pixel(pixel) => write!(
                f,
                "that of pixel {pixel} and the offset of all reach beyond 8388 m"
            ),
        }
    }
}

impl std::error::Error for RangesError {}

impl Ranges {
    /// Of the pixels of `array`: `bin_width` in picoseconds, `offset` in millimetres, which is added to every
    /// range, and `offsets`, which are added to it for each pixel, in the order of the addresses. `None` is a
    /// pixel that is left out. No `offsets` are offsets of 0.
    ///
    /// # Errors
    /// Fails if a range could lie beyond ±8,388 m, or if there is not one of `offsets` for each pixel.
    pub fn new(
        array: Array,
        bin_width: U16F16,
        offset: I24F8,
        offsets: Vec<Option<I24F8>>,
    ) -> Result<Self, RangesError> {
        let scale = RangeScale::new(bin_width, offset).map_err(RangesError::Scale)?;
        let pixels = array.pixels();
        if !offsets.is_empty() && offsets.len() != pixels as usize {
            let offsets = offsets.len();
            return Err(RangesError::Number { offsets, pixels });
        }
        let fits = |own: &Option<I24F8>| {
            let sum = own.unwrap_or_default().checked_add(offset);
            sum.is_some_and(|sum| RangeScale::new(bin_width, sum).is_ok())
        };
        match offsets.iter().position(|own| !fits(own)) {
            Some(pixel) => Err(RangesError::Pixel(pixel)),
            None => Ok(Self {
                scale,
                array,
                offsets,
            }),
        }
    }

    /// The range of a position of the pixel, or of the block of this level whose first pixel it is: a multiple of
    /// 1/256 mm.
    #[must_use]
    pub fn of(&self, pixel: PixelAddress, level: BlockLevel, position: BinPosition) -> I24F8 {
        self.scale.range(position) + self.offset(pixel, level)
    }

    /// From bins to millimetres, for distances between positions: offsets cancel out.
    #[must_use]
    pub const fn scale(&self) -> &RangeScale {
        &self.scale
    }

    /// The offset of a pixel, or the mean of those of a block, rounded to the nearest 1/256 mm.
    fn offset(&self, pixel: PixelAddress, level: BlockLevel) -> I24F8 {
        if self.offsets.is_empty() {
            return I24F8::ZERO;
        }
        let own = |pixel: PixelAddress| *self.offsets.get(usize::from(pixel.raw()))?;
        if level == BlockLevel::PIXEL {
            return own(pixel).unwrap_or_default();
        }
        let offsets = self.array.pixels_of(pixel, level).filter_map(own);
        let (sum, count) = offsets.fold((0, 0), |(sum, count), offset| {
            (sum + i64::from(offset.to_bits()), count + 1)
        });
        #[allow(clippy::cast_possible_truncation, reason = "a mean of 32 bits")]
        let mean = if count == 0 {
            0
        } else {
            (2 * sum + count).div_euclid(2 * count) as i32
        };
        I24F8::from_bits(mean)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ranges(columns: u32, rows: u32, offsets: Vec<Option<I24F8>>) -> Ranges {
        let array = Array::new(columns, rows).unwrap();
        Ranges::new(array, U16F16::lit("250"), I24F8::lit("-7.5"), offsets).unwrap()
    }

    #[test]
    fn the_offset_of_a_block_is_the_mean_of_its_pixels_that_are_not_left_out() {
        // Columns 3 to 4 are the right edge: their block has two pixels.
        let offsets = [1, 2, 30, 3, 5, 70].map(|mm| Some(I24F8::from_num(mm)));
        let with = |left_out: &[usize], pixel, level| {
            let mut offsets = offsets.to_vec();
            for &pixel in left_out {
                offsets[pixel] = None;
            }
            let ranges = ranges(3, 2, offsets);
            let position = BinPosition::new(512).unwrap();
            let [pixel, level] = [PixelAddress::new(pixel), PixelAddress::new(level)];
            let level = BlockLevel::new(level.raw().try_into().unwrap()).unwrap();
            let without = RangeScale::new(U16F16::lit("250"), I24F8::lit("-7.5")).unwrap();
            (ranges.of(pixel, level, position) - without.range(position)).to_num::<f64>()
        };
        assert_eq!(with(&[], 4, 0), 5.0);
        assert_eq!(with(&[], 0, 1), 2.75);
        assert_eq!(with(&[], 2, 1), 50.0);
        assert_eq!(with(&[4], 0, 1), 2.0);
        assert_eq!(with(&[2], 2, 1), 70.0);
        assert_eq!(with(&[2, 5], 2, 1), 0.0);
        assert_eq!(with(&[], 0, 2), 18.5);
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let array = Array::new(2, 2).unwrap();
        let new = |width, offset, offsets| Ranges::new(array, width, offset, offsets);
        let wide = U16F16::lit("250");
        for number in [1, 3, 5] {
            let error = new(wide, I24F8::ZERO, vec![None; number]).unwrap_err();
            let text = format!("has {number} numbers, but there are 4 pixels");
            assert_eq!(error.to_string(), text);
        }
        assert!(matches!(
            new(U16F16::ZERO, I24F8::ZERO, vec![]),
            Err(RangesError::Scale(_))
        ));
        for (offset, own) in [(0, 8_388_607), (4_200_000, 4_200_000), (-8_388_000, -8_000)] {
            let mut offsets = vec![None; 4];
            offsets[2] = Some(I24F8::from_num(own));
            let error = new(wide, I24F8::from_num(offset), offsets).unwrap_err();
            assert_eq!(error, RangesError::Pixel(2));
            let text = "that of pixel 2 and the offset of all reach beyond 8388 m";
            assert_eq!(error.to_string(), text);
        }
    }

    proptest! {
        /// The sum never overflows, whatever the offsets that are taken.
        #[test]
        fn any_range_is_that_of_the_scale_and_the_mean_offset(
            offset in any::<i32>(),
            own in proptest::collection::vec(proptest::option::of(any::<i32>()), 16),
            position in -512..=262_399i32,
            level in 0u8..=2,
        ) {
            let array = Array::new(4, 4).unwrap();
            let own: Vec<_> = own.into_iter().map(|own| own.map(I24F8::from_bits)).collect();
            let (width, offset) = (U16F16::lit("250"), I24F8::from_bits(offset));
            if let Ok(ranges) = Ranges::new(array, width, offset, own.clone()) {
                let position = BinPosition::new(position).unwrap();
                let level = BlockLevel::new(level).unwrap();
                let pixel = PixelAddress::new(0);
                let these = array.pixels_of(pixel, level);
                let these: Vec<f64> = these
                    .filter_map(|pixel| Some(own[usize::from(pixel.raw())]?.to_num()))
                    .collect();
                let mean = these.iter().sum::<f64>() / these.len().max(1) as f64;
                let expected = ranges.scale().range(position).to_num::<f64>() + mean;
                let range: f64 = ranges.of(pixel, level, position).to_num();
                prop_assert!((range - expected).abs() <= 0.5 / 256.0 + 1e-6);
            }
        }
    }
}
