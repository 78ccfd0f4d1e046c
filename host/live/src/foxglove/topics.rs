//! The topics.

use std::collections::BTreeMap;

use anyhow::Result;
use dtof_link::Report;
use dtof_link::endpoint::LinkCounters;
use foxglove::messages::{Log, RawImage};
use serde::Serialize;

use dtof_device::monitor::losses;
use dtof_run::export::foxglove::{Channel, Time};

/// A topic that clients can subscribe to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topic {
    /// Points of a slice of time, as in an MCAP file.
    Events,
    /// Statistics of the same slice, as in an MCAP file.
    Statistics,
    /// Counts and losses so far.
    Losses,
    /// Range in metres of the last event of each pixel.
    Range,
    /// Events a second of each pixel.
    Rate,
    /// The relative reflectivity of each pixel.
    Reflectivity,
    /// State of the device or the recording, and errors.
    Log,
}

impl Topic {
    /// All topics in the order of their numbers.
    pub const ALL: [Self; 7] = [
        Self::Events,
        Self::Statistics,
        Self::Losses,
        Self::Range,
        Self::Rate,
        Self::Reflectivity,
        Self::Log,
    ];

    /// Topics with images.
    pub const IMAGES: [Self; 3] = [Self::Range, Self::Rate, Self::Reflectivity];

    /// Its index in [`Self::ALL`].
    pub fn index(self) -> usize {
        self as usize
    }

    /// Its channel number, from 1.
    pub fn id(self) -> u64 {
        self as u64 + 1
    }

    /// The topic of a channel number.
    pub fn from_id(id: u64) -> Option<Self> {
        Self::ALL.into_iter().find(|topic| topic.id() == id)
    }

    /// Its name and the schema of its messages.
    ///
    /// # Errors
    /// Fails if it has no schema.
    pub fn channel(self) -> Result<Channel> {
        match self {
            Self::Events => Channel::events(),
            Self::Statistics => Channel::statistics(),
            Self::Losses => Channel::json("/losses", "Losses", &LossesMessage::empty()),
            Self::Range => Channel::protobuf::<RawImage>("/range"),
            Self::Rate => Channel::protobuf::<RawImage>("/rate"),
            Self::Reflectivity => Channel::protobuf::<RawImage>("/reflectivity"),
            Self::Log => Channel::protobuf::<Log>("/log"),
        }
    }
}

/// A message of `/losses`: counts and losses so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LossesMessage {
    /// Time of the message.
    pub timestamp: Time,
    /// Laser cycles and photons since the settings were applied, and photons a second.
    pub cycles: u64,
    pub photons: u64,
    pub photons_per_s: f64,
    /// Events since the program began, and events of masked pixels.
    pub events: u64,
    pub masked: u64,
    /// Events that were left out of point clouds.
    pub points_left_out: u64,
    /// The last error of the sensor.
    pub last_fault: String,
    /// Each loss of the device by its name.
    #[serde(flatten)]
    pub counts: BTreeMap<String, u64>,
}

impl LossesMessage {
    /// All names, with counts of 0.
    fn empty() -> Self {
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

/// Losses by name, with `_` for spaces.
pub fn named(counts: &[(&'static str, u64)]) -> BTreeMap<String, u64> {
    let named = counts
        .iter()
        .map(|&(name, count)| (name.replace(' ', "_"), count));
    named.collect()
}
