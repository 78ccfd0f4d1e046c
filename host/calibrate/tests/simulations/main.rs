//! Calibrations of simulated recordings against what was simulated.
//!
//! With `DTOF_SLOW` there are more scenes and seeds, which takes minutes:
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-calibrate --test simulations
//! ```

mod drawn;
mod glass;
mod pile_up;
mod robust;
mod scenes;

/// Returns `slow` if `DTOF_SLOW` is set, and `quick` in a plain `cargo test`.
fn slow_or_quick<T>(slow: T, quick: T) -> T {
    match std::env::var_os("DTOF_SLOW") {
        Some(_) => slow,
        None => quick,
    }
}
