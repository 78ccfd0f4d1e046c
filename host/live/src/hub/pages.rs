//! The open pages, and the events that wait for each.

use std::collections::VecDeque;

use dtof_core::{Array, PixelAddress};

use dtof_data::events::aer_file::Event;

/// Most pages that are open at a time.
pub const MOST_PAGES: usize = 16;

/// Most events of a pixel in a frame: the newest.
pub const MOST_EVENTS: usize = 256;

/// What a page has been sent.
#[derive(Debug, Default)]
pub struct Page {
    /// Its number.
    pub number: u64,
    /// Number of the last change of each pixel that it was sent.
    pub(super) pixels: Vec<u64>,
    /// The pixel at which the search for changes goes on.
    pub(super) next: usize,
    pub(super) version: u64,
    pub(super) histogram: u64,
    pub(super) frames: u64,
    /// Events up to its last frame.
    pub(super) arrived: u64,
}

/// An event of the pixel that a page shows.
#[derive(Clone, Copy, Debug)]
pub struct Waiting {
    pub event: Event,
    pub range_mm: f32,
}

#[derive(Debug)]
struct Open {
    number: u64,
    pixel: u16,
    /// The newest events, at most [`MOST_EVENTS`].
    events: VecDeque<Waiting>,
    /// Events since the last frame.
    arrived: u64,
}

/// All pages.
#[derive(Debug, Default)]
pub struct Pages {
    open: Vec<Open>,
    opened: u64,
}

impl Pages {
    pub fn join(&mut self, pixel: u16) -> Option<Page> {
        if self.open.len() >= MOST_PAGES {
            return None;
        }
        self.opened += 1;
        self.open.push(Open {
            number: self.opened,
            pixel,
            events: VecDeque::new(),
            arrived: 0,
        });
        Some(Page {
            number: self.opened,
            ..Page::default()
        })
    }

    pub fn watch(&mut self, number: u64, pixel: u16) -> bool {
        let page = self.open.iter_mut().find(|page| page.number == number);
        page.is_some_and(|page| {
            if page.pixel != pixel {
                page.pixel = pixel;
                page.events.clear();
                page.arrived = 0;
            }
            true
        })
    }

    /// Drops the events that wait, as laser cycles begin at 0 again.
    pub fn restart(&mut self) {
        for page in &mut self.open {
            page.events.clear();
            page.arrived = 0;
        }
    }

    pub fn leave(&mut self, page: &Page) {
        self.open.retain(|open| open.number != page.number);
    }

    /// The pixels that pages show, each once.
    pub fn watched(&self) -> Vec<u16> {
        let mut pixels: Vec<u16> = self.open.iter().map(|page| page.pixel).collect();
        pixels.sort_unstable();
        pixels.dedup();
        pixels
    }

    pub fn len(&self) -> usize {
        self.open.len()
    }

    /// Number of events that wait.
    pub fn waiting(&self) -> usize {
        self.open.iter().map(|page| page.events.len()).sum()
    }

    /// Adds an event for the pages that show its pixel, or a pixel of its block.
    pub fn add(&mut self, event: &Event, range_mm: f32, array: Array) {
        for page in &mut self.open {
            let pixel = PixelAddress::new(page.pixel);
            let is_shown = event.pixel() == pixel
                || event.level().raw() > 0
                    && array
                        .pixels_of(event.pixel(), event.level())
                        .any(|other| other == pixel);
            if !is_shown {
                continue;
            }
            page.arrived += 1;
            if page.events.len() == MOST_EVENTS {
                page.events.pop_front();
            }
            let event = *event;
            page.events.push_back(Waiting { event, range_mm });
        }
    }

    /// The pixel of a page, its events since the last frame, and their number before the oldest were
    /// dropped.
    pub fn take(&mut self, page: &Page) -> (u16, Vec<Waiting>, u64) {
        let open = self.open.iter_mut().find(|open| open.number == page.number);
        open.map_or((0, Vec::new(), 0), |open| {
            let events = open.events.drain(..).collect();
            (open.pixel, events, std::mem::take(&mut open.arrived))
        })
    }
}
