//! Histograms that a host asks for: they add up to the photons that were counted, whatever the
//! line does and events come between, and no event is another one for them.

use std::collections::BTreeMap;

use crate::common::histograms::{Answer, histograms, refused};
use crate::common::host::{CONFIGURATION, Call, Host, configured, deliver, device, scripted};
use crate::common::script;
use dtof_core::PixelAddress;
use dtof_firmware::sidecar::Sidecar;
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::{Configuration, HistogramHead, NoHistogram, Report, Source, message};
use dtof_sensors::SensorInfo;
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// A line that loses one in so many frames and doubles one in so many; none if 0.
struct Line {
    one_in: u32,
    random: Pcg32,
    now_ms: u32,
    down: Deframer,
}

impl Line {
    fn new(one_in: u32, seed: u64) -> Self {
        Self {
            one_in,
            random: Pcg32::seed_from_u64(seed),
            now_ms: 0,
            down: Deframer::new(),
        }
    }

    /// How often the next frame arrives.
    fn copies(&mut self) -> usize {
        if self.one_in == 0 {
            return 1;
        }
        match self.random.next_u32() % self.one_in {
            0 => 0,
            1 => 2,
            _ => 1,
        }
    }

    /// A millisecond.
    fn exchange(&mut self, host: &mut Host, device: &mut Sidecar) {
        let mut wire = [0; WIRE_BYTES];
        self.now_ms += 1;
        while let length @ 1.. = host.endpoint.transmit(self.now_ms, &mut wire) {
            for _ in 0..self.copies() {
                deliver(&mut self.down, &wire[..length], |frame| {
                    device.receive(frame, self.now_ms);
                });
            }
        }
        device.work(0);
        while let length @ 1.. = device.transmit(self.now_ms, &mut wire) {
            for _ in 0..self.copies() {
                host.hear(&wire[..length], self.now_ms);
            }
        }
        host.read(usize::MAX);
    }

    /// Asks, and waits for so many more messages that are not events.
    fn ask(
        &mut self,
        host: &mut Host,
        device: &mut Sidecar,
        kind: u8,
        body: &[u8],
        answers: usize,
    ) {
        let before = host.answers.len();
        while !host.endpoint.is_open() || !host.endpoint.has_room() {
            self.exchange(host, device);
        }
        host.ask(kind, body);
        let until = self.now_ms + 600_000;
        while host.answers.len() < before + answers {
            assert!(self.now_ms < until, "no answer to {kind:#04x}");
            self.exchange(host, device);
        }
    }
}

/// Photons of this cycle alone, and its end alone.
fn split(cycle: &[Call]) -> [Vec<Call>; 2] {
    let is_end = |call: &&Call| matches!(call, Call::End(_));
    let (ends, photons): (Vec<&Call>, Vec<&Call>) = cycle.iter().partition(is_end);
    [photons, ends].map(|calls| calls.into_iter().cloned().collect())
}

/// Sends every laser cycle of a script, asks before its end for the histograms of all pixels if
/// `asks`, and gives the host and the report.
fn run(cycles: &[Vec<Call>], one_in: u32, seed: u64, asks: bool) -> (Host, Report) {
    let mut device = device::<8>(None);
    let (mut host, mut line) = (Host::new(1, 0), Line::new(one_in, seed));
    let requested = Configuration {
        source: Source::Link,
        ..CONFIGURATION
    };
    let (configure, requested) = (message::CONFIGURE, requested.to_le_bytes());
    line.ask(&mut host, &mut device, configure, &requested, 1);
    for cycle in cycles {
        let [photons, end] = split(cycle);
        for (part, is_end) in [(photons, false), (end, true)] {
            for body in script::messages(&[part]) {
                line.ask(&mut host, &mut device, message::PHOTONS, &body, 0);
            }
            for pixel in 0..8u16 {
                if asks && !is_end {
                    let kind = message::HISTOGRAM_REQUEST;
                    line.ask(&mut host, &mut device, kind, &pixel.to_le_bytes(), 1);
                }
            }
        }
    }
    line.ask(&mut host, &mut device, message::SYNCHRONISE, &[], 1);
    line.ask(&mut host, &mut device, message::STATISTICS_REQUEST, &[], 1);
    let report = Report::from_le_bytes(&host.answers.last().unwrap().1).unwrap();
    (host, report)
}

