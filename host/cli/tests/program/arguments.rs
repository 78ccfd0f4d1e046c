//! Options of the command line: how they are read, and the files that they name.

mod kept;
mod mistakes;
mod numbers;
mod settings;
mod tune;
