//! The lines the image writes.

use semihosting::println;

/// Writes one line an operation: name, variant, what all of its runs took
/// together, and how many they are.
pub fn line(operation: &str, variant: &str, total: u32, runs: u32) {
    println!("{operation},{variant},{total},{runs}");
}
