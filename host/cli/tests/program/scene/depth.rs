//! Scenes from a depth map.

use std::path::Path;

use dtof_core::PixelAddress;
use dtof_data::photons::geometry::FieldOfView;
use dtof_light::scene::{DepthAlong, DepthMap, Scene};
use proptest::prelude::*;

use crate::common::{Scratch, assert_contains, npy};

/// 32-bit floats as an array of rows and columns.
fn floats(shape: &str, values: &[f32]) -> Vec<u8> {
    let data: Vec<u8> = values
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect();
    npy("<f4", shape, &data)
}

/// A scene from a depth map, with a field of view of 90 degrees and an array of the same size.
fn scene(map: DepthMap) -> Scene {
    let size = map.size();
    let mut scene = Scene::parse("").unwrap();
    (scene.size, scene.layout) = (size, size);
    scene.field_of_view = Some(FieldOfView::new([90.0, 90.0]).unwrap());
    scene.add_depth_map(map).unwrap();
    scene
}

fn read(path: &Path) -> Scene {
    scene(DepthMap::read(path, DepthAlong::Axis).unwrap())
}

/// The range of each pixel.
fn ranges(scene: &Scene) -> Vec<Option<f64>> {
    let pixels = (0..)
        .take(scene.array().unwrap().pixels() as usize)
        .map(PixelAddress::new);
    pixels
        .map(|pixel| scene.truth(pixel, 0).map(|view| view.range_mm))
        .collect()
}

/// Coordinate of pixel `index` of `of` pixels over 90 degrees, at distance 1.
fn at(index: u32, of: u32) -> f64 {
    2.0 * (f64::from(index) + 0.5) / f64::from(of) - 1.0
}

#[test]
fn a_depth_is_a_range_along_the_ray_and_what_is_none_is_no_surface() {
    let scratch = Scratch::new();
    let values = [0.5, f32::NAN, 2.0, 0.0, -1.0, f32::INFINITY, 0.25, 1.0];
    let path = scratch.file("depth.npy", floats("(2, 4)", &values));
    let axis = ranges(&read(&path));
    let ray = ranges(&scene(DepthMap::read(&path, DepthAlong::Ray).unwrap()));
    for (index, value) in (0u32..).zip(values) {
        let metres = Some(f64::from(value)).filter(|value| value.is_finite() && *value > 0.0);
        let (across, down) = (at(index % 4, 4), at(index / 4, 2));
        let length = (1.0 + across * across + down * down).sqrt();
        let near = |is: Option<f64>, expected: Option<f64>| match (is, expected) {
            (Some(is), Some(expected)) => (is - expected).abs() < 1e-9,
            (is, expected) => is == expected,
        };
        let index = index as usize;
        assert!(
            near(axis[index], metres.map(|z| 1000.0 * z * length)),
            "{index}: {axis:?}"
        );
        assert_eq!(ray[index], metres.map(|range| 1000.0 * range), "{index}");
    }
}

#[test]
fn depths_of_every_type_are_the_same() {
    let scratch = Scratch::new();
    let millimetres = [100u8, 0, 127, 38];
    let expected = ranges(&read(
        &scratch.file("bytes.npy", npy("|u1", "(2, 2)", &millimetres)),
    ));
    assert!(expected[0].is_some() && expected[1].is_none());
    for descr in "|i1 <u2 >u2 <i2 >i2 <u4 >u4 <i4 >i4 <u8 >u8 <i8 >i8 <f4 >f4 <f8 >f8".split(' ') {
        let size: usize = descr[2..].parse().unwrap();
        let element = |depth: &u8| {
            let mut bytes = match &descr[1..] {
                "f4" => (f32::from(*depth) / 1000.0).to_le_bytes().to_vec(),
                "f8" => (f64::from(*depth) / 1000.0).to_le_bytes().to_vec(),
                _ => u64::from(*depth).to_le_bytes()[..size].to_vec(),
            };
            if descr.starts_with('>') {
                bytes.reverse();
            }
            bytes
        };
        let data: Vec<u8> = millimetres.iter().flat_map(element).collect();
        let path = scratch.file("depth.npy", npy(descr, "(2, 2)", &data));
        for (is, expected) in ranges(&read(&path)).into_iter().zip(&expected) {
            let error = is.unwrap_or(0.0) - expected.unwrap_or(0.0);
            assert!(error.abs() < 1e-4, "{descr}: {is:?} and {expected:?}");
        }
    }
}

