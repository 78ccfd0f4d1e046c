//! The range gate: which gates there are, and which bins they let through.

use dtof_core::{GateError, RangeGate};

fn every_gate<const BINS: usize>() {
    let bins = u16::try_from(BINS).unwrap();
    for first in 0..bins + 20 {
        for last in 0..bins + 20 {
            let gate = RangeGate::<BINS>::new(first, last);
            // Counted one by one.
            let inside = (0..bins).filter(|&bin| first <= bin && bin <= last).count();
            if last >= bins {
                assert_eq!(gate, Err(GateError::PastLastBin), "{first}..={last}");
            } else if inside < 8 {
                assert_eq!(gate, Err(GateError::TooNarrow), "{first}..={last}");
            } else {
                check_gate(gate.unwrap(), first, last, inside);
            }
        }
    }
    for (first, last) in [(0, u16::MAX), (u16::MAX, u16::MAX), (0, bins)] {
        let gate = RangeGate::<BINS>::new(first, last);
        assert_eq!(gate, Err(GateError::PastLastBin));
    }
    let gate = RangeGate::<BINS>::new(u16::MAX, bins - 1);
    assert_eq!(gate, Err(GateError::TooNarrow));
    assert_eq!(RangeGate::<BINS>::new(0, bins - 1), Ok(RangeGate::full()));
    check_gate(RangeGate::<BINS>::full(), 0, bins - 1, BINS);
}

fn check_gate<const BINS: usize>(gate: RangeGate<BINS>, first: u16, last: u16, inside: usize) {
    assert_eq!((gate.first(), gate.last()), (first, last));
    for bin in [0, first, last, u16::MAX]
        .into_iter()
        .flat_map(|bin| [bin.wrapping_sub(1), bin, bin.wrapping_add(1)])
    {
        assert_eq!(gate.contains(bin), first <= bin && bin <= last, "{bin}");
    }
    let starts = gate.quadrant_starts().map(usize::from);
    for (k, start) in starts.into_iter().enumerate() {
        assert_eq!(start, usize::from(first) + k * inside / 4);
    }
}

#[test]
fn every_gate_is_what_it_says_or_refused() {
    every_gate::<8>();
    every_gate::<16>();
    every_gate::<32>();
    every_gate::<64>();
    every_gate::<128>();
    every_gate::<1024>();
}

#[test]
fn every_bin_is_asked_for_once() {
    let gate = RangeGate::<128>::new(20, 119).unwrap();
    let inside: Vec<u16> = (0..=u16::MAX).filter(|&bin| gate.contains(bin)).collect();
    assert_eq!(inside, (20..120).collect::<Vec<_>>());
}
