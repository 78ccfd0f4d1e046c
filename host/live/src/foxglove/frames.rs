//! Frames: the messages of all subscribed topics since the last frame.
//!
//! Messages carry the time of laser cycles, as in an MCAP file.

mod images;
mod log;
mod timing;

use anyhow::Result;

use super::topics::{LossesMessage, Topic, named};
use crate::hub::{Hub, Snapshot};
use dtof_data::events::aer_file::{Event, EventKind};
use dtof_data::photons::ranges::Ranges;
use dtof_run::export::foxglove::{Time, cloud};
use dtof_run::export::points::record;
use dtof_run::export::projection::Projection;
use images::Images;
use log::StatusLog;
use timing::Timing;

/// A message of a topic.
pub struct Message {
    pub topic: Topic,
    /// Time in nanoseconds.
    pub time: u64,
    pub data: Vec<u8>,
}

/// The messages of a tenth of a second.
pub struct Frame {
    /// Changes when time begins again.
    pub session: u64,
    /// Name of the device or the recording.
    pub name: String,
    pub messages: Vec<Message>,
}

/// Makes frames.
#[derive(Default)]
pub struct Frames {
    /// Version of array and settings.
    version: Option<u64>,
    /// `None` if the array has no rays.
    projection: Option<Projection>,
    timing: Timing,
    /// Start of the next slice in nanoseconds.
    slice: Option<u64>,
    images: Images,
    losses: LossesMessage,
    left_out: u64,
    log: StatusLog,
}

impl Frames {
    /// The next frame. With `resend` it also has values that have not changed.
    pub fn next(
        &mut self,
        hub: &Hub,
        is_subscribed: &dyn Fn(Topic) -> bool,
        resend: bool,
    ) -> Frame {
        let images = Topic::IMAGES.map(is_subscribed);
        let events = is_subscribed(Topic::Events) || is_subscribed(Topic::Statistics);
        let known_change = images.contains(&true).then_some(self.images.change());
        let snapshot = hub.snapshot(events, known_change);
        if self.version != Some(snapshot.version) {
            self.begin(&snapshot);
        }
        if !events {
            self.slice = None;
        }
        self.left_out += snapshot.dropped;
        self.timing.advance(&snapshot);
        let mut messages = Vec::new();
        // Encoding into memory does not fail.
        let _ = self.slice(&snapshot, is_subscribed, &mut messages);
        let _ = self.images(&snapshot, is_subscribed, resend, &mut messages);
        if is_subscribed(Topic::Losses) {
            let _ = self.losses(&snapshot, resend, &mut messages);
        }
        if is_subscribed(Topic::Log) {
            let now = self.timing.now();
            let _ = self.log.write(&snapshot, now, resend, &mut messages);
        }
        Frame {
            session: snapshot.version,
            name: snapshot.name,
            messages,
        }
    }

    /// Begins with another array and other settings, at laser cycle 0.
    fn begin(&mut self, snapshot: &Snapshot) {
        self.version = Some(snapshot.version);
        let header = snapshot.header.as_ref();
        self.timing = header.map_or_else(Timing::default, Timing::of);
        self.slice = None;
        let array = header.map(|header| header.array);
        self.images = Images::of(array);
        let rays = array.map(|array| snapshot.rays.rays(array)).transpose();
        let projection = |ranges: &Ranges| {
            let (rays, _) = rays.as_ref().ok()?.as_ref()?;
            Some(Projection {
                rays: rays.clone(),
                ranges: ranges.clone(),
                clock: self.timing.clock(),
                depths_mm: Vec::new(),
            })
        };
        self.projection = snapshot.ranges.as_ref().and_then(projection);
        self.log.no_points = rays.err().map(|error| format!("no points: {error:#}"));
    }

