use proptest::prelude::*;

use super::*;

fn array(columns: u32, rows: u32) -> Array {
    Array::new(columns, rows).unwrap()
}

fn length([x, y, z]: [f64; 3]) -> f64 {
    (x * x + y * y + z * z).sqrt()
}

/// The angle between two unit rays in degrees.
fn between(a: [f64; 3], b: [f64; 3]) -> f64 {
    let cosine: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    cosine.clamp(-1.0, 1.0).acos().to_degrees()
}

#[test]
fn the_edges_of_the_image_are_the_field_of_view_apart() {
    for degrees in [[60.0, 40.0], [1.0, 179.0], [0.01, 90.0]] {
        let view = FieldOfView::new(degrees).unwrap();
        let across = between(view.ray(0.0, 0.5), view.ray(1.0, 0.5));
        let down = between(view.ray(0.5, 0.0), view.ray(0.5, 1.0));
        assert!((across - degrees[0]).abs() < 1e-6, "{across}");
        assert!((down - degrees[1]).abs() < 1e-6, "{down}");
        assert!(
            view.degrees()
                .iter()
                .zip(degrees)
                .all(|(is, expected)| (is - expected).abs() < 1e-9)
        );
    }
}

#[test]
fn corners_are_exact() {
    // tan 45° = 1: the corner of the image lies at (±1, ±1, 1).
    let view = FieldOfView::new([90.0, 90.0]).unwrap();
    let third = 1.0 / 3f64.sqrt();
    for (across, down, corner) in [
        (0.0, 0.0, [-third, -third, third]),
        (1.0, 0.0, [third, -third, third]),
        (1.0, 1.0, [third, third, third]),
    ] {
        for (is, should) in view.ray(across, down).iter().zip(corner) {
            assert!((is - should).abs() < 1e-15);
        }
    }
    // The middle of the corner pixel of 4×4 is 3/4 of the way from the middle.
    let rays = Rays::pinhole(array(4, 4), view);
    let [x, y, z] = rays.rays[0].direction;
    assert!((x / z + 0.75).abs() < 1e-15 && (y / z + 0.75).abs() < 1e-15);
}

#[test]
fn x_is_to_the_right_and_y_down() {
    let rays = Rays::pinhole(array(4, 2), FieldOfView::default_for([4, 2]));
    let point = |pixel| {
        rays.point(PixelAddress::new(pixel), BlockLevel::PIXEL, 2000.0)
            .unwrap()
    };
    let [upper_left, upper_right, lower_left] = [point(0), point(3), point(4)];
    assert!(upper_left[0] < 0.0 && upper_left[1] < 0.0 && upper_left[2] > 0.0);
    assert!(upper_right[0] > 0.0 && upper_right[1] < 0.0);
    assert!(lower_left[0] < 0.0 && lower_left[1] > 0.0);
    assert!((length(upper_left) - 2.0).abs() < 1e-15); // range along the ray, in metres
    assert_eq!(
        rays.point(PixelAddress::new(8), BlockLevel::PIXEL, 1.0),
        None
    );
}

#[test]
fn an_array_sees_60_degrees_along_its_longer_side_by_default() {
    let degrees = FieldOfView::default_for([64, 32]).degrees();
    assert!((degrees[0] - 60.0).abs() < 1e-9 && (degrees[1] - 32.2).abs() < 0.01);
    let degrees = FieldOfView::default_for([1, 256]).degrees();
    assert!((degrees[1] - 60.0).abs() < 1e-9 && degrees[0] < 0.3);
    let degrees = FieldOfView::default_for([1, 1]).degrees();
    assert_eq!(degrees[0], degrees[1]);
}

#[test]
fn fields_of_view_that_cannot_be_are_refused() {
    for text in [
        "", "60", "x", "60x", "60x0", "0x60", "180x60", "-1x5", "nanx5", "infx5", "60x40x2",
    ] {
        assert_eq!(text.parse::<FieldOfView>(), Err(FieldOfViewError), "{text}");
    }
    assert_eq!("60x40".parse(), FieldOfView::new([60.0, 40.0]));
    assert_eq!(
        FieldOfViewError.to_string(),
        "must be HORIZONTALxVERTICAL in degrees, as 60x32.2, each from 0.01 to 179"
    );
}

