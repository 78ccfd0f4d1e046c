//! An array whose pixels confirm each other: [`dtof_core::neighbours`], on all threads.
//!
//! All pixels look at the same time. Each step of a look runs on all threads, and ends before the next begins, so that
//! order and threads do not matter.

use anyhow::{Result, ensure};
use dtof_core::neighbours::{ArrayPixel, NeighbourConfig};
use dtof_core::rule::DecisionInput;
use dtof_core::{
    AnyRule, Array, AsyncPixel, CounterWidth, DepthEvent, Detection, LaserCycle, Look, Neighbours,
    PixelAddress, PixelConfig, Statistics, WindowRule,
};

use super::Engine;
use super::decisions::{Decision, LastDecision};
use super::group::sort;
use super::jump::{after, idle_cycles, look_after, within};
use super::parallel::of_parts;
use crate::settings::Settings;
use dtof_options::Refused;
use dtof_photons::source::{PixelPhotons, Slice};

/// Pixels that are worth a thread.
const PIXELS: usize = 256;

/// A place of the array, without a pixel if it is left out.
#[derive(Debug)]
struct Place<const BINS: usize, W: CounterWidth>(Option<Member<BINS, W>>);

#[derive(Debug)]
struct Member<const BINS: usize, W: CounterWidth> {
    /// Its index among the pixels of the source.
    number: usize,
    pixel: AsyncPixel<BINS, W>,
    /// The next photon of the slice.
    next: usize,
    /// The last look found no peak, and no photon has come since.
    has_no_peak: bool,
    /// The last decision, if it is kept.
    last: Option<Box<LastDecision<BINS>>>,
}

impl<const BINS: usize, W: CounterWidth> ArrayPixel<BINS, W> for Place<BINS, W> {
    fn pixel(&self) -> Option<&AsyncPixel<BINS, W>> {
        self.0.as_ref().map(|member| &member.pixel)
    }

    fn pixel_mut(&mut self) -> Option<&mut AsyncPixel<BINS, W>> {
        self.0.as_mut().map(|member| &mut member.pixel)
    }
}

/// The engine.
#[derive(Debug)]
pub struct NeighbourEngine<const BINS: usize, W: CounterWidth> {
    config: PixelConfig<BINS, AnyRule>,
    neighbours: NeighbourConfig,
    /// In the order of their addresses.
    places: Vec<Place<BINS, W>>,
    since_look: u16,
    statistics: Statistics,
}

/// The rule for neighbours.
///
/// # Errors
/// Fails if neighbours cannot be used with the other settings.
pub fn check(settings: &Settings) -> Result<&WindowRule> {
    let AnyRule::Window(rule) = &settings.rule else {
        return Err(Refused::new("neighbours", "is for `rule` window").into());
    };
    ensure!(
        settings.binning.is_none(),
        Refused::new("neighbours", "cannot be used with `binning`")
    );
    ensure!(
        !settings.weighs_dead_time(),
        Refused::new("neighbours", "cannot be used with a dead time")
    );
    Ok(rule)
}

impl<const BINS: usize, W: CounterWidth> NeighbourEngine<BINS, W> {
    /// An engine for the pixels `addresses` of an array, ascending.
    ///
    /// # Errors
    /// Fails if the settings break a constraint.
    pub fn new(
        settings: &Settings,
        neighbours: Neighbours,
        array: Array,
        addresses: &[PixelAddress],
    ) -> Result<Self> {
        let rule = check(settings)?;
        let place = |address| {
            let number = addresses.binary_search(&address).ok();
            Place(number.map(|number| Member {
                number,
                pixel: AsyncPixel::new(address),
                next: 0,
                has_no_peak: false,
                last: None,
            }))
        };
        let pixels = usize::try_from(array.pixels())?;
        Ok(Self {
            config: settings.config()?,
            neighbours: NeighbourConfig::new(array, neighbours, rule),
            places: (0..=u16::MAX)
                .take(pixels)
                .map(|address| place(PixelAddress::new(address)))
                .collect(),
            since_look: 0,
            statistics: Statistics::new(),
        })
    }

    fn members(&self) -> impl Iterator<Item = &Member<BINS, W>> {
        self.places.iter().filter_map(|place| place.0.as_ref())
    }

    /// Whether one of the `cycles` laser cycles from `from` on has a photon.
    fn has_photon(&self, photons: &[PixelPhotons], from: u16, cycles: u16) -> bool {
        let next = |member: &Member<BINS, W>| photons[member.number].photons.get(member.next);
        let mut next = self.members().filter_map(next);
        next.any(|photon| photon.cycle - from < cycles)
    }

    /// Laser cycles from laser cycle `from` of the slice on up to the first look at which some pixel decides or ends its
    /// exposure, or that has a photon; at most to the last look before the recording of a pixel ends.
    ///
    /// What neighbours confirm depends on how long they have counted, so a pixel decides at each look once it has the two
    /// photons that a candidate window needs.
    fn idle_step(&self, photons: &[PixelPhotons], from: u16) -> u64 {
        let (mut idle, mut left) = (u16::MAX, u16::MAX);
        for member in self.members() {
            let received = &photons[member.number];
            let Some(cycles) = received.cycles.checked_sub(from).filter(|&left| left > 0) else {
                continue;
            };
            let total = member.pixel.histogram().total();
            let finds_none = total == 0 || total < 2 && member.has_no_peak;
            let next = received.photons.get(member.next);
            let next = next.map_or(cycles, |photon| photon.cycle - from);
            idle = idle
                .min(next)
                .min(idle_cycles(&member.pixel, &self.config, finds_none));
            left = left.min(cycles);
        }
        let (x, since_look) = (self.config.x(), self.since_look);
        // A pixel whose recording ends takes part in no look after that.
        let last = look_after(left.into(), since_look, x).saturating_sub(x.into());
        let next = u64::from(x - since_look);
        look_after(idle.into(), since_look, x).min(last.max(next))
    }

