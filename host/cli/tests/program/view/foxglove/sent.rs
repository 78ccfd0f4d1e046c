//! What clients are sent: what an MCAP file has, maps, losses and reasons.

use std::collections::BTreeMap;
use std::fs;

use serde_json::{Value, json};

use super::client::{Client, Data};
use super::protobuf::{field, fields};
use super::{START_US, of, play, points, recording};
use crate::common::aer::{depth, dynamic};
use crate::common::{Scratch, assert_contains};
use crate::view::device::{feed, plugged};
use crate::view::http::{Stream, post};
use crate::view::{Live, until};
use dtof_run::export::{Format, Options, export};

const TOPICS: [&str; 7] = [
    "/events",
    "/log",
    "/losses",
    "/range",
    "/rate",
    "/reflectivity",
    "/statistics",
];

/// Nanoseconds of a time stamp.
fn stamp(message: &[u8]) -> u64 {
    let stamp = field(message, 1);
    let part = |number: u64| {
        let parts = fields(stamp.bytes());
        let part = parts.iter().find(|(of, _)| *of == number);
        part.map_or(0, |(_, value)| value.number())
    };
    part(1) * 1_000_000_000 + part(2)
}

/// A value of each pixel of an image.
fn image(data: &Data) -> Vec<f32> {
    let bytes = &data.bytes;
    assert_eq!(field(bytes, 7).text(), "dtof_optical");
    assert_eq!(field(bytes, 4).text(), "32FC1");
    assert_eq!(stamp(bytes), data.time);
    let [width, height, step] = [2, 3, 5].map(|number| field(bytes, number).number());
    assert_eq!((width, height, step), (64, 32, 256));
    let values = field(bytes, 6);
    let values = values.bytes().chunks_exact(4);
    values
        .map(|value| f32::from_le_bytes(value.try_into().unwrap()))
        .collect()
}