#[test]
fn a_field_of_view_is_printed_as_it_is_read() {
    for text in ["60x40", "0.01x179", "100x32.2", "45.25x90"] {
        assert_eq!(text.parse::<FieldOfView>().unwrap().to_string(), text);
    }
    let wide = FieldOfView::default_for([64, 32]);
    assert_eq!(
        format!("{wide} {wide:.6} {wide:.0}"),
        "60x32.2 60x32.204228 60x32"
    );
}

/// The rays of a calibration: x, y, z and range bias of each pixel.
fn calibrated(array: Array, pixels: &[[f64; 4]]) -> Rays {
    let (columns, rows) = (array.columns(), array.rows());
    let text = format!("columns = {columns}\nrows = {rows}\npixels = {pixels:?}\n");
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(&file, text).unwrap();
    Rays::read(file.path(), array).unwrap()
}

#[test]
fn a_calibration_gives_directions_and_takes_the_bias_off() {
    // The longest and the shortest directions, and the largest biases.
    let rays = calibrated(
        array(2, 2),
        &[
            [0.0, 0.0, 1e-6, -1e6],
            [3.0, 0.0, 4.0, 12.5],
            [-1e6, 0.0, 0.0, 1e6],
            [0.0, 3.0, -4.0, 0.0],
        ],
    );
    assert_eq!(rays.biases(), [-1e6, 12.5, 1e6, 0.0]);
    for (pixel, range_mm, [x, y, z]) in [
        (0, 500.0, [0.0, 0.0, 1000.5]),
        (1, 2012.5, [1.2, 0.0, 1.6]),
        (2, 1_001_000.0, [-1.0, 0.0, 0.0]),
        (3, 1000.0, [0.0, 0.6, -0.8]),
    ] {
        let point = rays.point(PixelAddress::new(pixel), BlockLevel::PIXEL, range_mm);
        let point = point.unwrap();
        let off = length([point[0] - x, point[1] - y, point[2] - z]);
        assert!(off < 1e-12, "pixel {pixel}: {point:?}");
    }
    // A plane lies 1/cos as far along a ray; what points to the side or back is limited.
    assert_eq!(rays.slants(), [1.0, 1.25, 100.0, 100.0]);
}

#[test]
fn the_point_of_a_block_is_on_the_mean_of_its_rays() {
    let rays = calibrated(
        array(3, 2),
        &[
            [2.0, 0.0, 0.0, 10.0],
            [0.0, 5.0, 0.0, 20.0],
            [0.0, 0.0, 1.0, 70.0],
            [0.0, 0.0, 1.0, 30.0],
            [0.0, 0.0, 3.0, 60.0],
            [0.0, 1.0, 0.0, 80.0],
        ],
    );
    let level = BlockLevel::new(1).unwrap();
    let point = |pixel, range_mm| rays.point(PixelAddress::new(pixel), level, range_mm);
    // Four pixels: their unit rays add up to (1, 1, 2), their biases to 120 mm.
    let side = 2.0 / 6f64.sqrt();
    let [x, y, z] = point(0, 2030.0).unwrap();
    assert!(length([x - side, y - side, z - 2.0 * side]) < 1e-12);
    // Two pixels at the edge: (0, 1, 1) and 150 mm.
    let [x, y, z] = point(2, 2075.0).unwrap();
    assert!(length([x, y - 2f64.sqrt(), z - 2f64.sqrt()]) < 1e-12);
    // No block begins here.
    assert_eq!([point(1, 1000.0), point(3, 1000.0)], [None; 2]);
    let opposite = [1.0, -1.0].map(|x| [x, 0.0, 0.0, 0.0]);
    let cancel = calibrated(array(2, 1), &opposite);
    assert_eq!(cancel.point(PixelAddress::new(0), level, 1000.0), None);
}

