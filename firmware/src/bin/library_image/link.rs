//! All of dtof-link.

use core::fmt::Display;

use dtof_core::{Count10, Neighbours};
use dtof_link::endpoint::{BODY_BYTES, Endpoint};
use dtof_link::frame::{self, Deframer, WIRE_BYTES};
use dtof_link::message::greeting;
use dtof_link::{
    AdaptiveBinning, Configuration, DynamicDepth, FaultRecord, HistogramHead, HistogramPart,
    NoHistogram, Refusal, Report, SensorRecord, StopReason, Token,
};
use heapless::Vec;

use crate::values::{
    address, any_rule, byte, cycle, distance, echo, estimator, half, keep, level, more, or_text,
    rule, scale, settings, some, values, word,
};

pub fn all() {
    frames();
    sessions();
    configurations();
    reports();
    tokens();
    whole_histograms();
    reasons();
}

/// Any bytes of a line, and a frame of any messages.
#[inline(never)]
fn frames() {
    let mut deframer = Deframer::new();
    let mut wire = [0; WIRE_BYTES];
    let body: [u8; 300] = values(byte);
    while more() {
        keep(deframer.push(byte()).map(|frame| frame.is_ok()));
        keep(frame::encode([some(&body), some(&body)], &mut wire));
        keep(wire);
    }
}

/// A host and a device that hear anything at any time.
#[inline(never)]
fn sessions() {
    let greeting = greeting(half(), half());
    let mut end = if more() {
        Endpoint::host(half(), greeting, word())
    } else {
        Endpoint::device(greeting)
    };
    let mut deframer = Deframer::new();
    let mut wire = [0; WIRE_BYTES];
    let body: [u8; 300] = values(byte);
    while more() {
        if let Some(frame) = deframer.push(byte()) {
            end.receive(frame, word());
        }
        keep(end.transmit(word(), &mut wire));
        keep(wire);
        keep(or_text(end.offer(byte(), some(&body))));
        if let Some(body) = or_text(end.offer_empty(byte())) {
            keep(body.push(byte()));
        }
        keep(end.peek().map(|message| (message.kind, message.body.len())));
        keep(end.take());
        keep((end.is_open(), end.is_lost(), end.is_settled()));
        keep((end.take_began(), end.take_ended(), end.silent_ms(word())));
        keep((end.waiting(), end.has_room(), end.room()));
        keep((end.stop_reason(), *end.peer_greeting(), *end.counters()));
        if let Some(reason) = StopReason::from_number(byte()) {
            end.set_stop_reason(reason);
        }
        if more() {
            end.close();
        }
        if more() {
            end.end(word());
        }
    }
}

/// Any bytes as a configuration, and any configuration as bytes.
#[inline(never)]
fn configurations() {
    let bytes: [u8; BODY_BYTES] = values(byte);
    let Some(read) = or_text(Configuration::from_le_bytes(some(&bytes))) else {
        return;
    };
    keep(or_text(read.dead_time_in_force(half(), half())));
    let changes = DynamicDepth {
        threshold_mm: distance(),
        ..DynamicDepth::default()
    };
    if let Some(scale) = scale() {
        keep(changes.config(&scale).map_err(Refusal::from).is_ok());
    }
    let any = Configuration {
        rule: any_rule(),
        estimator: estimator(),
        binning: more().then(|| AdaptiveBinning {
            levels: level(),
            patience: half(),
        }),
        dynamic_depth: more().then_some(changes),
        echoes: echo(),
        neighbours: more().then_some(Neighbours::Eight),
        ..read
    };
    keep(any.to_le_bytes());
    keep(or_text(any.lone_config::<128>(half())));
    keep(or_text(any.pixel_config::<128>(half())));
    keep(or_text(any.block_config::<128>(level(), half())));
    keep(or_text(any.device_config::<128, Count10, ()>(half())).is_some());
}

#[inline(never)]
fn reports() {
    let bytes: [u8; BODY_BYTES] = values(byte);
    keep(Report::from_le_bytes(some(&bytes)).map(Report::to_le_bytes));
    if let Some((sensor, bits)) = SensorRecord::from_le_bytes(some(&bytes)) {
        keep((sensor, bits));
        keep(SensorRecord::to_le_bytes(sensor.as_ref(), byte()));
    }
}

#[inline(never)]
fn tokens() {
    let bytes: [u8; BODY_BYTES] = values(byte);
    let mut rest = some(&bytes);
    while let Some((token, more)) = Token::split_first(rest) {
        keep(token);
        rest = more;
    }
    for token in [
        Token::Photon { code: half() },
        Token::Advance { pixels: byte() },
        Token::EndOfCycles { cycles: half() },
    ] {
        keep(token.to_bytes());
    }
}

#[inline(never)]
fn whole_histograms() {
    let bytes: [u8; BODY_BYTES] = values(byte);
    match HistogramPart::from_le_bytes(some(&bytes)) {
        Some(Ok(part)) => {
            keep((part.head(), part.first_bin()));
            part.counts().for_each(keep);
        }
        Some(Err((pixel, reason))) => keep(reason.message(pixel)),
        None => {}
    }
    let head = HistogramHead {
        pixel: address(),
        is_whole: more(),
        cycle: cycle(),
        exposure: word(),
    };
    let counts: [u32; 1024] = values(word);
    for message in head.messages(some(&counts)) {
        let mut body = Vec::new();
        message.write(&mut body);
        keep(body);
    }
}

/// What is sent as a number, and the reasons of dtof-core that become one.
#[inline(never)]
fn reasons() {
    written(FaultRecord::from_number(byte()));
    written(NoHistogram::from_number(byte()));
    written(Refusal::from_number(byte()));
    written(StopReason::from_number(byte()));
    written(
        settings::<8, _>(rule())
            .build()
            .map_err(Refusal::from)
            .err(),
    );
    written(
        dtof_core::RangeGate::<8>::new(half(), half())
            .map_err(Refusal::from)
            .err(),
    );
}

fn written(reason: Option<impl Display>) {
    keep(or_text(reason.map_or(Ok(()), Err)));
}
