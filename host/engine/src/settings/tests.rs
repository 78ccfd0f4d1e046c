//! What settings are, for what a file says.

mod document;
mod engine;
mod merged;
mod read;
mod resolved;
mod rows;

use dtof_core::{Count, WindowRule};

use super::file::{SECTIONS, key_of};
use super::{Settings, SettingsFile};
use dtof_data::options::keys::Key;

/// Every setting of pixels that decide alone with the window rule.
const ALL: &str = "bin_width_ps = 92.1; offset_mm = -179.5; offsets_mm = [1.5, -78.04, 0.0]; gate = [12, 119];
    masked = [3, 70]; sigma_bins = 1.3; dead_time = 20; dither_bins = 64; dither_seed = 9;
    rule = 'window'; window = 3; z = 4.5; estimator = 'window'; half_widths = [1.75, 4.0]; min_count = 6;
    l1 = 8; l2 = 1500; x = 2; tracking = true; echoes = 3; echo_wait = 5; once_per_bin = true;
    counter_bits = 8; seed = 7";

/// The window rule of 3 bins with z = 4.5.
fn window_rule(minimum: u32) -> WindowRule {
    WindowRule::new(3, "4.5".parse().unwrap(), Count::saturating(minimum)).unwrap()
}

/// The text of a file with keys of any section, as "window = 3; bins = 64".
fn toml(keys: &str) -> String {
    let lines = || {
        keys.split(';')
            .map(str::trim)
            .filter(|line| !line.is_empty())
    };
    let key = |line: &str| line.split_once(" =").unwrap().0.to_owned();
    let section = |(section, known): &(&str, &[Key])| {
        let own = lines().filter(|line| known.iter().any(|known| known.name == key(line)));
        format!("[{section}]\n{}\n", own.collect::<Vec<_>>().join("\n"))
    };
    let text: Vec<String> = SECTIONS.iter().map(section).collect();
    assert!(lines().all(|line| text.concat().contains(line)), "{keys}");
    text.concat()
}

fn file(keys: &str) -> SettingsFile {
    SettingsFile::parse(&toml(keys)).unwrap_or_else(|error| panic!("{keys}: {error}"))
}

/// The settings of a file for histograms of 128 bins.
#[track_caller]
fn settings(keys: &str) -> Settings {
    let settings = file(keys).settings(128);
    settings.unwrap_or_else(|error| panic!("{keys}: {error}"))
}

/// The cells of a table, one row a line: `cell | cell`.
fn table<const CELLS: usize>(rows: &str) -> impl Iterator<Item = [&str; CELLS]> {
    let rows = rows.lines().filter(|row| !row.trim().is_empty());
    rows.map(|row| {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        cells.try_into().expect(row)
    })
}
