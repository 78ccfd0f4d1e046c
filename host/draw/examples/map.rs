//! A ball before a wall, as a map of distances:
//! `cargo run --package dtof-draw --example map > map.svg`.

use dtof_draw::picture::{Map, heat_map};

const COLUMNS: u16 = 32;
const ROWS: u16 = 16;

/// The distance of a pixel's surface in metres; none in one corner.
fn distance(column: u16, row: u16) -> Option<f64> {
    let [across, down] = [(column, 11.5), (row, 7.5)].map(|(at, middle)| f64::from(at) - middle);
    let beside = (across * across + down * down) / 36.0;
    match column + 2 > COLUMNS && row < 2 {
        true => None,
        false if beside < 1.0 => Some(2.0 - 0.4 * (1.0 - beside).sqrt()),
        false => Some(3.0),
    }
}

fn main() -> anyhow::Result<()> {
    let pixels = (0..ROWS).flat_map(|row| (0..COLUMNS).map(move |column| (column, row)));
    let values: Vec<Option<f64>> = pixels.map(|(column, row)| distance(column, row)).collect();
    let svg = heat_map(&Map {
        title: "A ball before a wall",
        unit: "m",
        axis_names: ["column", "row"],
        missing: "no event",
        columns: COLUMNS.into(),
        rows: ROWS.into(),
        values: &values,
    })?;
    println!("{svg}");
    assert!(svg.contains("A ball before a wall"));
    Ok(())
}
