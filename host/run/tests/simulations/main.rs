//! Comparisons of methods on simulated photons.
//!
//! With `DTOF_SLOW` there are more rules and levels of light, which takes minutes:
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-run --test simulations
//! ```

mod parts;
mod scenes;

/// Returns `slow` if `DTOF_SLOW` is set, and `quick` in a plain `cargo test`.
fn slow_or_quick<T>(slow: T, quick: T) -> T {
    match std::env::var_os("DTOF_SLOW") {
        Some(_) => slow,
        None => quick,
    }
}
