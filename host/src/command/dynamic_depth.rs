//! The options of dynamic depth, the same for every command.

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

impl Options {
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
