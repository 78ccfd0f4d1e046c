//! What tracking, several echoes and a dead time take: looks, events, ends of exposures, and whole
//! histograms. All with a window of 3 bins.

use dtof_core::Look;

use crate::counter::{Counter, Operation};
use crate::further::{Features, Further, echoes, look};
use crate::report;
use crate::scene::{CYCLES, EXPOSURES, State};

/// Measures all, if it can.
pub fn run(counter: &Counter, state: &mut State) -> bool {
    let Some(mut further) = Further::new() else {
        return false;
    };
    counter.is_right_for(&mut further)
        && ROWS.iter().all(|row| row.run(counter, state, &mut further))
}

/// Brings a pixel with such features to where the operation begins. `None` if exposure `number`
/// does not get there.
type Prepare = fn(&mut Further, &mut State, u32, Features) -> Option<()>;

/// The first look of an exposure with so many targets.
fn first<const TARGETS: u8>(
    further: &mut Further,
    state: &mut State,
    number: u32,
    features: Features,
) -> Option<()> {
    further.photons(state, number, TARGETS);
    further.empty(features)?;
    further.until_first_look();
    Some(())
}

/// The same after an exposure with an event.
fn after_event<const TARGETS: u8>(
    further: &mut Further,
    state: &mut State,
    number: u32,
    features: Features,
) -> Option<()> {
    first::<1>(further, state, number, features)?;
    further.reports().then_some(())?;
    further.photons(state, number, TARGETS);
    further.until_first_look();
    Some(())
}

/// The second look, after an event at the first.
fn second<const TARGETS: u8>(
    further: &mut Further,
    state: &mut State,
    number: u32,
    features: Features,
) -> Option<()> {
    first::<TARGETS>(further, state, number, features)?;
    further.reports().then_some(())?;
    further.until_second_look();
    Some(())
}

/// The second look after an exposure with an event, and a first look without one.
fn second_after_event(
    further: &mut Further,
    state: &mut State,
    number: u32,
    features: Features,
) -> Option<()> {
    after_event::<0>(further, state, number, features)?;
    (!further.reports()).then_some(())?;
    further.until_second_look();
    Some(())
}

/// The second look, after two exposures: one with two echoes, and the first of this one.
fn second_of_tracked(
    further: &mut Further,
    state: &mut State,
    number: u32,
    features: Features,
) -> Option<()> {
    second::<2>(further, state, number, features)?;
    further.reports().then_some(())?;
    further.photons(state, number, 1);
    further.until_first_look();
    further.reports().then_some(())?;
    further.until_second_look();
    Some(())
}

/// The first look of a long exposure to background alone.
fn long(further: &mut Further, _: &mut State, number: u32, features: Features) -> Option<()> {
    further.empty(features)?;
    further.until_long_look(number);
    Some(())
}

/// Counts that come from elsewhere, with so many targets.
fn whole<const TARGETS: u8>(
    further: &mut Further,
    state: &mut State,
    number: u32,
    features: Features,
) -> Option<()> {
    further.photons(state, number, TARGETS);
    further.empty(features)?;
    further.arrive();
    Some(())
}

/// An operation, and how it comes about.
struct Row {
    operation: &'static str,
    variant: &'static str,
    features: Features,
    prepare: Prepare,
    way: Operation<Further>,
    /// What it gives in the exposures that are measured.
    gives: u32,
}

const fn row(variant: &'static str, features: Features, prepare: Prepare, gives: Look) -> Row {
    Row {
        operation: match gives {
            Look::Expired | Look::Ended => "clear",
            _ => "decision",
        },
        variant,
        features,
        prepare,
        way: look,
        gives: gives as u32,
    }
}

const fn of_whole(variant: &'static str, prepare: Prepare, found: u32) -> Row {
    Row {
        operation: "decision",
        variant,
        features: Features::TWO_ECHOES,
        prepare,
        way: echoes,
        gives: found,
    }
}

const PLAIN: Features = Features::NONE;
const TRACKS: Features = Features::TRACKING;
const ECHOES: Features = Features::TWO_ECHOES;

const BOTH: Features = Features {
    tracks: true,
    ..ECHOES
};

const ROWS: [Row; 16] = [
    row(
        "look; window of 3; no event",
        PLAIN,
        first::<0>,
        Look::NoPeak,
    ),
    row("look; window of 3; event", PLAIN, first::<1>, Look::Event),
    row(
        "look; tracking; no event",
        TRACKS,
        after_event::<0>,
        Look::NoPeak,
    ),
    row(
        "look; tracking; event",
        TRACKS,
        after_event::<1>,
        Look::Event,
    ),
    row(
        "look; two echoes; no event",
        ECHOES,
        first::<0>,
        Look::NoPeak,
    ),
    row("look; two echoes; first", ECHOES, first::<2>, Look::Event),
    row(
        "look; two echoes; first held, no event",
        ECHOES,
        second::<1>,
        Look::NoPeak,
    ),
    row("look; two echoes; second", ECHOES, second::<2>, Look::Event),
    row(
        "look; two echoes, tracking; first held, no event",
        BOTH,
        second_of_tracked,
        Look::NoPeak,
    ),
    row(
        "look; dead time; first photon only; no event",
        Features::dead_time(u16::MAX),
        long,
        Look::NoPeak,
    ),
    row(
        "look; dead time of 20 bins; no event",
        Features::dead_time(20),
        long,
        Look::NoPeak,
    ),
    row(
        "look at L2; tracking",
        TRACKS.short(),
        second_after_event,
        Look::Expired,
    ),
    row(
        "look at L2; echo held",
        ECHOES.short(),
        second::<1>,
        Look::Ended,
    ),
    of_whole("echoes of a whole histogram; none", whole::<0>, 0),
    of_whole("echoes of a whole histogram; one", whole::<1>, 1),
    of_whole("echoes of a whole histogram; two", whole::<2>, 2),
];

impl Row {
    /// Whether there was an exposure to measure.
    fn run(&self, counter: &Counter, state: &mut State, further: &mut Further) -> bool {
        let (mut total, mut runs) = (0, 0);
        for number in 0..EXPOSURES {
            let is_there = (self.prepare)(further, state, number, self.features).is_some();
            if is_there && (self.way)(&mut further.clone(), CYCLES.into()) == self.gives {
                total += counter.measure(self.way, further, CYCLES.into());
                runs += 1;
            }
        }
        report::line(self.operation, self.variant, total, runs);
        runs > 0
    }
}