proptest! {
    /// A plane n·p = c has the depth z = c / (n·(x, y, 1)) at (x, y).
    #[test]
    fn a_tilted_plane_is_that_of_the_formula(
        slope in prop::array::uniform2(-0.6..0.6f64),
        axis_m in 0.5..3.0f64,
        columns in 1u32..12,
        rows in 1u32..12,
    ) {
        let inverse = |x: f64, y: f64| (1.0 + slope[0] * x + slope[1] * y) / axis_m;
        let places: Vec<_> = (0..rows)
            .flat_map(|row| (0..columns).map(move |column| (at(column, columns), at(row, rows))))
            .collect();
        prop_assume!(places.iter().all(|&(x, y)| inverse(x, y) > 0.05));
        let data: Vec<u8> = places
            .iter()
            .flat_map(|&(x, y)| (1.0 / inverse(x, y)).to_le_bytes())
            .collect();
        let scratch = Scratch::new();
        let path = scratch.file("depth.npy", npy("<f8", &format!("({rows}, {columns})"), &data));
        // The same as a surface of a scene file.
        let plane = Scene::parse(&format!(
            "columns = {columns}\nrows = {rows}\nfield_of_view_degrees = [90, 90]\n[[surface]]\n\
             range_mm = {}\nreflectivity = 1\nplane = {{ normal = [{}, {}, 1] }}\n",
            1000.0 * axis_m, slope[0], slope[1],
        )).unwrap();
        let map = read(&path);
        let both = ranges(&map).into_iter().zip(ranges(&plane));
        for ((x, y), (map, plane)) in places.into_iter().zip(both) {
            let formula = 1000.0 / inverse(x, y) * (1.0 + x * x + y * y).sqrt();
            prop_assert!((map.unwrap() / formula - 1.0).abs() < 1e-12);
            prop_assert!((plane.unwrap() / formula - 1.0).abs() < 1e-9);
        }
        for pixel in (0..).take(map.array().unwrap().pixels() as usize).map(PixelAddress::new) {
            let (of_map, of_plane) = (map.rates(pixel, 0).signal, plane.rates(pixel, 0).signal);
            prop_assert!((of_map / of_plane - 1.0).abs() < 1e-9);
        }
    }
}

/// Every pixel of every array takes the sample at its centre, not a mean of two.
#[test]
fn another_array_sees_the_nearest_sample() {
    let scratch = Scratch::new();
    for samples in 1..=7u16 {
        let values: Vec<f32> = (1..=samples).map(f32::from).collect();
        let shape = format!("(1, {samples})");
        let path = scratch.file("depth.npy", floats(&shape, &values));
        let map = DepthMap::read(&path, DepthAlong::Ray).unwrap();
        for columns in 1..=20u32 {
            let mut scene = scene(map.clone());
            scene.size = [columns, 3];
            for (pixel, range) in (0..).zip(ranges(&scene)) {
                let middle = (f64::from(pixel % columns) + 0.5) / f64::from(columns);
                let place = middle * f64::from(samples);
                let sample = range.unwrap() / 1000.0 - 1.0;
                assert!(
                    sample - 1e-9 <= place && place <= sample + 1.0 + 1e-9,
                    "{samples} to {columns}: pixel {pixel} sees {sample}"
                );
                assert_eq!(sample.fract(), 0.0);
            }
        }
    }
}

#[test]
fn a_picture_is_the_reflectivity() {
    let scratch = Scratch::new();
    let depth = scratch.file("depth.npy", floats("(1, 3)", &[1.0, 2.0, 0.5]));
    let expected = [1.0, 0.2, 0.4];
    let bytes = [255u8, 51, 102];
    let colours = [255, 255, 255, 0, 51, 102, 153, 102, 51];
    let pictures = [
        npy("|u1", "(1, 3)", &bytes),
        npy("|u1", "(1, 3, 3)", &colours),
        floats("(1, 3)", &[1.0, 0.2, 0.4]),
        floats("(1, 3, 3)", &[1.0, 1.0, 1.0, 0.0, 0.2, 0.4, 0.6, 0.4, 0.2]),
    ];
    for picture in pictures {
        let map = DepthMap::read(&depth, DepthAlong::Ray).unwrap();
        let picture = scratch.file("picture.npy", picture);
        let scene = scene(map.with_picture(&picture).unwrap());
        for (pixel, reflectivity) in expected.iter().enumerate() {
            let pixel = PixelAddress::new(u16::try_from(pixel).unwrap());
            let metres = [1.0, 2.0, 0.5f64][usize::from(pixel.raw())];
            let signal = scene.rates(pixel, 0).signal;
            let formula = 4.0 * reflectivity / metres.powi(2);
            assert!((signal - formula).abs() < 1e-6, "{signal} and {formula}");
            let dark = scene.clone().with_laser_off().rates(pixel, 0);
            assert_eq!(dark.signal, 0.0);
        }
    }
}

#[test]
fn a_scene_file_and_a_depth_map_hide_one_another() {
    let scratch = Scratch::new();
    let path = scratch.file("depth.npy", floats("(1, 2)", &[1.0, f32::NAN]));
    let mut scene = Scene::parse(
        "columns = 4\n[[surface]]\nrange_mm = 500\nreflectivity = 0.5\n\
         rectangle = { columns = [0, 1], rows = [0, 1] }\n\
         [[surface]]\nrange_mm = 3000\nreflectivity = 0.5\n",
    )
    .unwrap();
    scene
        .add_depth_map(DepthMap::read(&path, DepthAlong::Ray).unwrap())
        .unwrap();
    let expected = [500.0, 1000.0, 3000.0, 3000.0].map(Some);
    assert_eq!(ranges(&scene), expected);
}

