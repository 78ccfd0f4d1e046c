//! A rendered depth map with a picture, `../shared/data/vgroove` beside the workspace: two
//! walls that meet in a valley.

use std::io::Write;
use std::path::{Path, PathBuf};

use dtof::engine::host::host_engine;
use dtof::input::source::{Geometry, PhotonSource};
use dtof::simulate::scene::{self, Along, DepthMap, Scene};
use dtof_core::PixelAddress;

/// Where it is; says so if it is nowhere.
fn vgroove() -> Option<PathBuf> {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/vgroove");
    let found = Some(PathBuf::from(beside)).filter(|path| path.exists());
    if found.is_none() {
        // Past the test harness, which hides what passing tests print.
        let mut out = std::io::stderr().lock();
        writeln!(out, "SKIPPED: depth map: no vgroove beside the workspace").unwrap();
    }
    found
}

/// The scene, seen by an array as large as the map unless `array` says otherwise.
fn scene_of(folder: &Path, along: Along, array: Option<Geometry>) -> Scene {
    let map = DepthMap::read(&folder.join("depth.npy"), along).unwrap();
    let map = map.with_picture(&folder.join("rgb.npy")).unwrap();
    let mut scene = Scene::parse("background = 0.02").unwrap();
    (scene.geometry, scene.layout) = (map.size(), map.size());
    scene.add_depth_map(map).unwrap();
    scene.geometry = array.unwrap_or(scene.geometry);
    scene
}

/// How much z of the points differs along a column, at most, in millimetres.
fn spread_mm(scene: &Scene) -> f64 {
    let Geometry { columns, rows } = scene.geometry;
    let z = |column: u32, row: u32| {
        let pixel = PixelAddress(u16::try_from(row * columns + column).unwrap());
        let place = |index: u32, of: u32| (f64::from(index) + 0.5) / f64::from(of);
        let ray = scene.view().ray(place(column, columns), place(row, rows));
        scene.truth(pixel, 0).unwrap().range_mm * ray[2]
    };
    let spread = (0..columns).map(|column| {
        let column: Vec<f64> = (0..rows).map(|row| z(column, row)).collect();
        let most = column.iter().copied().fold(f64::MIN, f64::max);
        most - column.iter().copied().fold(f64::MAX, f64::min)
    });
    spread.fold(0.0, f64::max)
}

/// Both walls stand upright: taken as range along the ray, z is the same along a column. The
/// file has steps of half a millimetre.
#[test]
fn its_values_are_ranges_along_the_ray() {
    let Some(folder) = vgroove() else { return };
    let ray = spread_mm(&scene_of(&folder, Along::Ray, None));
    let axis = spread_mm(&scene_of(&folder, Along::Axis, None));
    assert!(ray < 1.0, "{ray} mm");
    assert!(axis > 50.0, "{axis} mm");
}

/// Every pixel of a smaller array finds its wall.
#[test]
fn events_lie_on_its_walls() {
    let Some(folder) = vgroove() else { return };
    let array = Geometry::new(40, 30);
    let scene = scene_of(&folder, Along::Ray, Some(array));
    let settings = scene::settings(1);
    let mut photons = scene.photons(settings.seed, 500).unwrap();
    let mut engine = host_engine(&settings, array, &photons.addresses()).unwrap();
    let mut comparison = scene.comparison(&settings, 500).unwrap();
    comparison.add(&engine.run(&photons.next_slice(500).unwrap()).unwrap());
    let truth = comparison.finish();
    let all = truth.all;
    let walls = truth
        .surfaces
        .iter()
        .find(|surface| surface.name == "depth map")
        .unwrap();
    assert_eq!((walls.pixels, truth.surfaces.len()), (1200, 1));
    assert_eq!(all.false_alarms, 0);
    assert!(all.events >= 1200, "{}", all.events);
    let (bias, rms) = (all.bias_mm.unwrap(), all.rms_mm.unwrap());
    assert!(
        bias.abs() < 2.0 && rms < 10.0,
        "bias {bias} mm, rms {rms} mm"
    );
}
