//! The options of dynamic depth, the same for every command.

use anyhow::{Result, ensure};
use clap::{Args, ValueEnum};
use dtof::cli::arguments::fixed;
use dtof_core::fixed::types::U24F8;
use dtof_link::DynamicDepth;

#[derive(Args)]
pub struct Options {
    /// Report when the mean depth of three events of a pixel moves by so many millimetres,
    /// rounded to 1/256 [default: 100]
    #[arg(long, value_name = "MM", value_parser = fixed::<U24F8>, allow_hyphen_values = true)]
    threshold_mm: Option<U24F8>,
    /// Compare with the mean at the previous event, as in the paper, which finds steps; or with
    /// the last reported mean, which also finds slow motion [default: previous]
    #[arg(long, value_enum)]
    reference: Option<Reference>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Reference {
    Previous,
    Reported,
}

/// Dynamic depth in a report.
#[derive(Args)]
pub struct Shown {
    /// Show in the report when the depth of pixels changes, and to which side
    #[arg(long)]
    dynamic_depth: bool,
    #[command(flatten)]
    options: Options,
}

impl Shown {
    /// If it is asked for.
    ///
    /// # Errors
    /// Options without it.
    pub fn wanted(&self) -> Result<Option<DynamicDepth>> {
        self.options.wanted(self.dynamic_depth)
    }
}

impl Options {
    /// If it is asked for.
    ///
    /// # Errors
    /// Options without it.
    pub fn wanted(&self, is_asked: bool) -> Result<Option<DynamicDepth>> {
        ensure!(
            is_asked || !self.are_given(),
            "--threshold-mm and --reference are of --dynamic-depth"
        );
        Ok(is_asked.then(|| self.dynamic_depth()))
    }

    /// Whether any was given.
    pub fn are_given(&self) -> bool {
        self.threshold_mm.is_some() || self.reference.is_some()
    }

    pub fn dynamic_depth(&self) -> DynamicDepth {
        let default = DynamicDepth::default();
        DynamicDepth {
            threshold_mm: self.threshold_mm.unwrap_or(default.threshold_mm),
            reference: match self.reference {
                None => default.reference,
                Some(Reference::Previous) => dtof_core::Reference::Previous,
                Some(Reference::Reported) => dtof_core::Reference::Reported,
            },
        }
    }
}
