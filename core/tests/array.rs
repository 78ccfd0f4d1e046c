//! Blocks of an array: each pixel is in one block of each level, whatever the array's size.

use dtof_core::{Array, BlockLevel, Neighbours, PixelAddress};
use proptest::prelude::*;

fn levels() -> impl Iterator<Item = BlockLevel> {
    (0..=3).map(|level| BlockLevel::new(level).unwrap())
}

/// Against rows and columns, one by one.
fn check(columns: u32, rows: u32) {
    let array = Array::new(columns, rows).unwrap();
    assert_eq!(array.pixels(), columns * rows);
    assert_eq!((array.columns(), array.rows()), (columns, rows));
    for level in levels() {
        let side = 1 << level.raw();
        let across = columns.div_ceil(side);
        assert_eq!(array.blocks(level), across * rows.div_ceil(side));
        let mut seen = vec![0; array.pixels() as usize];
        for block in 0..array.blocks(level) {
            let first = array.first_of(block, level);
            let (left, top) = (block % across * side, block / across * side);
            assert_eq!(u32::from(first.raw()), top * columns + left);
            let mut last = None;
            for pixel in array.pixels_of(first, level) {
                let (row, column) = (
                    u32::from(pixel.raw()) / columns,
                    u32::from(pixel.raw()) % columns,
                );
                assert!((top..top + side).contains(&row));
                assert!((left..left + side).contains(&column));
                assert!(last < Some(pixel), "in order of addresses");
                last = Some(pixel);
                assert_eq!(array.block_of(pixel, level), block);
                seen[usize::from(pixel.raw())] += 1;
            }
        }
        assert!(
            seen.iter().all(|&seen| seen == 1),
            "{columns}x{rows} {level}"
        );
        // Nowhere else, and not past the array, begins a block.
        for pixel in 0..u16::try_from(columns * (rows + 1)).unwrap_or(u16::MAX) {
            let (row, column) = (u32::from(pixel) / columns, u32::from(pixel) % columns);
            let begins = row < rows && row.is_multiple_of(side) && column.is_multiple_of(side);
            let first = PixelAddress::new(pixel);
            assert_eq!(
                array.pixels_of(first, level).next(),
                begins.then_some(first)
            );
        }
    }
}

#[test]
fn all_small_arrays() {
    for columns in 1..=20 {
        for rows in 1..=20 {
            check(columns, rows);
        }
    }
}

#[test]
fn the_largest_arrays() {
    for (columns, rows) in [
        (1 << 16, 1),
        (1, 1 << 16),
        (256, 256),
        (65_535, 1),
        (13, 5041),
    ] {
        check(columns, rows);
    }
}

#[test]
fn an_array_has_pixels_and_no_more_than_addresses() {
    for (columns, rows) in [
        (0, 0),
        (0, 1),
        (1, 0),
        (65_537, 1),
        (257, 256),
        (1 << 31, 1 << 31),
    ] {
        assert_eq!(Array::new(columns, rows), None, "{columns}x{rows}");
    }
}

#[test]
fn neighbours_are_four_or_eight() {
    let numbers = (0..=u8::MAX).filter_map(|number| Some((number, Neighbours::new(number)?)));
    let expected = [(4, Neighbours::Four), (8, Neighbours::Eight)];
    assert!(numbers.eq(expected));
    assert_eq!(expected.map(|(_, neighbours)| neighbours.raw()), [4, 8]);
}

#[test]
fn nothing_begins_inside_of_a_block_or_beyond_the_array() {
    let array = Array::new(5, 3).unwrap();
    let pixels = |pixel, level| {
        let level = BlockLevel::new(level).unwrap();
        array.pixels_of(PixelAddress::new(pixel), level).count()
    };
    assert_eq!(
        [
            pixels(1, 1),
            pixels(5, 1),
            pixels(2, 2),
            pixels(15, 0),
            pixels(u16::MAX, 3)
        ],
        [0; 5]
    );
    assert_eq!(
        [pixels(14, 0), pixels(14, 1), pixels(4, 2), pixels(0, 3)],
        [1, 1, 3, 15]
    );
}

proptest! {
    #[test]
    fn any_array(columns in 1u32..400, rows in 1u32..160) {
        check(columns, rows);
    }
}
