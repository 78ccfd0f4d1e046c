//! The options of dynamic depth, the same for every command.

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use dtof_core::fixed::types::U24F8;
use dtof_data::options::Refused;
use dtof_data::options::numbers::fixed;
use dtof_link::DynamicDepth;

#[derive(Args, Default)]
pub struct DynamicDepthFlags {
    /// Dynamic depth: change of a pixel's mean depth over three events that is reported, in
    /// millimetres, rounded to 1/256 [default: 100]
    #[arg(long, value_name = "MM", value_parser = fixed::<U24F8>, allow_hyphen_values = true)]
    threshold_mm: Option<U24F8>,
    /// Dynamic depth: compare with the mean at the previous event, which finds steps, or with the
    /// last reported mean, which also finds slow motion [default: previous]
    #[arg(long, value_enum)]
    reference: Option<Reference>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Reference {
    Previous,
    Reported,
}

/// Dynamic depth in a report.
#[derive(Args, Default)]
pub struct DynamicDepthOptions {
    /// Show changes of depth in the report, with their direction
    #[arg(long)]
    dynamic_depth: bool,
    #[command(flatten)]
    flags: DynamicDepthFlags,
}

impl DynamicDepthOptions {
    /// Dynamic depth, if it is on.
    ///
    /// # Errors
    /// Fails if its flags are given without it.
    pub fn get(&self) -> Result<Option<DynamicDepth>> {
        self.flags.get_if(self.dynamic_depth)
    }
}

impl DynamicDepthFlags {
    /// Dynamic depth, if it `is_on`.
    ///
    /// # Errors
    /// Fails if a flag is given and it is off.
    pub fn get_if(&self, is_on: bool) -> Result<Option<DynamicDepth>> {
        if let Some(key) = self.first_key().filter(|_| !is_on) {
            bail!(Refused::new(key, "needs `dynamic_depth`"));
        }
        Ok(is_on.then(|| self.dynamic_depth()))
    }

    /// The key of the first flag that was given.
    pub fn first_key(&self) -> Option<&'static str> {
        let threshold = self.threshold_mm.map(|_| "threshold_mm");
        threshold.or(self.reference.map(|_| "reference"))
    }

    pub fn dynamic_depth(&self) -> DynamicDepth {
        let default = DynamicDepth::default();
        DynamicDepth {
            threshold_mm: self.threshold_mm.unwrap_or(default.threshold_mm),
            reference: match self.reference {
                None => default.reference,
                Some(Reference::Previous) => dtof_core::events::Reference::Previous,
                Some(Reference::Reported) => dtof_core::events::Reference::Reported,
            },
        }
    }
}
