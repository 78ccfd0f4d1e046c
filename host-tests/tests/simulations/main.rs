//! Simulations and recordings from end to end, against the float reference, theory and truth.
//!
//! With `DTOF_SLOW` some draw more scenes, exposures or seeds, which takes minutes:
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test simulations
//! ```

mod calibrate_recorded;
mod capture_log;
mod counters;
mod dead_time;
mod decide_once;
mod depth_map;
mod engine;
mod motion;
mod pipeline;
mod recorded;
mod recorded_echoes;
mod recorded_warnings;
mod theory_exposures;

/// Returns `slow` if `DTOF_SLOW` is set, and `quick` in a plain `cargo test`.
fn slow_or_quick<T>(slow: T, quick: T) -> T {
    match std::env::var_os("DTOF_SLOW") {
        Some(_) => slow,
        None => quick,
    }
}
