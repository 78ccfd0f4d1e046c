//! Histograms in messages: any counts come back, any bytes are read without harm, and the golden
//! frames of `docs/link-format.md`.

use dtof_core::{LaserCycle, PixelAddress};
use dtof_link::endpoint::{BODY_BYTES, Endpoint};
use dtof_link::frame::WIRE_BYTES;
use dtof_link::message::{HISTOGRAM, HISTOGRAM_REQUEST, greeting};
use dtof_link::{HistogramHead, HistogramPart, NoHistogram};
use proptest::prelude::*;

use crate::common::golden;

const HEAD: HistogramHead = HistogramHead {
    pixel: PixelAddress::new(3),
    is_whole: false,
    cycle: LaserCycle::new(1000),
    exposure: 40,
};

fn bodies(head: HistogramHead, counts: &[u32]) -> Vec<Vec<u8>> {
    let messages = head.messages(counts).map(|message| {
        let mut body = heapless::Vec::new();
        message.write(&mut body);
        body.to_vec()
    });
    messages.collect()
}

/// Written from the document: the counts of these messages, one after the other.
fn read(head: HistogramHead, bodies: &[Vec<u8>]) -> Vec<u32> {
    let mut counts = Vec::new();
    for body in bodies {
        let part = HistogramPart::from_le_bytes(body).unwrap().unwrap();
        assert_eq!(part.head(), head);
        assert_eq!(usize::from(part.first_bin()), counts.len());
        let width = usize::from(body[18]);
        let bit = |at: usize| u32::from(body[19 + at / 8] >> (at % 8)) & 1;
        let ours: Vec<u32> = (0..(body.len() - 19) * 8 / width)
            .map(|number| (0..width).map(|at| bit(number * width + at) << at).sum())
            .collect();
        assert!(part.counts().eq(ours.iter().copied()));
        counts.extend(ours);
    }
    counts
}

#[test]
fn a_histogram_is_whole_or_not() {
    let mut body = bodies(HEAD, &[1; 8]).remove(0);
    for (whole, is_whole) in [(0, Some(false)), (1, Some(true)), (2, None), (255, None)] {
        body[3] = whole;
        let part = HistogramPart::from_le_bytes(&body);
        assert_eq!(part.map(|part| part.unwrap().head().is_whole), is_whole);
    }
}

#[test]
fn the_width_is_the_smallest_and_decides_how_many_messages_there_are() {
    for width in 1..=24 {
        let mut counts = [0; 128];
        counts[77] = (1 << width) - 1;
        let bodies = bodies(HEAD, &counts);
        assert_eq!(
            bodies.len(),
            if width <= 14 { 1 } else { 2 },
            "{width} bits"
        );
        let bytes: usize = bodies.iter().map(|body| body.len() - 19).sum();
        assert_eq!(bytes, 128 * width / 8);
        assert_eq!(read(HEAD, &bodies), counts);
    }
    // Nothing at all has a bit a bin, and no histogram no message.
    assert_eq!(bodies(HEAD, &[0; 128])[0].len(), 19 + 16);
    assert_eq!(bodies(HEAD, &[]), [[0u8; 0]; 0]);
    // A count that is too large for a sensor is the largest there may be.
    let mut counts = [5; 128];
    counts[0] = u32::MAX;
    let read = read(HEAD, &bodies(HEAD, &counts));
    assert_eq!((read[0], &read[1..]), ((1 << 24) - 1, &counts[1..]));
}

#[test]
fn the_ends_send_the_golden_frames() {
    let next = |end: &mut Endpoint| {
        let mut wire = [0; WIRE_BYTES];
        let length = end.transmit(0, &mut wire);
        wire[..length].to_vec()
    };
    let mut host = Endpoint::host(0x1234, greeting(0, 0), 0);
    let mut device = Endpoint::device(greeting(128, 64));
    crate::common::give(&mut device, &next(&mut host));
    crate::common::give(&mut host, &next(&mut device));
    host.offer(HISTOGRAM_REQUEST, &3u16.to_le_bytes()).unwrap();
    let [histogram] = &bodies(HEAD, &[0, 1, 2, 5, 7, 2, 1, 0])[..] else {
        panic!("more than one message");
    };
    let none = NoHistogram::NoPixel.message(PixelAddress::new(300));
    device.offer(HISTOGRAM, histogram).unwrap();
    device.offer(HISTOGRAM, &none).unwrap();
    let sent = [next(&mut host), next(&mut device), next(&mut device)];
    let begins = ["histogram request 0", "histogram 0", "no histogram 1"];
    for (bytes, begins) in sent.iter().zip(begins) {
        assert_eq!(*bytes, golden(begins), "{begins}");
    }
}

proptest! {
    #[test]
    fn histograms_come_back(
        pixel: u16, is_whole: bool, cycle: u64, exposure: u32, eights in 1usize..=128,
        width in 1u32..=24, seed: u64,
    ) {
        let head = HistogramHead {
            pixel: PixelAddress::new(pixel), is_whole, cycle: LaserCycle::new(cycle), exposure,
        };
        let mut random = seed;
        let counts: Vec<u32> = (0..8 * eights)
            .map(|_| {
                random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (random >> 40) as u32 >> (24 - width)
            })
            .collect();
        prop_assert_eq!(read(head, &bodies(head, &counts)), counts);
    }

    #[test]
    fn any_bytes_are_read_without_harm(
        mut body in prop::collection::vec(any::<u8>(), 0..=BODY_BYTES), reason in 0u8..7,
        whole in 0u8..3, width in 0u8..26,
    ) {
        for (at, byte) in [(2, reason), (3, whole), (18, width)] {
            if let Some(place) = body.get_mut(at) {
                *place = byte;
            }
        }
        let packed = body.len().saturating_sub(19);
        let is_histogram = reason == 0 && whole < 2 && (1..=24).contains(&width) && packed > 0
            && packed.is_multiple_of(width.into());
        let is_none = body.len() == 3 && (1..=4).contains(&reason);
        let found = HistogramPart::from_le_bytes(&body);
        prop_assert_eq!(found.is_some(), is_histogram || is_none);
        match found {
            Some(Ok(part)) => {
                prop_assert_eq!(part.counts().count(), 8 * packed / usize::from(width));
                prop_assert!(part.counts().all(|count| count < 1 << width));
            }
            Some(Err((pixel, none))) => prop_assert_eq!(&none.message(pixel)[..], &body[..]),
            None => {}
        }
    }
}
