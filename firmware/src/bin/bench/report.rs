//! The lines the image writes.

use semihosting::println;

/// Writes one line an operation: name, variant, what all of its runs took
/// together, and how many they are.
pub struct Report;

impl Report {
    /// Nothing is written for an operation that did not run.
    pub fn line(&mut self, operation: &str, variant: &str, total: u32, runs: u32) {
        println!("{operation},{variant},{total},{runs}");
    }
}