#[test]
fn what_is_played_is_what_is_exported() {
    let scratch = Scratch::new();
    let (header, events) = recording();
    let live = Live::with_foxglove(play(&scratch, "events.aer", &header, &events), None, &[]);
    let mut client = Client::open(live.foxglove);
    let topics: Vec<&String> = client.channels.keys().collect();
    assert_eq!(topics, TOPICS);
    let info = client.infos[0].clone();
    assert_eq!(info["capabilities"], json!([]));
    assert_contains(info["name"].as_str().unwrap(), "events.aer");
    client.subscribe_all();
    let mut last = BTreeMap::new();
    let all = client.until("the end", |data| {
        last.insert(data.topic.clone(), data.clone());
        let is_whole = |topic: &str| {
            last.get(topic)
                .is_some_and(|data: &Data| data.json()["events_so_far"] == 200)
        };
        is_whole("/statistics") && data.topic == "/log"
    });

    // The same topics, schemas, points and counts as in a file.
    let out = scratch.path("events.mcap");
    let options = Options::default();
    export(
        &scratch.path("events.aer"),
        &out,
        Format::Mcap,
        &options,
        &mut (),
    )
    .unwrap();
    let bytes = fs::read(out).unwrap();
    let mut clouds = Vec::new();
    let mut counts = Vec::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let schema = message.channel.schema.as_ref().unwrap();
        let live = &client.channels[&message.channel.topic];
        assert_eq!(live["encoding"], *message.channel.message_encoding);
        assert_eq!(live["schemaName"], *schema.name);
        assert_eq!(live["schemaEncoding"], *schema.encoding);
        let text = if message.channel.topic == "/events" {
            clouds.push(message.data.to_vec());
            base64::Engine::encode(&base64::prelude::BASE64_STANDARD, &schema.data)
        } else {
            counts.push(serde_json::from_slice::<Value>(&message.data).unwrap());
            String::from_utf8(schema.data.to_vec()).unwrap()
        };
        assert_eq!(live["schema"], *text);
    }
    let exported = points(clouds.iter().map(|cloud| &cloud[..]));
    assert_eq!(exported.len(), 200);
    let sent: Vec<&Data> = of(&all, "/events").collect();
    assert_eq!(points(sent.iter().map(|data| &data.bytes[..])), exported);
    // Fields with the same names at the same places.
    let layout = |cloud: &[u8]| -> Vec<_> {
        let all = fields(cloud).into_iter();
        all.filter(|(number, _)| *number == 5).collect()
    };
    assert_eq!(layout(&sent[0].bytes), layout(&clouds[0]));
    assert_eq!(layout(&clouds[0]).len(), 9);
    for data in &sent {
        assert_eq!(stamp(&data.bytes), data.time);
    }
    // Each slice begins at the end of the last.
    let statistics: Vec<Value> = of(&all, "/statistics").map(Data::json).collect();
    assert!(statistics.len() >= 3, "{statistics:?}");
    let keys = |value: &Value| {
        value
            .as_object()
            .unwrap()
            .keys()
            .cloned()
            .collect::<Vec<_>>()
    };
    assert_eq!(keys(&statistics[0]), keys(&counts[0]));
    let time = |value: &Value| {
        let [sec, nsec] = ["sec", "nsec"].map(|key| value["timestamp"][key].as_u64().unwrap());
        sec * 1_000_000_000 + nsec
    };
    let start = u64::try_from(START_US).unwrap() * 1000;
    let mut begin_s = 1.0;
    for (said, data) in statistics.iter().zip(of(&all, "/statistics")) {
        assert_eq!(time(said), data.time);
        let elapsed_s = (data.time - start) as f64 / 1e9;
        assert!((elapsed_s - begin_s).abs() < 1e-9, "{elapsed_s} {begin_s}");
        let duration_s = said["duration_s"].as_f64().unwrap();
        let events = said["events"].as_f64().unwrap();
        let rate = said["events_per_s"].as_f64().unwrap();
        assert!((rate * duration_s / events - 1.0).abs() < 1e-9);
        begin_s += duration_s;
    }
    // The end of the laser cycle of the last event.
    assert!((begin_s - 1.996).abs() < 1e-9, "{begin_s}");
    for count in ["events", "flagged", "deferred", "saturated", "blocks"] {
        let sum = |all: &[Value]| {
            all.iter()
                .map(|of| of[count].as_u64().unwrap())
                .sum::<u64>()
        };
        assert_eq!(sum(&statistics), sum(&counts), "{count}");
    }

    // Maps of the last events.
    let range = image(&last["/range"]);
    assert_eq!(range.iter().filter(|range| !range.is_nan()).count(), 200);
    for record in &exported {
        let number = |at: usize| f32::from_le_bytes(record[at..at + 4].try_into().unwrap());
        let pixel = u32::from_le_bytes(record[16..20].try_into().unwrap());
        let distance = (number(0).powi(2) + number(4).powi(2) + number(8).powi(2)).sqrt();
        let range = range[pixel as usize];
        assert!(
            (range - distance).abs() < 1e-5,
            "{pixel}: {range} {distance}"
        );
    }
    // 33 signal photons in 44 laser cycles.
    let reflectivity = image(&last["/reflectivity"]);
    for (range, reflectivity) in range.iter().zip(reflectivity) {
        assert_eq!(range.is_nan(), reflectivity.is_nan());
        let expected = 33.0 / 44.0 * range * range;
        assert!(range.is_nan() || (reflectivity / expected - 1.0).abs() < 1e-5);
    }
    let rates = of(&all, "/rate").map(image);
    let most = rates
        .flatten()
        .filter(|rate| !rate.is_nan())
        .fold(0.0, f32::max);
    // One event a pixel in a second, or a little more.
    assert!((0.3..=1.0).contains(&most), "{most}");

    let lines: Vec<String> = of(&all, "/log")
        .map(|data| field(&data.bytes, 3).text().to_owned())
        .collect();
    // The client may connect before or after the file is opened.
    assert!(lines.iter().any(|line| line == "playing"), "{lines:?}");
    assert_eq!(lines.last().unwrap(), "ended");
    assert_eq!(last["/losses"].json()["points_left_out"], 0);
    assert!(client.statuses.is_empty(), "{:?}", client.statuses);

    let sessions = client.infos.len();
    // When played again, time begins again: a new session with the same channels.
    post(live.port, "/speed", "{\"speed\":100.0}");
    post(live.port, "/play", "{\"on\":true}");
    client.until("again", |data| {
        data.topic == "/statistics" && data.json()["events_so_far"].as_u64() > Some(200)
    });
    let [before, now] = &client.infos[sessions - 1..] else {
        panic!("{:?}", client.infos);
    };
    assert_ne!(before["sessionId"], now["sessionId"]);
}

