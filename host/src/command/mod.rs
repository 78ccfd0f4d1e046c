//! One file a command.

pub mod decode;
pub mod demo;
pub mod monitor;
mod operation;
pub mod replay;

use std::path::Path;

use dtof::summary::{Row, aligned};

/// What a run came to, on the terminal.
fn print_summary(rows: &[Row], folder: &Path) {
    print!("{}", aligned(rows));
    println!(
        "\nOpen {} in a browser.",
        folder.join("report.html").display()
    );
}