/// The photons of the last histogram of each exposure, as the document has it.
fn kept(answers: &[Answer]) -> u64 {
    let mut exposures = BTreeMap::new();
    for (head, counts) in answers.iter().map(|answer| answer.as_ref().unwrap()) {
        let began = head.cycle.raw() - u64::from(head.exposure);
        exposures.insert((head.pixel.raw(), began), counts);
    }
    let counts = exposures.values().flat_map(|counts| counts.iter());
    counts.map(|&count| u64::from(count)).sum()
}

/// The photons of a pixel in these laser cycles, and in so many more.
fn recount(cycles: &[Vec<Call>], head: &HistogramHead, more: u64) -> Vec<u32> {
    let mut counts = vec![0; 128];
    let began = head.cycle.raw() - u64::from(head.exposure);
    let mut cycle = 0;
    for call in cycles.iter().flatten() {
        match *call {
            Call::Photon(pixel, code) if (began..head.cycle.raw() + more).contains(&cycle) => {
                if let (true, Some(count)) =
                    (pixel == head.pixel.raw(), counts.get_mut(usize::from(code)))
                {
                    *count += 1;
                }
            }
            Call::End(cycles) => cycle += u64::from(cycles),
            _ => {}
        }
    }
    counts
}

#[test]
fn histograms_add_up_to_every_photon_once_while_events_leave() {
    for (seed, one_in) in [(1, 0), (2, 5), (3, 8)] {
        let cycles = script::script(250, &mut Pcg32::seed_from_u64(seed));
        let expected = script::reference(&cycles, &script::config(&CONFIGURATION));
        assert!(expected.len() > 20, "{}", expected.len());
        let (quiet, quiet_report) = run(&cycles, one_in, seed, false);
        let (host, report) = run(&cycles, one_in, seed, true);
        assert!(host.events == expected && quiet.events == expected);
        assert_eq!(report.statistics, quiet_report.statistics);
        let answers = histograms(&host.answers);
        assert_eq!(answers.len(), 8 * cycles.len());
        assert_eq!(kept(&answers), report.statistics.counted);
        for (head, counts) in answers.iter().map(|answer| answer.as_ref().unwrap()) {
            assert!(!head.is_whole);
            // The laser cycle under way, too.
            assert_eq!(*counts, recount(&cycles, head, 1), "{head:?}");
        }
        let repaired = host.endpoint.counters().duplicate + report.link.out_of_order;
        assert_eq!(repaired > 0, one_in > 0);
    }
}

#[test]
fn histograms_beside_a_sensor_change_no_event_and_hold_its_photons() {
    let cycles = script::script(5_000, &mut Pcg32::seed_from_u64(1));
    let expected = script::reference(&cycles, &script::config(&CONFIGURATION));
    let (mut device, mut host) = configured::<8>(&CONFIGURATION);
    let mut sensor = scripted(cycles.iter().cloned().map(Some));
    for now_ms in 0..5_000 {
        host.run(&mut device, &mut sensor, now_ms..now_ms + 1, 4);
        if host.endpoint.has_room() {
            let pixel = (now_ms % 9) as u16;
            host.ask(message::HISTOGRAM_REQUEST, &pixel.to_le_bytes());
        }
    }
    host.run(&mut device, &mut sensor, 5_000..5_100, 4);
    assert!(expected.len() > 500 && host.events == expected);
    let report = host.report(&mut device, 5_100);
    assert_eq!((report.statistics.deferred, report.unknown), (0, 0));
    let answers = histograms(&host.answers);
    assert_eq!(answers.len(), 5_000);
    let mut whole = 0;
    for (now_ms, answer) in answers.iter().enumerate() {
        match answer {
            Ok((head, counts)) => {
                whole += 1;
                assert_eq!(usize::from(head.pixel.raw()), now_ms % 9);
                assert_eq!(*counts, recount(&cycles, head, 0), "{head:?}");
            }
            Err((pixel, NoHistogram::NoPixel)) => assert_eq!(*pixel, PixelAddress::new(8)),
            Err(none) => panic!("{none:?}"),
        }
    }
    assert!(whole > 4_000, "{whole}");
}

