//! What there is to subscribe to.

use std::collections::BTreeMap;

use anyhow::Result;
use dtof_link::Report;
use dtof_link::endpoint::LinkCounters;
use foxglove::messages::{Log, RawImage};
use serde::Serialize;

use dtof_device::monitor::losses;
use dtof_export::foxglove::{Channel, Time};

/// A topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topic {
    /// Points of a slice of time, as in an MCAP file.
    Events,
    /// Statistics of the same slice, as in an MCAP file.
    Statistics,
    /// What was counted and lost so far.
    Losses,
    /// Metres to the last event of each pixel.
    Range,
    /// Events a second of each pixel.
    Rate,
    /// The relative reflectivity of each pixel.
    Reflectivity,
    /// What the device or the recording does, and why.
    Log,
}

impl Topic {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 7] = [
        Self::Events,
        Self::Statistics,
        Self::Losses,
        Self::Range,
        Self::Rate,
        Self::Reflectivity,
        Self::Log,
    ];

    /// Those of images.
    pub const IMAGES: [Self; 3] = [Self::Range, Self::Rate, Self::Reflectivity];

    /// Its place among all.
    pub fn index(self) -> usize {
        self as usize
    }

    /// Its number, from 1.
    pub fn id(self) -> u64 {
        self as u64 + 1
    }

    /// The topic of this number.
    pub fn of(id: u64) -> Option<Self> {
        Self::ALL.into_iter().find(|topic| topic.id() == id)
    }

    /// Its name, and what its messages are.
    ///
    /// # Errors
    /// If it has no schema.
    pub fn channel(self) -> Result<Channel> {
        match self {
            Self::Events => Channel::events(),
            Self::Statistics => Channel::statistics(),
            Self::Losses => Channel::json("/losses", "Losses", &Lost::nothing()),
            Self::Range => Channel::of::<RawImage>("/range"),
            Self::Rate => Channel::of::<RawImage>("/rate"),
            Self::Reflectivity => Channel::of::<RawImage>("/reflectivity"),
            Self::Log => Channel::of::<Log>("/log"),
        }
    }
}

/// What was counted and lost so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Lost {
    /// When.
    pub timestamp: Time,
    /// Laser cycles, and photons, since the settings are in force; photons a second.
    pub cycles: u64,
    pub photons: u64,
    pub photons_per_s: f64,
    /// Events since the program began, and of masked pixels beside them.
    pub events: u64,
    pub masked: u64,
    /// Of these, while somebody was sent points: events that are no point of a message.
    pub points_left_out: u64,
    /// The last error of the sensor.
    pub last_fault: String,
    /// Each loss that the device counts, by its name.
    #[serde(flatten)]
    pub counts: BTreeMap<String, u64>,
}

impl Lost {
    /// Nothing, with all names.
    fn nothing() -> Self {
        let report = Report::default();
        let losses = losses::Losses {
            first: &report,
            here: &LinkCounters::default(),
        };
        Self {
            counts: named(&losses.counts(&report)),
            ..Self::default()
        }
    }
}

/// Losses by names without spaces.
pub fn named(counts: &[(&'static str, u64)]) -> BTreeMap<String, u64> {
    let named = counts
        .iter()
        .map(|&(name, count)| (name.replace(' ', "_"), count));
    named.collect()
}
