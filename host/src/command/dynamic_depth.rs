//! The options of dynamic depth, the same for every command.

use clap::{Args, ValueEnum};
use dtof::cli::arguments::fixed;
use dtof_core::fixed::types::U24F8;
use dtof_link::DynamicDepth;

#[derive(Args)]
pub struct Options {
    /// How far the mean depth of three events of a pixel has to move to be reported, in
    /// millimetres, rounded to 1/256 [default: 100]
    #[arg(long, value_name = "MM", value_parser = fixed::<U24F8>, allow_hyphen_values = true)]
    threshold_mm: Option<U24F8>,
    /// From what: the mean at the event before, as in the paper, which sees steps; or the
    /// mean that was reported last, which sees slow motion, too [default: previous]
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