#[test]
fn a_device_says_why_there_is_no_histogram() {
    let mut device = device::<8>(Some(SensorInfo::new(256)));
    let mut host = Host::new(1, 0);
    let reason = refused(&mut device, &mut host, 0);
    assert_eq!(reason, NoHistogram::NoConfiguration);
    host.configure(&mut device, 0, &CONFIGURATION);
    for pixel in [8, u16::MAX] {
        let reason = refused(&mut device, &mut host, pixel);
        assert_eq!(reason, NoHistogram::NoPixel);
    }
    // A request that is none is counted.
    for body in [&[][..], &[1], &[1, 0, 0]] {
        host.ask(message::HISTOGRAM_REQUEST, body);
        host.exchange(&mut device, 0);
    }
    assert_eq!(host.report(&mut device, 0).unknown, 3);
}

/// Every slot is full, and the host takes a message now and then.
#[test]
fn histograms_wait_for_events_and_nothing_waits_for_histograms() {
    let cycles = script::script(5_000, &mut Pcg32::seed_from_u64(1));
    let (mut device, mut host) = configured::<8>(&CONFIGURATION);
    let mut sensor = scripted(cycles.iter().cloned().map(Some));
    host.run(&mut device, &mut sensor, 0..2_000, 0);
    let before = host.report(&mut device, 2_000);
    assert!(before.statistics.deferred > 0);
    host.run(&mut device, &mut sensor, 2_000..3_000, 0);
    host.ask(message::HISTOGRAM_REQUEST, &[0, 0]);
    host.run(&mut device, &mut sensor, 3_000..3_001, 1);
    // Events wait, so it waits, and the report does not.
    let answers = host.answers.len();
    host.report(&mut device, 3_001);
    assert_eq!(host.answers[answers].0, message::STATISTICS);
    host.run(&mut device, &mut sensor, 3_001..3_200, usize::MAX);
    assert_eq!(host.answers.len(), answers + 2);
    let (kind, _, events) = &host.answers[answers + 1];
    assert_eq!(*kind, message::HISTOGRAM);
    assert!(*events > host.answers[answers].2);
}

/// A request that waits for events is answered if its pixel is left out meanwhile.
#[test]
fn a_pixel_that_is_left_out_has_no_histogram() {
    let cycles = script::script(5_000, &mut Pcg32::seed_from_u64(1));
    let (mut device, mut host) = configured::<8>(&CONFIGURATION);
    let mut sensor = scripted(cycles.iter().cloned().map(Some));
    host.run(&mut device, &mut sensor, 0..3_000, 0);
    host.ask(message::HISTOGRAM_REQUEST, &[0, 0]);
    host.run(&mut device, &mut sensor, 3_000..3_001, 1);
    device.leave_out(PixelAddress::new(0));
    host.run(&mut device, &mut sensor, 3_001..3_200, usize::MAX);
    let refused = Err((PixelAddress::new(0), NoHistogram::NoPixel));
    assert!(histograms(&host.answers) == [refused]);
}

proptest! {
    /// Two hosts that ask at other times see the same photons.
    #[test]
    fn any_requests_between_any_photons_are_answered_rightly(
        seed: u64, asked in prop::collection::vec((0usize..60, 0u16..10), 0..40),
    ) {
        let cycles = script::script(60, &mut Pcg32::seed_from_u64(seed));
        let (mut device, mut host) = configured::<8>(&CONFIGURATION);
        let mut sensor = scripted(cycles.iter().cloned().map(Some));
        for now_ms in 0..60 {
            host.run(&mut device, &mut sensor, now_ms..now_ms + 1, usize::MAX);
            for (_, pixel) in asked.iter().filter(|(at, _)| *at == now_ms as usize) {
                host.answer(
                    &mut device, now_ms, message::HISTOGRAM_REQUEST, &pixel.to_le_bytes(),
                );
            }
        }
        let answers = histograms(&host.answers);
        prop_assert_eq!(answers.len(), asked.len());
        for answer in &answers {
            match answer {
                Ok((head, counts)) => prop_assert_eq!(counts, &recount(&cycles, head, 0)),
                Err((pixel, reason)) => {
                    prop_assert!(pixel.raw() >= 8 && *reason == NoHistogram::NoPixel);
                }
            }
        }
        let expected = script::reference(&cycles, &script::config(&CONFIGURATION));
        prop_assert_eq!(host.events, expected);
    }
}
