use super::*;

#[test]
fn all_pixels_of_a_small_array_are_kept_and_a_grid_of_a_large_one() {
    let step = |columns, rows, bins| KeptPixels::new(Array::new(columns, rows).unwrap(), bins).step;
    assert_eq!(step(1, 1, 1024), 1);
    assert_eq!(step(64, 64, 128), 1);
    assert_eq!(step(65, 64, 128), 2);
    assert_eq!(step(256, 256, 128), 4);
    assert_eq!(step(256, 256, 1024), 16);
    assert_eq!(step(160, 160, 128), 4);
    assert_eq!(step(65_536, 1, 1024), 128);
    let kept = KeptPixels::new(Array::new(65, 64).unwrap(), 128);
    let kept_pixels: Vec<u16> = (0..200)
        .filter(|&pixel| kept.contains(PixelAddress::new(pixel)))
        .collect();
    // The first of each pair of columns in row 0 and in row 2.
    let expected = (0..65).chain(130..195);
    let expected: Vec<u16> = expected.filter(|pixel| pixel % 65 % 2 == 0).collect();
    assert_eq!(kept_pixels, expected);
}
