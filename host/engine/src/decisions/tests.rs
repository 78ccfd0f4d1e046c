use super::*;

#[test]
fn all_pixels_of_a_small_array_are_kept_and_a_grid_of_a_large_one() {
    let every = |columns, rows, bins| Kept::of(Array::new(columns, rows).unwrap(), bins).every;
    assert_eq!(every(1, 1, 1024), 1);
    assert_eq!(every(64, 64, 128), 1);
    assert_eq!(every(65, 64, 128), 2);
    assert_eq!(every(256, 256, 128), 4);
    assert_eq!(every(256, 256, 1024), 16);
    assert_eq!(every(160, 160, 128), 4);
    assert_eq!(every(65_536, 1, 1024), 128);
    let kept = Kept::of(Array::new(65, 64).unwrap(), 128);
    let held: Vec<u16> = (0..200)
        .filter(|&pixel| kept.holds(PixelAddress(pixel)))
        .collect();
    // The first of each pair of columns in row 0 and in row 2.
    let expected = (0..65).chain(130..195);
    let expected: Vec<u16> = expected.filter(|pixel| pixel % 65 % 2 == 0).collect();
    assert_eq!(held, expected);
}