    /// The first step of all pixels: their photons from laser cycle `from` to before `to` of the slice.
    /// Returns whether one of them decides.
    fn count(&mut self, photons: &[PixelPhotons], from: u16, to: u16) -> bool {
        let config = &self.config;
        let count = |_, places: &mut [Place<BINS, W>]| {
            let (mut statistics, mut decides) = (Statistics::new(), false);
            for Member {
                number,
                pixel,
                next,
                has_no_peak,
                ..
            } in places.iter_mut().flat_map(|place| &mut place.0)
            {
                let received = &photons[*number];
                while let Some(photon) = received.photons.get(*next)
                    && photon.cycle < to
                {
                    pixel.count(config, photon.code);
                    *next += 1;
                    *has_no_peak = false;
                }
                let cycles = to.min(received.cycles).saturating_sub(from);
                if cycles > 0 {
                    decides |= pixel.begin_look(config, &mut statistics, cycles);
                }
            }
            (statistics, decides)
        };
        let mut any = false;
        for (statistics, decides) in of_parts(&mut self.places, PIXELS, count) {
            self.statistics += statistics;
            any |= decides;
        }
        any
    }

    /// The second and third step of all pixels, at the end of laser cycle `last`. Adds the events.
    fn look(&mut self, last: LaserCycle, events: &mut Vec<DepthEvent>) {
        let (config, neighbours) = (&self.config, &self.neighbours);
        let places = &self.places;
        let mut detections: Vec<Option<Detection>> = vec![None; places.len()];
        of_parts(&mut detections, PIXELS, |first, detections| {
            for (number, detection) in (first..).zip(detections) {
                *detection = neighbours.decide(places, number, config);
            }
        });
        let end = |first: usize, places: &mut [Place<BINS, W>]| {
            let (mut statistics, mut events) = (Statistics::new(), Vec::new());
            for (Place(member), detection) in places.iter_mut().zip(&detections[first..]) {
                let Some(Member {
                    pixel,
                    has_no_peak,
                    last: kept,
                    ..
                }) = member
                else {
                    continue;
                };
                if let Some(detection) = detection {
                    pixel.keep_detection(last, detection);
                }
                let look = pixel.end_look(
                    config,
                    &mut statistics,
                    last,
                    |input: &DecisionInput<'_, BINS, _>| {
                        if let Some(kept) = kept {
                            kept.record_input(input);
                        }
                    },
                );
                if look != Look::NotDue {
                    *has_no_peak = look == Look::NoPeak;
                }
                if let Some(event) = pixel.take_event() {
                    if let Some(kept) = kept {
                        kept.record_event(event);
                    }
                    events.push(event);
                }
            }
            (statistics, events)
        };
        for (statistics, more) in of_parts(&mut self.places, PIXELS, end) {
            self.statistics += statistics;
            events.extend(more);
        }
    }
}

impl<const BINS: usize, W: CounterWidth> Engine for NeighbourEngine<BINS, W> {
    fn run(&mut self, slice: &Slice) -> Result<Vec<DepthEvent>> {
        let cycles = slice.pixels.iter().map(|pixel| pixel.cycles);
        let cycles = cycles.max().unwrap_or(0);
        for member in self.places.iter_mut().flat_map(|place| &mut place.0) {
            member.next = 0;
        }
        let (mut events, mut done) = (Vec::new(), 0);
        while done < cycles {
            let x = self.config.x();
            let step = match self.has_photon(&slice.pixels, done, x - self.since_look) {
                true => u64::from(x - self.since_look),
                false => self.idle_step(&slice.pixels, done),
            };
            let to = done + within(cycles - done, step, self.since_look, x);
            let decides = self.count(&slice.pixels, done, to);
            self.since_look = after(self.since_look, to - done, x);
            done = to;
            if decides {
                let last = LaserCycle::new(slice.first_cycle + u64::from(to) - 1);
                self.look(last, &mut events);
            }
        }
        sort(&mut events, slice.first_cycle);
        Ok(events)
    }

    fn statistics(&self) -> [Statistics; 2] {
        let mut pixels = self.statistics;
        for pixel in self.places.iter().filter_map(ArrayPixel::pixel) {
            pixel.add_photons_to(&mut pixels);
        }
        [pixels, Statistics::new()]
    }

    fn keep_decisions(&mut self, is_kept: &dyn Fn(PixelAddress) -> bool) {
        for member in self.places.iter_mut().flat_map(|place| &mut place.0) {
            member.last = LastDecision::allocate(is_kept(member.pixel.address()));
        }
    }

    fn decisions(&self) -> Vec<Decision> {
        self.members()
            .filter_map(|member| member.last.as_ref()?.decision())
            .collect()
    }
}
