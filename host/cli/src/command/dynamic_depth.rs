//! The options of dynamic depth, the same for every command.

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use dtof_core::fixed::types::U24F8;
use dtof_link::DynamicDepth;
use dtof_options::Refused;
use dtof_options::numbers::fixed;

#[derive(Args)]
pub struct DynamicDepthFlags {
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
    options: DynamicDepthFlags,
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

impl DynamicDepthFlags {
    /// If it is asked for.
    ///
    /// # Errors
    /// Options without it.
    pub fn wanted(&self, is_asked: bool) -> Result<Option<DynamicDepth>> {
        if let Some(key) = self.given().filter(|_| !is_asked) {
            bail!(Refused::new(key, "is of `dynamic_depth`"));
        }
        Ok(is_asked.then(|| self.dynamic_depth()))
    }

    /// The first that was given.
    pub fn given(&self) -> Option<&'static str> {
        let threshold = self.threshold_mm.map(|_| "threshold_mm");
        threshold.or(self.reference.map(|_| "reference"))
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
