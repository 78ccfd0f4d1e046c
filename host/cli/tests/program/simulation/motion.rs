//! Motion: what a scene says is true, and where the photons are.

use dtof_core::PixelAddress;
use dtof_light::demo;
use dtof_light::scene::{Hit, Scene};

use super::{array, float, near_count, near_mean, pixel};

/// One bin of 250 ps, in millimetres.
const MM_PER_BIN: f64 = 37.474_057_25;

fn view(scene: &Scene, pixel: u16, cycle: u64) -> Hit {
    scene.truth(PixelAddress::new(pixel), cycle).unwrap()
}

#[test]
fn a_surface_that_goes_away_takes_its_photons_along() {
    // 100 m/s for 10 ms: from 1 m to 2 m.
    let text = "[[surface]]\nrange_mm = 1000\nreflectivity = 0.5\nvelocity_m_per_s = 100\n";
    let cycles = 100_000;
    let scene = Scene::parse(text).unwrap();
    let photons = pixel(text, cycles);
    for (block, first) in (0..cycles).step_by(10_000).enumerate() {
        let seconds = 1e-3 * (float(block) + 0.5);
        let middle = view(&scene, 0, first + 5000).range_mm;
        let truth = 1000.0 + 100_000.0 * seconds;
        assert!((middle - truth).abs() < 1e-6, "{middle}");
        let in_block = |(cycle, _): &(u64, u16)| (first..first + 10_000).contains(cycle);
        let photons: Vec<_> = photons.iter().copied().filter(in_block).collect();
        // Photons by the inverse square: over a block their mean is that of the
        // product of its ends.
        let ends = (middle - 50.0) * (middle + 50.0) / 1e6;
        near_count("photons", photons.len(), 1e4 * 4.0 * 0.5 / ends);
        // Their mean range is weighted by it as well: by ∫ r⁻¹ / ∫ r⁻².
        let (near_mm, far_mm): (f64, f64) = (middle - 50.0, middle + 50.0);
        let expected = (far_mm / near_mm).ln() / (near_mm.recip() - far_mm.recip());
        let spread = 1.0 + 1.0 / 12.0 + (100.0 / MM_PER_BIN).powi(2) / 12.0;
        near_mean("position", &photons, expected / MM_PER_BIN, spread);
    }
}

#[test]
fn an_edge_moves_through_the_pixels() {
    // A column in 1000 laser cycles at 10 MHz.
    let text = "columns = 4\n\
        [[surface]]\nname = \"wall\"\nsignal = 1\nposition_bins = 80.5\n\
        [[surface]]\nname = \"edge\"\nsignal = 1\nposition_bins = 40.5\ncolumns_per_s = 10_000\n\
        rectangle = { columns = [-10, 0.9995], rows = [0, 1] }\n";
    let scene = Scene::parse(text).unwrap();
    for (index, photons) in array(text, 5000).iter().enumerate() {
        let index = u16::try_from(index).unwrap();
        // The edge is at column 0.9995 + cycle / 1000.
        let covered_from = (u64::from(index) * 1000).saturating_sub(999);
        for cycle in 0..5000 {
            let is_covered = view(&scene, index, cycle).surface == 1;
            assert_eq!(is_covered, cycle >= covered_from, "{index}, {cycle}");
        }
        for (cycle, code) in photons {
            assert_eq!(*code < 60, *cycle >= covered_from, "{index}, {cycle}");
        }
    }
}

#[test]
fn a_fan_covers_its_share_of_a_revolution() {
    // 120 rpm at 10 kHz: a revolution is 5000 laser cycles.
    let text = "columns = 3\nrows = 3\nlaser_rate_mhz = 0.01\n\
        [[surface]]\nsignal = 1\nposition_bins = 80.5\n\
        [[surface]]\nsignal = 1\nposition_bins = 40.5\n\
        fan = { centre = [1, 1], radius = 1.2, blades = 3, blade_share = 0.4, rpm = 120 }\n";
    let scene = Scene::parse(text).unwrap();
    let photons = array(text, 5000);
    for pixel in [1, 3, 5, 7] {
        let is_covered = |cycle| view(&scene, pixel, cycle).surface == 1;
        let covered: Vec<bool> = (0..5000).map(is_covered).collect();
        let share = covered.iter().filter(|covered| **covered).count();
        // Three blades, and each end of one falls between two laser cycles.
        assert!(share.abs_diff(2000) <= 3, "{share}");
        let turned = covered.iter().cycle().skip(1);
        let edges = covered.iter().zip(turned).filter(|(now, next)| now != next);
        assert_eq!(edges.count(), 6);
        for (cycle, code) in &photons[usize::from(pixel)] {
            let cycle = usize::try_from(*cycle).unwrap();
            assert_eq!(*code < 60, covered[cycle], "pixel {pixel}, cycle {cycle}");
        }
    }
    // The corners are beyond the blades.
    for corner in [0, 2, 6, 8] {
        assert!((0..5000).all(|cycle| view(&scene, corner, cycle).surface == 0));
    }
    // Clockwise: what is on the right now is at the bottom a quarter later.
    for cycle in 0..3000 {
        let [right, bottom] = [view(&scene, 5, cycle), view(&scene, 7, cycle + 1250)];
        assert_eq!(right.surface, bottom.surface);
    }
}

#[test]
fn the_nearest_surface_is_seen_and_nothing_where_there_is_none() {
    let text = "columns = 3\n\
        [[surface]]\nrange_mm = 1000\nreflectivity = 0.5\nrectangle = { columns = [0, 2], rows = [0, 1] }\n\
        [[surface]]\nrange_mm = 900\nreflectivity = 0.5\nvelocity_m_per_s = 100_000\n\
        rectangle = { columns = [1, 2], rows = [0, 1] }\n";
    let scene = Scene::parse(text).unwrap();
    assert_eq!(view(&scene, 0, 0).surface, 0);
    assert_eq!(view(&scene, 1, 0).surface, 1);
    assert_eq!(view(&scene, 1, 11).surface, 0); // the second is 1010 mm away
    assert_eq!(scene.truth(PixelAddress::new(2), 0), None);
    assert_eq!(scene.rates(PixelAddress::new(2), 0).signal, 0.0);
    assert!(array(text, 1000)[2].is_empty());
}

#[test]
fn another_array_looks_at_the_same_scene() {
    let demo = demo::scene().unwrap();
    let small = Scene {
        size: [16, 8],
        ..demo.clone()
    };
    for row in 0..8 {
        for column in 0..16 {
            let small_pixel = PixelAddress::new(row * 16 + column);
            let same_place = PixelAddress::new(row * 4 * 64 + column * 4);
            assert_eq!(small.truth(small_pixel, 0), demo.truth(same_place, 0));
        }
    }
}

#[test]
fn a_surface_must_not_come_too_near() {
    let text = "[[surface]]\nname = \"dart\"\nrange_mm = 1000\nreflectivity = 1\nvelocity_m_per_s = -100\n";
    let scene = Scene::parse(text).unwrap();
    assert!(scene.photons(1, 90_000).is_ok()); // down to 100 mm
    let error = scene.photons(1, 100_000).err().unwrap().to_string();
    assert!(error.contains("dart: comes as near as"), "{error}");
}
