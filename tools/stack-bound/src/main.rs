//! `stack-bound FILE...`: bytes of stack each image can need, one line each.

use std::env;
use std::path::PathBuf;
use std::process::ExitCode;

fn main() -> ExitCode {
    let files: Vec<PathBuf> = env::args_os().skip(1).map(PathBuf::from).collect();
    if files.is_empty() {
        eprintln!("usage: stack-bound FILE...");
        return ExitCode::FAILURE;
    }
    for file in files {
        match stack_bound::of_image(&file) {
            Ok(bytes) => println!("{bytes:>8} {}", file.display()),
            Err(error) => {
                eprintln!("error: {}: {error:#}", file.display());
                return ExitCode::FAILURE;
            }
        }
    }
    ExitCode::SUCCESS
}