#[test]
fn changes_of_depth_are_clouds_of_their_own() {
    let scratch = Scratch::new();
    let (header, _) = recording();
    let events = [
        depth(1, 1000, 50),
        dynamic(2, 1001, 60, -3),
        depth(3, 1002, 70),
    ];
    let live = Live::with_foxglove(play(&scratch, "both.aer", &header, &events), None, &[]);
    let mut client = Client::open(live.foxglove);
    client.subscribe(&["/events", "/statistics"]);
    let all = client.until("all", |data| {
        data.topic == "/statistics" && data.json()["events_so_far"] == 3
    });
    let mut kinds = BTreeMap::new();
    for data in of(&all, "/events") {
        let names: Vec<String> = fields(&data.bytes)
            .iter()
            .filter(|(number, _)| *number == 5)
            .map(|(_, of)| field(of.bytes(), 1).text().to_owned())
            .collect();
        *kinds.entry(names[3].clone()).or_insert(0) += points([&data.bytes[..]].into_iter()).len();
    }
    assert_eq!(
        kinds,
        BTreeMap::from([("change".to_owned(), 1), ("intensity".to_owned(), 2)])
    );
}

#[test]
fn a_device_tells_every_loss_and_why_it_is_gone() {
    let plugged = plugged();
    let live = Live::with_foxglove(feed(&plugged.name, ""), None, &[]);
    let mut client = Client::open(live.foxglove);
    client.subscribe(&["/log", "/losses", "/events"]);
    let lost = client.until("photons", |data| {
        data.topic == "/losses" && data.json()["photons"].as_u64() > Some(0)
    });
    let lost = lost.last().unwrap().json();
    let schema = client.channels["/losses"]["schema"].as_str().unwrap();
    let schema: Value = serde_json::from_str(schema).unwrap();
    let keys = |value: &Value| {
        value
            .as_object()
            .unwrap()
            .keys()
            .cloned()
            .collect::<Vec<_>>()
    };
    assert_eq!(keys(&lost), keys(&schema["properties"]));
    // The same totals as on the page.
    let mut page = Stream::open(live.port, 0);
    let frame = page.until("losses", |frame| {
        frame["losses"]["photons"].as_u64() > Some(0)
    });
    let counts = frame["losses"]["counts"].as_array().unwrap();
    assert_eq!(counts.len(), 20);
    for name in counts.iter().map(|count| count[0].as_str().unwrap()) {
        assert!(lost[name.replace(' ', "_")].is_u64(), "{name}: {lost}");
    }
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let age = now.unwrap().as_secs() - client.next("/events").time / 1_000_000_000;
    assert!(age < 3600, "{age} s");
    plugged
        .pull
        .store(true, std::sync::atomic::Ordering::Relaxed);
    let is_line = |data: &Data, begin: &str| {
        data.topic == "/log" && field(&data.bytes, 3).text().starts_with(begin)
    };
    let gone = client.until("gone", |data| is_line(data, "gone: "));
    // An error.
    assert_eq!(field(&gone.last().unwrap().bytes, 2).number(), 4);
    // A page starts its sensor again.
    until("taken", || {
        post(live.port, "/settings", "[detection]\nl1 = 40\n").status == 200
    });
    client.until("live again", |data| is_line(data, "live"));
}
