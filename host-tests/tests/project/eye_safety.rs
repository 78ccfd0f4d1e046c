//! The figures of `docs/eye-safety.md`, computed from the limits on the page and the
//! default laser of the Pico's image.

use dtof_firmware::DEFAULT_LASER;
use dtof_firmware::photon_timer::{BINS, CLOCK_HZ, Config, Settings};

/// Class 1 of IEC 60825-1:2014 for 700 to 1050 nm, C6 = C7 = 1: a pulse of 10 ps to 5 µs, in
/// joules, and the average over 10 s or more, in watts.
const PULSE_J: f64 = 7.7e-8;
const AVERAGE_W: f64 = 3.9e-4;

/// The lowest C5 of pulses shorter than 5 µs.
const C5: f64 = 0.4;

/// The longest pulse in clocks, and the fewest clocks of a laser cycle per clock of its pulse.
const LONGEST: f64 = 125.0;
const CLOCKS_A_CLOCK: f64 = 50.0;

fn page() -> &'static str {
    include_str!("../../../docs/eye-safety.md")
}

/// The numbers in the only row of the page that begins with `label`.
#[track_caller]
fn row(label: &str) -> Vec<f64> {
    let start = format!("| {label} | ");
    let mut rows = page().lines().filter_map(|line| line.strip_prefix(&start));
    let row = rows.next().unwrap_or_else(|| panic!("no row {label}"));
    assert_eq!(rows.next(), None, "{label}");
    let cells = row.trim_end_matches('|').split('|');
    let number = |cell: &str| cell.trim().replace(['*', ',', 'n', 'm'], "").trim().parse();
    cells.map(|cell| number(cell).unwrap()).collect()
}

/// `value` rounded to `digits` decimals; limits are rounded down.
fn down(value: f64, digits: i32) -> f64 {
    let unit = 10f64.powi(digits);
    (value * unit).floor() / unit
}

#[track_caller]
fn says(text: &str) {
    assert!(page().contains(text), "{text}");
}

/// The laser of the Pico's image: seconds of a pulse, pulses a second.
fn as_it_comes() -> (f64, f64) {
    let config = Config::new(DEFAULT_LASER).unwrap();
    let clock = f64::from(CLOCK_HZ);
    let pulse_s = f64::from(config.pulse()) / clock;
    (pulse_s, clock / f64::from(config.period()))
}

#[test]
fn the_example_follows_from_the_limits() {
    says("| limit of a pulse up to 5 µs | 7.7 × 10⁻⁸ J × C4 × C5 |");
    says("| limit of the average over 10 s or more | 3.9 × 10⁻⁴ W × C4 |");
    let (pulse_s, hz) = as_it_comes();
    let setting = format!("{:.0} ns at {:.0} kHz", pulse_s * 1e9, hz / 1e3);
    let wavelengths = row(&setting);
    assert_eq!(wavelengths, [905.0, 940.0]);
    for (column, nm) in wavelengths.into_iter().enumerate() {
        let c4 = 10f64.powf(0.002 * (nm - 700.0));
        let average_w = AVERAGE_W * c4;
        let pulse_j = PULSE_J * c4 * C5;
        let peak_w = pulse_j.min(average_w / hz) / pulse_s;
        let says = |label: &str, value: f64| {
            let shown = row(label)[column];
            assert!(
                (shown - value).abs() < 1e-9,
                "{label}: {shown}, not {value}"
            );
        };
        says("C4 at this wavelength", (c4 * 1e3).round() / 1e3);
        says("limit of the average, mW", down(average_w * 1e3, 2));
        says("the same for each pulse, nJ", down(average_w / hz * 1e9, 1));
        says("limit of a pulse, nJ", down(pulse_j * 1e9, 1));
        let label = "**highest peak power within both, mW**";
        says(label, down(peak_w * 1e3, 0));
        for diode_w in [25.0, 75.0] {
            let label = format!("a diode of {diode_w} W exceeds it, times");
            says(&label, (diode_w / peak_w).round());
        }
    }
}

#[test]
fn the_short_pulses_of_the_sensor_page_follow_from_the_limits() {
    let limits = AVERAGE_W * 10f64.powf(0.002 * 205.0) / 50e3;
    let peak_w = limits.min(PULSE_J * 10f64.powf(0.002 * 205.0) * C5) / 16e-9;
    says(&format!(
        "at 905 nm is {:.2} W; a diode of 75 W exceeds it {:.0} times",
        down(peak_w, 2),
        75.0 / peak_w
    ));
    let config = Config::new(Settings {
        laser_hz: 50_000,
        ..DEFAULT_LASER
    });
    let config = config.unwrap();
    assert_eq!((config.pulse(), config.period()), (2, 2_500));
}

#[test]
fn the_bare_diodes_are_of_the_classes_that_the_page_names() {
    let (pulse_s, hz) = as_it_comes();
    let energy_j = 25.0 * pulse_s;
    let (uj, mw) = (energy_j * 1e6, energy_j * hz * 1e3);
    says(&format!("{uj:.1} µJ a pulse, {mw:.0} mW on average"));
    says(&format!("one of 75 W {:.0} mW", 3.0 * mw));
    // Class 3R ends at 5 times class 1, class 3B at 0.5 W on average.
    assert!(mw > 5.0 * 3.0 * AVERAGE_W * 1e3 && 3.0 * mw < 500.0);
    says("with 104 ns, 75 W are class 4");
    assert!(3.0 * mw * 104e-9 / pulse_s > 500.0);
    says(&format!(
        "duty of 0.1 % only, and this one is {:.2} %",
        pulse_s * hz * 100.0
    ));
}

#[test]
fn c5_is_lowest_from_so_many_pulses_on() {
    let c5 = |pulses: f64| 5.0 * pulses.powf(-0.25);
    assert!(c5(24_414.0) > C5 && c5(24_415.0) < C5);
    says("from 24,415 pulses in 10 s on");
}

#[test]
fn the_highest_rate_of_each_pulse_keeps_the_duty() {
    let rates = row("highest rate, kHz");
    let pulses = row("laser pulse, ns");
    assert_eq!(pulses.len(), rates.len());
    for (ns, khz) in pulses.iter().zip(rates) {
        let clocks = (ns * f64::from(CLOCK_HZ) / 1e9).ceil();
        assert!(clocks <= LONGEST);
        let period = (CLOCKS_A_CLOCK * clocks).max(f64::from(BINS + 8));
        let hz = f64::from(CLOCK_HZ) / period;
        assert!((khz - down(hz / 1e3, 1)).abs() < 1e-9, "{ns} ns: {hz} Hz");
    }
    let limit_us = LONGEST * 1e6 / f64::from(CLOCK_HZ);
    says(&format!("| pulse at GP2 | {limit_us} µs |"));
    says(&format!("| duty | {} % |", 100.0 / CLOCKS_A_CLOCK));
}
