//! Frames: what all clients together want of what has changed since the last one.
//!
//! Times are those of laser cycles, as in an MCAP file.

mod images;
mod log;
mod timing;

use anyhow::Result;
use dtof_core::RangeScale;

use super::topics::{Lost, Topic, named};
use crate::hub::{Hub, Seen, Wanted};
use dtof_events::aer_file::{Event, EventKind};
use dtof_export::Optics;
use dtof_export::foxglove::{Time, cloud};
use dtof_export::points::record;
use dtof_export::projection::Projection;
use images::Images;
use log::Told;
use timing::Timing;

/// A message of a topic.
pub struct Message {
    pub topic: Topic,
    /// Nanoseconds.
    pub time: u64,
    pub data: Vec<u8>,
}

/// What there is to send.
pub struct Frame {
    /// Changes when time begins again.
    pub session: u64,
    /// The device or the recording.
    pub name: String,
    pub messages: Vec<Message>,
}

/// Makes frames.
pub struct Frames {
    /// Of the array and the settings that follow is made from.
    version: Option<u64>,
    /// None of an array that has no rays.
    projection: Option<Projection>,
    timing: Timing,
    /// Where the next slice begins.
    slice: Option<u64>,
    images: Images,
    lost: Lost,
    left_out: u64,
    told: Told,
}

impl Frames {
    /// Nothing is known yet.
    pub fn new() -> Self {
        Self {
            version: None,
            projection: None,
            timing: Timing::unknown(),
            slice: None,
            images: Images::default(),
            lost: Lost::default(),
            left_out: 0,
            told: Told::default(),
        }
    }

    /// The next, of what is `wanted`; also of what has not changed if somebody is new.
    pub fn next(&mut self, hub: &Hub, wanted: &dyn Fn(Topic) -> bool, is_new: bool) -> Frame {
        let images = Topic::IMAGES.map(wanted);
        let events = wanted(Topic::Events) || wanted(Topic::Statistics);
        let seen = hub.seen(Wanted {
            events,
            pixels: images.contains(&true).then_some(self.images.change()),
        });
        if self.version != Some(seen.version) {
            self.begin(&seen);
        }
        if !events {
            self.slice = None;
        }
        self.left_out += seen.left_out;
        self.timing.advance(&seen);
        let mut messages = Vec::new();
        // All can be encoded: they go into memory.
        let _ = self.slice(&seen, wanted, &mut messages);
        let _ = self.images(&seen, wanted, is_new, &mut messages);
        if wanted(Topic::Losses) {
            let _ = self.losses(&seen, is_new, &mut messages);
        }
        if wanted(Topic::Log) {
            let _ = self
                .told
                .tell(&seen, self.timing.now(), is_new, &mut messages);
        }
        Frame {
            session: seen.version,
            name: seen.name,
            messages,
        }
    }

    /// Array and settings are others, and laser cycles begin at 0.
    fn begin(&mut self, seen: &Seen) {
        self.version = Some(seen.version);
        let header = seen.header.as_ref();
        self.timing = header.map_or_else(Timing::unknown, Timing::of);
        self.slice = None;
        let array = header.map(|header| header.array);
        self.images = Images::of(array);
        let rays = Optics::of(&seen.rays);
        let rays = rays.and_then(|optics| array.map(|array| optics.rays(array)).transpose());
        let projection = |scale: RangeScale| {
            let (rays, _) = rays.as_ref().ok()?.as_ref()?;
            Some(Projection {
                rays: rays.clone(),
                scale,
                clock: self.timing.clock(),
            })
        };
        self.projection = seen.scale.and_then(projection);
        self.told.no_points = rays.err().map(|error| format!("no points: {error:#}"));
    }

    /// The points of what has arrived, and the counts of it.
    fn slice(
        &mut self,
        seen: &Seen,
        wanted: &dyn Fn(Topic) -> bool,
        messages: &mut Vec<Message>,
    ) -> Result<()> {
        let timed = seen.events.iter().filter_map(|event| {
            let cycle = event.cycle().0;
            Some((self.timing.of_cycle(cycle)?, *event))
        });
        let mut timed: Vec<(u64, Event)> = timed.collect();
        self.left_out += (seen.events.len() - timed.len()) as u64;
        timed.sort_by_key(|(time, _)| *time);
        let (Some((first, _)), Some((last, _))) = (timed.first(), timed.last()) else {
            return Ok(());
        };
        let begin = self.slice.unwrap_or(*first);
        let end = self.timing.end(*last).max(begin);
        self.slice = Some(end);
        if wanted(Topic::Events) {
            self.clouds(begin, &timed, messages)?;
        }
        if wanted(Topic::Statistics) {
            let statistics = seen.statistics.clone();
            let statistics = statistics.over(begin, end - begin, seen.arrived);
            messages.push(Message {
                topic: Topic::Statistics,
                time: begin,
                data: serde_json::to_vec(&statistics)?,
            });
        }
        Ok(())
    }

    /// The points of events, a message for each kind of them.
    fn clouds(
        &mut self,
        begin: u64,
        timed: &[(u64, Event)],
        messages: &mut Vec<Message>,
    ) -> Result<()> {
        // Of two of one time viewers show the last.
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
        seen: &Seen,
        wanted: &dyn Fn(Topic) -> bool,
        is_new: bool,
        messages: &mut Vec<Message>,
    ) -> Result<()> {
        let is_wanted = Topic::IMAGES.map(wanted).contains(&true);
        let is_changed = self.images.take(seen.pixels.as_ref(), is_wanted);
        let now = self.timing.now();
        for (topic, is_due) in [
            (Topic::Range, is_changed || is_new),
            (Topic::Reflectivity, is_changed || is_new),
            (Topic::Rate, self.images.has_new_rates()),
        ] {
            if wanted(topic)
                && is_due
                && let Some(data) = self.images.message(topic, now)?
            {
                let time = now;
                messages.push(Message { topic, time, data });
            }
        }
        Ok(())
    }

    fn losses(&mut self, seen: &Seen, is_new: bool, messages: &mut Vec<Message>) -> Result<()> {
        let losses = &seen.losses;
        let lost = Lost {
            timestamp: self.lost.timestamp,
            cycles: losses.cycles,
            photons: losses.photons,
            photons_per_s: losses.photon_rate,
            events: seen.arrived,
            masked: seen.masked,
            points_left_out: self.left_out,
            last_fault: losses.last_fault.clone().unwrap_or_default(),
            counts: named(&losses.counts),
        };
        if lost == self.lost && !is_new {
            return Ok(());
        }
        let time = self.timing.now();
        let timestamp = Time::of(time);
        self.lost = Lost { timestamp, ..lost };
        messages.push(Message {
            topic: Topic::Losses,
            time,
            data: serde_json::to_vec(&self.lost)?,
        });
        Ok(())
    }
}