    /// Points and counts of the events that have arrived.
    fn slice(
        &mut self,
        snapshot: &Snapshot,
        is_subscribed: &dyn Fn(Topic) -> bool,
        messages: &mut Vec<Message>,
    ) -> Result<()> {
        let timed = snapshot.events.iter().filter_map(|event| {
            let cycle = event.cycle().raw();
            Some((self.timing.of_cycle(cycle)?, *event))
        });
        let mut timed: Vec<(u64, Event)> = timed.collect();
        self.left_out += (snapshot.events.len() - timed.len()) as u64;
        timed.sort_by_key(|(time, _)| *time);
        let (Some((first, _)), Some((last, _))) = (timed.first(), timed.last()) else {
            return Ok(());
        };
        let begin = self.slice.unwrap_or(*first);
        let end = self.timing.end(*last).max(begin);
        self.slice = Some(end);
        if is_subscribed(Topic::Events) {
            self.clouds(begin, &timed, messages)?;
        }
        if is_subscribed(Topic::Statistics) {
            let statistics = snapshot.statistics.clone();
            let statistics = statistics.over(begin, end - begin, snapshot.arrived);
            messages.push(Message {
                topic: Topic::Statistics,
                time: begin,
                data: serde_json::to_vec(&statistics)?,
            });
        }
        Ok(())
    }

    /// Points of events, a message for each kind.
    fn clouds(
        &mut self,
        begin: u64,
        timed: &[(u64, Event)],
        messages: &mut Vec<Message>,
    ) -> Result<()> {
        // Viewers show only the last of two messages of the same time.
        for (kind, time) in [
            (EventKind::Depth, begin),
            (EventKind::DynamicDepth, begin + 1),
        ] {
            let mut records = Vec::new();
            for (_, event) in timed.iter().filter(|(_, event)| event.kind() == kind) {
                let projection = self.projection.as_ref();
                match projection.and_then(|projection| record(event, projection).ok()) {
                    Some(record) => records.extend(record),
                    None => self.left_out += 1,
                }
            }
            if !records.is_empty() {
                messages.push(Message {
                    topic: Topic::Events,
                    time,
                    data: cloud(kind, time, records)?,
                });
            }
        }
        Ok(())
    }

    fn images(
        &mut self,
        snapshot: &Snapshot,
        is_subscribed: &dyn Fn(Topic) -> bool,
        resend: bool,
        messages: &mut Vec<Message>,
    ) -> Result<()> {
        let has_subscriber = Topic::IMAGES.map(is_subscribed).contains(&true);
        let is_changed = self.images.update(snapshot.pixels.as_ref(), has_subscriber);
        let now = self.timing.now();
        for (topic, is_due) in [
            (Topic::Range, is_changed || resend),
            (Topic::Reflectivity, is_changed || resend),
            (Topic::Rate, self.images.has_new_rates()),
        ] {
            if is_subscribed(topic)
                && is_due
                && let Some(data) = self.images.message(topic, now)?
            {
                let time = now;
                messages.push(Message { topic, time, data });
            }
        }
        Ok(())
    }

    fn losses(
        &mut self,
        snapshot: &Snapshot,
        resend: bool,
        messages: &mut Vec<Message>,
    ) -> Result<()> {
        let losses = &snapshot.losses;
        let message = LossesMessage {
            timestamp: self.losses.timestamp,
            cycles: losses.cycles,
            photons: losses.photons,
            photons_per_s: losses.photon_rate,
            events: snapshot.arrived,
            masked: snapshot.masked,
            points_left_out: self.left_out,
            last_fault: losses.last_fault.clone().unwrap_or_default(),
            counts: named(&losses.counts),
        };
        if message == self.losses && !resend {
            return Ok(());
        }
        let time = self.timing.now();
        let timestamp = Time::from_nanoseconds(time);
        self.losses = LossesMessage {
            timestamp,
            ..message
        };
        messages.push(Message {
            topic: Topic::Losses,
            time,
            data: serde_json::to_vec(&self.losses)?,
        });
        Ok(())
    }
}
