//! `dtof export --one-per-pixel`: the depth map as points.

use crate::common::{Scratch, assert_contains};

/// Two surfaces of which one is too dim for single pixels, so that blocks report, too.
const SCENE: &str = "
columns = 16
rows = 8
cycles = 6000
background = 0.01
[[surface]]
range_mm = 3000
signal = 0.02
[[surface]]
range_mm = 2000
signal = 0.3
rectangle = { columns = [4, 12], rows = [2, 6] }
";

#[test]
fn each_pixel_has_one_point_at_its_depth() {
    let scratch = Scratch::new();
    let scene = scratch.file("scene.toml", SCENE);
    for options in [
        "--rule window --sigma-bins 1 --binning 2",
        "--rule window --sigma-bins 1 --echoes 2",
        "--rule window --sigma-bins 1 --decide-once",
    ] {
        scratch.simulated(&scene, options);
        let printed =
            scratch.printed("export out/events.aer --format csv --out points.csv --one-per-pixel");
        let depths = scratch.map("depth-events");
        let depths = (0u32..).zip(&depths).filter(|(_, depth)| !depth.is_nan());
        let depths: Vec<(u32, f64)> = depths.map(|(pixel, depth)| (pixel, *depth)).collect();
        assert!(depths.len() > 30, "{options}");
        assert_contains(
            &printed,
            &format!("points.csv: {} points, one a pixel (", depths.len()),
        );
        let text = scratch.read("points.csv");
        let rows = text.lines().skip(1).map(|row| {
            let cells = row.split(',').map(|cell| cell.parse().unwrap());
            cells.collect::<Vec<f64>>()
        });
        let rows: Vec<Vec<f64>> = rows.collect();
        assert_eq!(rows.len(), depths.len());
        // time, x, y, z; cycle, pixel, exposure, peak bin, depth in bins, range
        for (row, (pixel, depth)) in rows.iter().zip(&depths) {
            let metres = row[1].hypot(row[2]).hypot(row[3]);
            assert_eq!(row[5], f64::from(*pixel));
            assert!((row[9] - depth).abs() < 0.000_51, "{row:?} {depth}");
            assert!((1000.0 * metres - depth).abs() < 0.01, "{row:?} {depth}");
        }
        // Switched off, it is a point an event.
        let printed = scratch
            .printed("export out/events.aer --format ply --out all.ply --one-per-pixel=false");
        assert_contains(&printed, " events (");
    }
}
