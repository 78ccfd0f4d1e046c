//! A flat wall at an angle comes back from `dtof export` as a plane.

use std::path::Path;

use crate::common::Scratch;
use dtof_core::PixelAddress;
use dtof_light::scene::{Scene, Shape};

/// Beyond this an event is false, as in the reports.
const FALSE_BEYOND_BINS: f64 = 3.0;

type Point = [f64; 3];

fn dot(a: Point, b: Point) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn rms(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = values.clone().count() as f64;
    (values.map(|value| value * value).sum::<f64>() / count).sqrt()
}

/// An event: its point in millimetres, the range of it, and the truth.
struct RangedEvent {
    point: Point,
    range_mm: f64,
    truth_mm: f64,
}

/// The events of the scene, and how many were false.
fn events(scene: &Path, scratch: &Scratch) -> (Vec<RangedEvent>, usize) {
    let truth = Scene::read(scene).unwrap();
    scratch.simulated(scene, "--alpha 8 --l1 100 --l2 2000 --x 10");
    scratch.printed("export out/events.aer --format csv --out wall.csv --fov 60x32");
    let text = scratch.read("wall.csv");
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let event = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let cell = |name| cells[names.iter().position(|is| *is == name).unwrap()];
        let number = |name| cell(name).parse::<f64>().unwrap();
        let address = PixelAddress::new(cell("pixel").parse().unwrap());
        let view = truth.truth(address, cell("cycle").parse().unwrap());
        RangedEvent {
            point: ["x_m", "y_m", "z_m"].map(|side| number(side) * 1000.0),
            range_mm: number("range_mm"),
            truth_mm: view.unwrap().range_mm,
        }
    };
    let limit = FALSE_BEYOND_BINS * truth.mm_per_bin();
    let is_right = |event: &RangedEvent| (event.range_mm - event.truth_mm).abs() < limit;
    let (right, wrong): (Vec<RangedEvent>, Vec<RangedEvent>) = lines.map(event).partition(is_right);
    (right, wrong.len())
}

#[test]
fn a_tilted_wall_comes_back_as_a_plane() {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/tilted-wall.toml");
    let wall = Scene::read(&scene).unwrap().surfaces.remove(0);
    let Shape::Plane(plane) = &wall.shape else {
        panic!("the wall is no plane");
    };
    let length = dot(plane.normal, plane.normal).sqrt();
    let normal = plane.normal.map(|side| side / length);
    let through = normal[2] * wall.range_mm;
    let (events, wrong) = events(&scene, &Scratch::new());

    // A point is as far from the plane as its range is wrong, seen along the normal.
    // Points are rounded to f32, ranges are printed with three decimals.
    let distance = |event: &RangedEvent| dot(normal, event.point) - through;
    let mut across = Vec::new();
    for event in &events {
        let ray = event
            .point
            .map(|side| side / dot(event.point, event.point).sqrt());
        let error = event.range_mm - event.truth_mm;
        across.push(error * dot(normal, ray));
        assert!((distance(event) - across[across.len() - 1]).abs() < 0.002);
    }
    let from_plane = rms(events.iter().map(distance));
    let depth_error = rms(events.iter().map(|event| event.range_mm - event.truth_mm));
    let expected = rms(across.iter().copied());
    assert!((from_plane - expected).abs() < 0.002 && from_plane < depth_error);

    // The plane that fits the points best is the wall within the noise: with noise s and n points,
    // the deviation of a slope is s / (spread × √n), that of a position s / √n. Four standard
    // deviations include 99.99 % of outcomes.
    let n = events.len() as f64;
    let [u, v] = in_plane(normal);
    let place = |event: &RangedEvent| [dot(u, event.point), dot(v, event.point), distance(event)];
    let places: Vec<Point> = events.iter().map(place).collect();
    let mean = [0, 1, 2].map(|axis| places.iter().map(|place| place[axis]).sum::<f64>() / n);
    let sum = |a: usize, b: usize| {
        let product = |place: &Point| (place[a] - mean[a]) * (place[b] - mean[b]);
        places.iter().map(product).sum::<f64>()
    };
    // Least squares: how the distance grows along u and v.
    let (uu, uv, vv) = (sum(0, 0), sum(0, 1), sum(1, 1));
    let determinant = uu * vv - uv * uv;
    let slope_u = (sum(0, 2) * vv - sum(1, 2) * uv) / determinant;
    let slope_v = (sum(1, 2) * uu - sum(0, 2) * uv) / determinant;
    let deviation_u = from_plane * (vv / determinant).sqrt();
    let deviation_v = from_plane * (uu / determinant).sqrt();
    println!(
        "{} events ({wrong} false left out): {from_plane:.2} mm rms from the wall, depth error \
         {depth_error:.2} mm rms; {:.2} mm off, turned by {:.3} and {:.3} degrees (deviations \
         {:.2} mm, {:.3} and {:.3} degrees)",
        events.len(),
        mean[2],
        slope_u.atan().to_degrees(),
        slope_v.atan().to_degrees(),
        from_plane / n.sqrt(),
        deviation_u.to_degrees(),
        deviation_v.to_degrees(),
    );
    assert!(slope_u.abs() < 4.0 * deviation_u && slope_v.abs() < 4.0 * deviation_v);
    // Of two bins with as many photons the first is the peak, so that ranges are a little
    // short: by less than 1/100 bin here.
    assert!(mean[2].abs() < 0.375 + 4.0 * from_plane / n.sqrt());
    let stated = format!("{from_plane:.1} mm, depth error {depth_error:.1} mm");
    assert_eq!(
        stated, "7.5 mm, depth error 9.3 mm",
        "docs/export.md says so"
    );
}

/// Two directions at right angles to a unit normal and to each other.
fn in_plane([x, y, z]: Point) -> [Point; 2] {
    let length = x.hypot(z);
    let u = [z / length, 0.0, -x / length];
    let v = [
        y * u[2] - z * u[1],
        z * u[0] - x * u[2],
        x * u[1] - y * u[0],
    ];
    [u, v]
}
