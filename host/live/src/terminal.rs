//! What is told to who started the program.

/// The terminal of the program that serves the page.
#[derive(Clone, Copy)]
pub struct Terminal {
    /// Writes a line on standard error.
    pub complain: fn(&str),
    /// What an option is called there, by its key.
    pub name: fn(&str) -> String,
}
