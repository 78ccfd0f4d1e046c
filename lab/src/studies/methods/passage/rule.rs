//! Detection rules, and their names.

use anyhow::{Result, bail};
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{AnyRule, AverageRule, Count, PaperRule, WindowRule};
use dtof_draw::palette::{self, Pen};

/// A detection rule, or the likelihood ratio as a reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rule {
    /// The paper's rule; its threshold is α.
    Paper,
    /// The same with the average of all bins as background; its threshold is α.
    Average,
    /// The core's window rule with this many bins; its threshold is z.
    Window(u8),
    /// The generalised likelihood ratio test for a known scene; its threshold is in nats.
    Oracle,
}

impl Rule {
    /// The rules that a pixel can run.
    pub const RULES: [Self; 7] = [
        Self::Paper,
        Self::Average,
        Self::Window(1),
        Self::Window(2),
        Self::Window(3),
        Self::Window(5),
        Self::Window(7),
    ];

    /// The core's rule with this threshold and minimum count.
    ///
    /// # Errors
    /// Fails if the threshold is out of range, or for [`Self::Oracle`].
    pub fn with_threshold(self, threshold: f64, minimum: u32) -> Result<AnyRule> {
        let minimum = Count::saturating(minimum);
        Ok(match self {
            Self::Paper => PaperRule::new(U8F8::saturating_from_num(threshold), minimum).into(),
            Self::Average => AverageRule::new(U8F8::saturating_from_num(threshold), minimum).into(),
            Self::Window(width) => {
                WindowRule::new(width, U4F12::saturating_from_num(threshold), minimum)?.into()
            }
            Self::Oracle => bail!("no pixel knows the scene"),
        })
    }

    /// Its name in tallies and tables.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Paper => "paper".to_owned(),
            Self::Average => "average".to_owned(),
            Self::Window(width) => format!("w{width}"),
            Self::Oracle => "oracle".to_owned(),
        }
    }

    /// Its pen in a chart.
    #[must_use]
    pub const fn pen(self) -> Pen {
        match self {
            Self::Paper => palette::PAPER,
            Self::Average => palette::AVERAGE,
            Self::Window(width) => palette::window(width),
            Self::Oracle => palette::REFERENCE,
        }
    }

    /// Its short name; that of a window is its width.
    #[must_use]
    pub fn short(self) -> String {
        match self {
            Self::Paper => "paper's".to_owned(),
            Self::Average => "average".to_owned(),
            Self::Window(1) => "1 bin".to_owned(),
            Self::Window(width) => format!("{width} bins"),
            Self::Oracle => self.label(),
        }
    }

    /// Its name in a text.
    #[must_use]
    pub fn label(self) -> String {
        match self {
            Self::Paper => "the paper's rule".to_owned(),
            Self::Average => "average of all bins".to_owned(),
            Self::Window(_) => format!("window of {}", self.short()),
            Self::Oracle => "likelihood ratio".to_owned(),
        }
    }
}