#[test]
fn a_run_is_compared_with_the_depth_map_and_says_what_it_took() {
    let scratch = Scratch::new();
    let metres: Vec<f32> = (0u8..64)
        .map(|sample| 1.0 + f32::from(sample) / 64.0)
        .collect();
    scratch.file("depth.npy", floats("(8, 8)", &metres));
    scratch.file("picture.npy", npy("|u1", "(8, 8)", &[128; 64]));
    let run = "simulate --out out --cycles 3000 --seed 5 --alpha 6 --depth depth.npy";
    let printed = scratch.printed(&format!("{run} --albedo picture.npy --fov 40x30"));
    for part in [
        "depth along the optical axis",
        "40x30 degrees",
        "4 photons a laser cycle from a white surface at 1 m",
        "0.02 photons a bin and laser cycle",
        "standard deviation 1 bins",
        "--fov 40",
    ] {
        assert_contains(&printed, part);
    }
    let summary = scratch.summary();
    let truth = &summary["against_truth"];
    assert_eq!(
        (&summary["input"], &summary["pixels"]),
        (&"depth.npy".into(), &64.into())
    );
    assert_eq!(truth["surfaces"][0]["name"], "depth map");
    let of = |name: &str| truth[name].as_f64().unwrap();
    assert!(
        of("events") > 1000.0 && of("false_alarm_share") < 0.01,
        "{truth}"
    );
    assert!(of("rms_mm") < 20.0, "{truth}");
    scratch.printed(&format!(
        "{run} --array 4x2 --signal-at-one-metre 1 --background 0.1 --pulse-sigma-bins 2 --quiet"
    ));
    assert_eq!(scratch.summary()["pixels"], 8);
}

#[test]
fn what_is_no_depth_map_is_refused_in_a_line() {
    let scratch = Scratch::new();
    for (name, bytes) in [
        ("depth.npy", floats("(2, 2)", &[1.0; 4])),
        ("line.npy", floats("(4,)", &[1.0; 4])),
        ("deep.npy", floats("(1, 2, 2)", &[1.0; 4])),
        (
            "nothing.npy",
            floats("(2, 2)", &[0.0, -1.0, f32::NAN, f32::INFINITY]),
        ),
        ("mm.npy", floats("(1, 2)", &[700.0, 800.0])),
        ("m.npy", npy("|u1", "(1, 2)", &[1, 3])),
        ("near.npy", floats("(1, 2)", &[0.0005, 1.0])),
        ("bright.npy", floats("(1, 2)", &[0.01, 1.0])),
        ("text.npy", b"1.0, 2.0\n".to_vec()),
        (
            "large.npy",
            npy("<f4", "(1, 65537)", &1f32.to_le_bytes().repeat(65_537)),
        ),
        ("wide.npy", npy("|u1", "(2, 3)", &[1; 6])),
        ("four.npy", npy("|u1", "(2, 2, 4)", &[1; 16])),
        ("words.npy", npy("<u2", "(2, 2)", &[1; 8])),
        ("negative.npy", floats("(2, 2)", &[1.0, -0.5, 1.0, 1.0])),
        ("nan.npy", floats("(2, 2)", &[1.0, f32::NAN, 1.0, 1.0])),
    ] {
        scratch.file(name, bytes);
    }
    scratch.all_refused(
        "simulate --out out",
        "
            --depth none.npy | none.npy | No such file
            --depth line.npy | line.npy | two axes, rows and columns | [4]
            --depth deep.npy | deep.npy | two axes | [1, 2, 2]
            --depth nothing.npy | nothing.npy | no surface anywhere
            --depth mm.npy | mm.npy | nearer than 700000 mm | ends at 4797 mm | floats are metres
            --depth m.npy | m.npy | farther away than 3.0 mm | integers millimetres
            --depth near.npy | near.npy | as near as 0.5 mm
            --depth bright.npy | bright.npy | 40000 signal photons a laser cycle from 10.0 mm
            --depth text.npy | text.npy | not an .npy file
            --depth large.npy | large.npy | 65537 pixels: more than 65,536
            --depth depth.npy --albedo none.npy | none.npy | No such file
            --depth depth.npy --albedo wide.npy | wide.npy | 2 rows and 3 columns, but the depth map has 2 and 2
            --depth depth.npy --albedo four.npy | four.npy | three colours | [2, 2, 4]
            --depth depth.npy --albedo words.npy | words.npy | bytes or floats
            --depth depth.npy --albedo negative.npy | negative.npy | a value of -0.5
            --depth depth.npy --albedo nan.npy | nan.npy | a value of NaN
            --albedo depth.npy | --depth
            --depth-along ray | --depth
            --depth depth.npy --depth-along z | axis
            --depth depth.npy --fov 200x20 | HORIZONTALxVERTICAL
            --depth depth.npy --background -1 | must be a number from 0 to 100
            --depth depth.npy --signal-at-one-metre 1e7 | from 0 to 1000000
            --depth depth.npy --pulse-sigma-bins x | from 0 to 1000
        ",
    );
}
