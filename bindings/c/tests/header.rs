//! The committed header is what cbindgen generates from the sources.

use std::env;
use std::fs;
use std::path::Path;

use cbindgen::{Builder, Config};

/// In the order of the header.
const SOURCES: [&str; 13] = [
    "version",
    "status",
    "config",
    "event",
    "statistics",
    "range",
    "pixel",
    "array",
    "histogram",
    "aer",
    "link",
    "records",
    "histogram_message",
];

fn generated() -> String {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = Config::from_file(here.join("cbindgen.toml")).unwrap();
    let mut builder = Builder::new().with_config(config);
    for source in SOURCES {
        builder = builder.with_src(here.join("src").join(format!("{source}.rs")));
    }
    let mut header = Vec::new();
    builder.generate().unwrap().write(&mut header);
    String::from_utf8(header).unwrap()
}

#[test]
fn the_header_matches_the_sources() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("include/dtof.h");
    let generated = generated();
    if env::var_os("DTOF_BLESS").is_some() {
        fs::write(&path, generated).unwrap();
        return;
    }
    let committed = fs::read_to_string(&path).unwrap();
    assert!(
        committed == generated,
        "include/dtof.h is out of date: `cargo xtask c-bindings --bless` writes it"
    );
}
