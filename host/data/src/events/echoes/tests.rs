use proptest::prelude::*;

use super::*;
use crate::events::fixtures;
use crate::options::Named;
use dtof_core::{BinIndex, Count};

/// An echo of pixel `pixel` whose exposure began in laser cycle `begun`.
fn echo(pixel: u16, begun: u64, exposure: u16, number: u8, bin: u16, peak: u32) -> DepthEvent {
    DepthEvent {
        echo: EchoNumber::new(number).unwrap(),
        exposure,
        peak_count: Count::saturating(peak),
        ..fixtures::event(pixel, begun + u64::from(exposure) - 1, bin)
    }
}

/// The events shown if all decided ones are taken after each event.
fn shown(echo: Echo, most: EchoNumber, longest: u16, events: &[DepthEvent]) -> Vec<DepthEvent> {
    let mut selection = EchoSelection::new(echo, most, longest);
    let mut shown = Vec::new();
    for event in events {
        selection.push(*event);
        shown.extend(selection.by_ref());
    }
    selection.finish();
    shown.extend(selection.by_ref());
    assert!(selection.waiting.is_empty() && selection.open.is_empty());
    shown
}

fn bins(events: &[DepthEvent]) -> Vec<u16> {
    events.iter().map(|event| event.peak_bin.raw()).collect()
}

#[test]
fn one_of_each_exposure_is_shown_in_order_of_time() {
    let events = [
        echo(0, 0, 50, 1, 20, 9),
        echo(1, 0, 60, 1, 70, 9),
        echo(0, 0, 100, 2, 10, 30), // (30 - 1) / 100 > (9 - 1) / 50
        echo(1, 0, 300, 2, 40, 20), // (20 - 1) / 300 < (9 - 1) / 60
        echo(0, 0, 310, 3, 90, 12),
        echo(0, 400, 44, 1, 21, 9),
    ];
    let shown = |echo| bins(&shown(echo, EchoNumber::LAST, 2000, &events));
    assert_eq!(shown(Echo::First), [10, 40, 21]);
    assert_eq!(shown(Echo::Last), [70, 90, 21]);
    assert_eq!(shown(Echo::Strongest), [70, 10, 21]);
    assert_eq!(shown(Echo::All), [20, 70, 10, 40, 90, 21]);
}

#[test]
fn events_wait_no_longer_than_an_exposure_lasts() {
    let mut selection = EchoSelection::new(Echo::Last, EchoNumber::LAST, 100);
    selection.push(echo(0, 0, 50, 1, 20, 9));
    for begun in 0..=40 {
        selection.push(echo(1, begun, 60, 1, 30, 9));
        assert_eq!(selection.next(), None, "laser cycle {}", begun + 59);
    }
    selection.push(echo(2, 41, 61, 1, 30, 9)); // in laser cycle 101
    let first = selection.next().map(|event| event.pixel);
    assert_eq!(first, Some(PixelAddress::new(0)));
    // Each exposure of pixel 1 replaces the one before, and the last is still open.
    assert_eq!(selection.by_ref().count(), 40);
}

#[test]
fn the_last_echo_of_an_exposure_is_decided_at_once() {
    let most = EchoNumber::new(2).unwrap();
    let mut selection = EchoSelection::new(Echo::Strongest, most, 2000);
    selection.push(echo(0, 0, 50, 1, 20, 9));
    assert_eq!(selection.next(), None);
    selection.push(echo(0, 0, 60, 2, 30, 9));
    assert_eq!(
        selection.next().map(|event| event.echo),
        Some(EchoNumber::FIRST)
    );
    assert_eq!((selection.next(), selection.open.len()), (None, 0));
}

#[test]
fn pixels_and_blocks_are_chosen_alone() {
    let block = |number, bin| DepthEvent {
        level: BlockLevel::new(1).unwrap(),
        ..echo(0, 0, 60 + u16::from(number), number, bin, 9)
    };
    let events = [
        echo(0, 0, 50, 1, 20, 9),
        block(1, 60),
        echo(0, 0, 70, 2, 30, 9),
        block(2, 50),
    ];
    let first = shown(Echo::First, EchoNumber::LAST, 2000, &events);
    assert_eq!(bins(&first), [20, 50]);
}

/// Exposures of four pixels in order of time, each as its echoes.
fn exposures() -> impl Strategy<Value = Vec<Vec<DepthEvent>>> {
    let echoes = prop::collection::vec((1u16..60, 0u16..128, 0u32..40), 1..=4);
    let one = (0u16..4, 0u64..30, echoes);
    prop::collection::vec(one, 0..40).prop_map(|exposures| {
        let mut free = [0u64; 4];
        exposures
            .into_iter()
            .map(|(pixel, pause, echoes)| {
                let begun = free[usize::from(pixel)] + pause;
                let mut exposure = 0;
                let mut events = Vec::new();
                for (number, (longer, bin, peak)) in (1..).zip(echoes) {
                    exposure += longer;
                    events.push(echo(pixel, begun, exposure, number, bin, peak));
                }
                free[usize::from(pixel)] = begun + u64::from(exposure);
                events
            })
            .collect()
    })
}

proptest! {
    /// Each exposure shows its selected echo, whatever comes between its echoes.
    #[test]
    fn each_exposure_shows_the_one_that_is_selected(exposures in exposures()) {
        let mut all: Vec<DepthEvent> = exposures.iter().flatten().copied().collect();
        all.sort_by_key(|event| event.cycle);
        let rate = |event: &DepthEvent| {
            let signal = f64::from(event.peak_count.raw()) - f64::from(event.background.raw());
            signal.max(0.0) / f64::from(event.exposure)
        };
        let position = |event: &DepthEvent| f64::from(event.position().raw());
        for echo in Echo::NAMES.iter().map(|(_, echo, _)| echo) {
            let shown = shown(*echo, EchoNumber::LAST, 240, &all);
            prop_assert!(shown.is_sorted_by_key(|event| event.cycle));
            if *echo == Echo::All {
                prop_assert_eq!(&shown, &all);
                continue;
            }
            prop_assert_eq!(shown.len(), exposures.len());
            for exposure in &exposures {
                let of = shown.iter().filter(|event| exposure.contains(event));
                let of: Vec<_> = of.collect();
                prop_assert_eq!(of.len(), 1);
                for other in exposure {
                    let is_selected = match echo {
                        Echo::First => position(of[0]) <= position(other),
                        Echo::Last => position(of[0]) >= position(other),
                        _ => rate(of[0]) >= rate(other) - 1e-12,
                    };
                    prop_assert!(is_selected);
                }
            }
        }
    }

    /// Disordered events never block the queue and are never shown twice.
    #[test]
    fn damaged_streams_are_no_trouble(
        events in prop::collection::vec((0u16..3, 0u64..500, 0u16..200, 1u8..=4, 0u16..9), 0..60),
        most in 1u8..=4,
        longest in 0u16..300,
    ) {
        let events: Vec<_> = events
            .into_iter()
            .map(|(pixel, cycle, exposure, number, bin)| DepthEvent {
                cycle: LaserCycle::new(cycle),
                exposure,
                peak_bin: BinIndex::saturating(bin),
                ..echo(pixel, 0, 1, number, 0, 9)
            })
            .collect();
        for echo in Echo::NAMES.iter().map(|(_, echo, _)| echo) {
            let shown = shown(*echo, EchoNumber::new(most).unwrap(), longest, &events);
            let mut rest = events.iter();
            prop_assert!(shown.iter().all(|event| rest.any(|other| other == event)));
        }
    }
}
