//! The layout of an array: pixels, and the blocks they make.
//!
//! The address of a pixel is `row · columns + column`. A block of level `k` has 2ᵏ × 2ᵏ
//! pixels and begins at a row and a column that are multiples of 2ᵏ. At the edges of the
//! array a block has fewer pixels. So each pixel is in exactly one block of each level.
//!
//! ```
//! use dtof_core::{Array, BlockLevel, PixelAddress};
//!
//! let array = Array::new(5, 3).unwrap();
//! let level = BlockLevel::new(1).unwrap(); // 2 × 2
//! assert_eq!(array.blocks(level), 3 * 2);
//! assert_eq!(array.block_of(PixelAddress::new(13), level), 4); // row 2, column 3
//! let first = array.first_of(4, level);
//! assert_eq!(first, PixelAddress::new(12));
//! let pixels: Vec<u16> = array.pixels_of(first, level).map(|pixel| pixel.raw()).collect();
//! assert_eq!(pixels, [12, 13]); // there is no row 3
//! ```

use crate::units::{BlockLevel, PixelAddress};

/// The columns and rows of an array: together at most 65,536 pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Array {
    columns: u32,
    rows: u32,
}

impl Array {
    /// The most pixels of an array: one for each address.
    pub const MOST_PIXELS: u32 = 1 << 16;

    /// `None` without pixels or with more than [`Self::MOST_PIXELS`].
    #[must_use]
    pub const fn new(columns: u32, rows: u32) -> Option<Self> {
        let pixels = columns as u64 * rows as u64;
        if pixels == 0 || pixels > Self::MOST_PIXELS as u64 {
            return None;
        }
        Some(Self { columns, rows })
    }

    /// Pixels in a row.
    #[must_use]
    pub const fn columns(&self) -> u32 {
        self.columns
    }

    /// Rows.
    #[must_use]
    pub const fn rows(&self) -> u32 {
        self.rows
    }

    /// All pixels.
    #[must_use]
    pub const fn pixels(&self) -> u32 {
        self.columns * self.rows
    }

    /// How many blocks of `level` there are, those at the edges included.
    #[must_use]
    pub const fn blocks(&self, level: BlockLevel) -> u32 {
        self.blocks_in_a_row(level) * self.rows.div_ceil(1 << level.raw())
    }

    /// The number of the block of `level` that contains `pixel`, a pixel of the array.
    /// Blocks are numbered row by row, as pixels are.
    #[inline]
    #[must_use]
    pub fn block_of(&self, pixel: PixelAddress, level: BlockLevel) -> u32 {
        // At least one column.
        let row = (pixel.raw() as u32).checked_div(self.columns).unwrap_or(0);
        let column = pixel.raw() as u32 - row * self.columns;
        (row >> level.raw()) * self.blocks_in_a_row(level) + (column >> level.raw())
    }

    /// The first pixel of block number `block` of `level`, one of [`Self::blocks`].
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "an address of the array")]
    pub fn first_of(&self, block: u32, level: BlockLevel) -> PixelAddress {
        let across = self.blocks_in_a_row(level);
        let row = block.checked_div(across).unwrap_or(0);
        let column = block - row * across;
        PixelAddress::new(((row.wrapping_mul(self.columns) + column) << level.raw()) as u16)
    }

    /// The pixels of the block of `level` whose first is `first`, row by row. Empty if no
    /// block of the level begins there.
    pub fn pixels_of(
        &self,
        first: PixelAddress,
        level: BlockLevel,
    ) -> impl Iterator<Item = PixelAddress> + use<> {
        let (columns, side) = (self.columns, 1 << level.raw());
        let row = u32::from(first.raw()).checked_div(columns).unwrap_or(0);
        let column = u32::from(first.raw()) - row * columns;
        let begins = row < self.rows && (row | column) & (side - 1) == 0;
        let across = if begins {
            side.min(columns - column)
        } else {
            0
        };
        let rows = row..self.rows.min(row + side);
        #[allow(clippy::cast_possible_truncation, reason = "an address of the array")]
        let address =
            move |row: u32, right| PixelAddress::new((row * columns + column + right) as u16);
        rows.flat_map(move |row| (0..across).map(move |right| address(row, right)))
    }

    /// The neighbours of a pixel of the array that exist: of a corner 2 of four or 3 of eight. None of a pixel
    /// outside it.
    #[inline]
    pub fn neighbours(
        &self,
        pixel: PixelAddress,
        neighbours: Neighbours,
    ) -> impl Iterator<Item = PixelAddress> + Clone + use<> {
        let Self { columns, rows } = *self;
        let row = u32::from(pixel.raw()).checked_div(columns).unwrap_or(0);
        let column = u32::from(pixel.raw()).wrapping_sub(row * columns);
        let steps: &[_] = if row < rows { neighbours.steps() } else { &[] };
        let steps = steps.iter();
        steps.filter_map(move |&(down, right)| {
            let row = row
                .checked_add_signed(down.into())
                .filter(|&row| row < rows)?;
            let column = column
                .checked_add_signed(right.into())
                .filter(|&column| column < columns)?;
            u16::try_from(row * columns + column)
                .ok()
                .map(PixelAddress::new)
        })
    }

    const fn blocks_in_a_row(&self, level: BlockLevel) -> u32 {
        self.columns.div_ceil(1 << level.raw())
    }
}

/// The pixels around a pixel.
///
/// Exhaustive, because the link and the C header number them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Neighbours {
    /// Those that share a side.
    Four,
    /// Those that share a corner, too.
    Eight,
}

impl Neighbours {
    /// From their number; `None` unless it is 4 or 8.
    #[must_use]
    pub const fn new(number: u8) -> Option<Self> {
        match number {
            4 => Some(Self::Four),
            8 => Some(Self::Eight),
            _ => None,
        }
    }

    /// Their number: 4 or 8.
    #[must_use]
    pub const fn raw(self) -> u8 {
        match self {
            Self::Four => 4,
            Self::Eight => 8,
        }
    }

    /// Rows and columns to them.
    const fn steps(self) -> &'static [(i8, i8)] {
        const EIGHT: &[(i8, i8); 8] = &[
            (-1, 0),
            (0, -1),
            (0, 1),
            (1, 0),
            (-1, -1),
            (-1, 1),
            (1, -1),
            (1, 1),
        ];
        match self {
            Self::Four => EIGHT.split_at(4).0,
            Self::Eight => EIGHT,
        }
    }
}