#[test]
fn the_largest_calibration_is_read_in_linear_time() {
    let pixels: String = (0..65_536)
        .map(|pixel| format!("[0, 0, 1, {pixel}],\n"))
        .collect();
    let text = format!("columns = 256\nrows = 256\npixels = [\n{pixels}]\n");
    let begin = std::time::Instant::now();
    let rays = calibration::parse(&text, array(256, 256)).unwrap();
    assert_eq!(rays[65_535].bias_mm, 65_535.0);
    // Counting the lines before each pixel would take minutes.
    let seconds = begin.elapsed().as_secs();
    assert!(seconds < 30, "{seconds} s");
}

#[test]
fn calibrations_that_cannot_be_are_refused_with_the_line() {
    let good = "[0, 0, 1, 0],\n";
    let pixels =
        |before: &str, row: &str| format!("columns = 2\nrows = 1\npixels = [\n{before}{row}\n]\n");
    let other = pixels(good, good).replace("rows = 1", "rows = 3");
    for (text, part) in [
        ("", "line 1: missing field"),
        ("columns = 2\nrows = \n", "line 2: "),
        (&pixels("", "[0, 0, 1]"), "array of length 4"),
        (&pixels("", "[0, 0, 1]"), "line 4: "),
        (
            &pixels(good, "[0, 0, 0, 0]"),
            "line 5: the direction has no length",
        ),
        (&pixels(good, "[nan, 0, 1, 0]"), "line 5: direction NaN"),
        (&pixels("[0, 0, 1, inf],\n", good), "line 4: range bias inf"),
        (&pixels("", good), "line 4: 1 pixels, should be 2"),
        (&pixels(&good.repeat(2), good), "line 6: 3 pixels"),
        (&other, "line 1: is of 2x3 pixels, the events are of 2x1"),
        (&(pixels("", "") + "bias = 1\n"), "line 6: unknown field"),
        (
            &pixels(good, "[0, -1000001, 0, 0]"),
            "line 5: direction -1000001: must be from -1000000 to 1000000",
        ),
    ] {
        let error = calibration::parse(text, array(2, 1)).unwrap_err();
        let message = format!("{error:#}");
        assert!(message.contains(part), "{message:?} does not say {part:?}");
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("rays.toml");
    std::fs::write(&file, pixels(good, "[0, 0, 0, 0]")).unwrap();
    let error = Rays::read(&file, array(2, 1)).unwrap_err();
    let reason = "line 5: the direction has no length";
    assert_eq!(
        format!("{error:#}"),
        format!("{}: {reason}", file.display())
    );
}

proptest! {
    #[test]
    fn rays_have_length_1_and_mirror_each_other(
        columns in 1u32..80, rows in 1u32..80, horizontal in 0.01..179.0, vertical in 0.01..179.0,
    ) {
        let view = FieldOfView::new([horizontal, vertical]).unwrap();
        let rays = Rays::pinhole(array(columns, rows), view).rays;
        prop_assert_eq!(rays.len(), (columns * rows) as usize);
        for (index, ray) in rays.iter().enumerate() {
            prop_assert!((length(ray.direction) - 1.0).abs() < 1e-15);
            // Turned by 180 degrees, the last pixel is the first.
            let [x, y, z] = rays[rays.len() - 1 - index].direction;
            let opposite = [-x, -y, z];
            for (a, b) in ray.direction.iter().zip(opposite) {
                prop_assert!((a - b).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn rays_along_a_row_are_evenly_spaced_at_distance_1(columns in 2u32..80, degrees in 1.0..170.0) {
        let view = FieldOfView::new([degrees, 10.0]).unwrap();
        let rays = Rays::pinhole(array(columns, 1), view).rays;
        let step = 2.0 * (f64::from(columns)).recip() * (degrees / 2.0f64).to_radians().tan();
        for two in rays.windows(2) {
            let [a, b] = [two[0].direction, two[1].direction];
            prop_assert!((b[0] / b[2] - a[0] / a[2] - step).abs() < 1e-9 * step.max(1.0));
        }
    }
}
