//! Simulations and recordings from end to end, against the float reference, theory and truth.
//!
//! Some draw more scenes, exposures or seeds if `DTOF_SLOW` is set, which takes minutes:
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test simulations
//! ```

mod calibrate_glass;
mod calibrate_pile_up;
mod calibrate_recorded;
mod calibrate_scenes;
mod calibration;
mod capture_log;
mod compare;
mod compare_scenes;
mod depth_map;
mod engine;
mod pipeline;
mod recorded;
mod recorded_echoes;
mod recorded_warnings;
mod theory_exposures;

/// `all` of what a test simulates if `DTOF_SLOW` is set, `few` in a plain `cargo test`.
fn long_or<T>(all: T, few: T) -> T {
    match std::env::var_os("DTOF_SLOW") {
        Some(_) => all,
        None => few,
    }
}
