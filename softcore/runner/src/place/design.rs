//! What is placed: the Verilog of each design, and what it is of.

use std::fs;

use anyhow::{Context, Result, ensure};

use crate::root;

/// Macropixels of the pixel processor.
pub const SIZES: [u32; 3] = [4, 16, 64];

/// Bins that the comparator tree reads a clock.
pub const LANES: [u32; 2] = [8, 1];

/// The folder of the pixel processor.
const PIXELS: &str = "softcore/rtl/pixels";

/// A kind of design.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The pixel processor of so many macropixels.
    Pixels(u32),
    /// `VexRiscv` with its RAM.
    Processor,
    /// Everything, with so many macropixels.
    System(u32),
    /// The paper's comparator tree, with so many lanes.
    Tree(u32),
}

impl Kind {
    /// All, or those of one size and those without a size.
    pub fn all(size: Option<u32>) -> Vec<Self> {
        let mut all = SIZES.map(Self::Pixels).to_vec();
        all.push(Self::Processor);
        all.extend(SIZES.map(Self::System));
        all.extend(LANES.map(Self::Tree));
        let is_of = |of: u32| of == 0 || size.is_none_or(|size| of == size);
        all.retain(|kind| is_of(kind.macropixels()));
        all
    }

    /// Its name in the figures.
    pub fn name(self) -> String {
        match self {
            Self::Pixels(_) => "pixel processor".to_owned(),
            Self::Processor => "VexRiscv with RAM".to_owned(),
            Self::System(_) => "whole system".to_owned(),
            Self::Tree(1) => "comparator tree; one bin a clock".to_owned(),
            Self::Tree(lanes) => format!("comparator tree; {lanes} bins a clock"),
        }
    }

    /// How many macropixels, 0 if it has none.
    pub fn macropixels(self) -> u32 {
        match self {
            Self::Pixels(size) | Self::System(size) => size,
            Self::Processor | Self::Tree(_) => 0,
        }
    }

    /// The folder it is built in.
    pub fn folder(self) -> String {
        match self {
            Self::Pixels(size) => format!("pixels-{size}"),
            Self::Processor => "processor".to_owned(),
            Self::System(size) => format!("system-{size}"),
            Self::Tree(lanes) => format!("tree-{lanes}"),
        }
    }

    /// Its module, and a parameter with its value.
    pub fn top(self) -> (&'static str, Option<(&'static str, u32)>) {
        match self {
            Self::Pixels(size) => ("place_pixels", Some(("PIXELS_LOG2", size.ilog2()))),
            Self::Processor => ("place_processor", None),
            Self::System(size) => ("place_system", Some(("PIXELS_LOG2", size.ilog2()))),
            Self::Tree(lanes) => ("place_tree", Some(("LANES", lanes))),
        }
    }

    /// Whether its ports are the pins of a board. The others have too many: their ports end
    /// at registers.
    pub fn has_pins(self) -> bool {
        matches!(self, Self::System(_))
    }

    /// Whether `VexRiscv` is in it, whose file is no part of the workspace.
    pub fn has_processor(self) -> bool {
        matches!(self, Self::Processor | Self::System(_))
    }

    /// Its Verilog of the workspace.
    pub fn sources(self) -> Result<Vec<String>> {
        let (top, _) = self.top();
        let own: &[&str] = match self {
            Self::Pixels(_) => &[],
            Self::Processor => &["processor_vexriscv", "computer"],
            Self::System(_) => &["processor_vexriscv", "computer", "aer_port", "system"],
            Self::Tree(_) => &["comparator_tree"],
        };
        let own = own.iter().map(|name| format!("softcore/rtl/{name}.v"));
        let mut sources: Vec<String> = own.collect();
        if self.macropixels() != 0 {
            sources.extend(verilog_in(PIXELS)?);
        }
        sources.push(format!("softcore/rtl/place/{top}.v"));
        Ok(sources)
    }
}

/// All Verilog of a folder, by name.
fn verilog_in(folder: &str) -> Result<Vec<String>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(root().join(folder)).context(folder.to_owned())? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        if name.ends_with(".v") {
            found.push(format!("{folder}/{name}"));
        }
    }
    ensure!(!found.is_empty(), "{folder}: no Verilog");
    found.sort();
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_leaves_out_the_others() {
        assert_eq!(Kind::all(None).len(), 9);
        let names: Vec<String> = Kind::all(Some(16))
            .iter()
            .map(|kind| kind.folder())
            .collect();
        assert_eq!(
            names,
            ["pixels-16", "processor", "system-16", "tree-8", "tree-1"]
        );
    }

    #[test]
    fn a_design_has_its_own_files_and_a_folder_without_any_is_told() {
        for kind in [Kind::Processor, Kind::Tree(8)] {
            for source in kind.sources().unwrap() {
                assert!(root().join(&source).is_file(), "{source}");
            }
        }
        let places = verilog_in("softcore/rtl/place").unwrap();
        assert!(places.is_sorted() && places.len() == 4);
        assert!(verilog_in("softcore/src").is_err());
        assert!(verilog_in("softcore/rtl/none").is_err());
    }
}
