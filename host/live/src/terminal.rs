//! The terminal of the program that serves the page.

/// Prints lines, and names options, on the terminal.
#[derive(Clone, Copy)]
pub struct Terminal {
    /// Writes a line on standard error.
    pub complain: fn(&str),
    /// Gives the name of an option from its key, such as its flag.
    pub name: fn(&str) -> String,
}
