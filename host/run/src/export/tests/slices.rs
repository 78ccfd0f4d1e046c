//! MCAP and ROS 2: a point cloud for each slice of time.

use ::mcap::records::Record;
use serde_json::{Value, json};

use super::*;
use crate::export::{mcap, points as points_of, ros2};

/// A message: topic, log time and data.
type Message = (String, u64, Vec<u8>);

/// All messages. Their numbers count from 0, and they are published when they are logged.
fn messages(bytes: &[u8]) -> Vec<Message> {
    let messages = ::mcap::MessageStream::new(bytes).unwrap();
    let messages = (0..).zip(messages).map(|(number, message)| {
        let message = message.unwrap();
        assert_eq!(message.sequence, number);
        assert_eq!(message.publish_time, message.log_time);
        (
            message.channel.topic.clone(),
            message.log_time,
            message.data.to_vec(),
        )
    });
    messages.collect()
}

fn times(bytes: &[u8], topic: &str) -> Vec<u64> {
    let messages = messages(bytes).into_iter();
    let messages = messages.filter(|message| message.0 == topic);
    messages.map(|message| message.1).collect()
}

fn statistics(bytes: &[u8]) -> Vec<Value> {
    let messages = messages(bytes).into_iter();
    let messages = messages.filter(|message| message.0 == "/statistics");
    messages
        .map(|message| serde_json::from_slice(&message.2).unwrap())
        .collect()
}

/// Profile, and of each channel topic, encoding, metadata and schema: name, encoding, data.
fn channels(bytes: &[u8]) -> (String, Vec<[String; 5]>, Vec<Vec<u8>>) {
    let mut records = ::mcap::read::LinearReader::new(bytes).unwrap();
    let Some(Ok(Record::Header(header))) = records.next() else {
        panic!("no header");
    };
    let summary = ::mcap::Summary::read(bytes).unwrap().unwrap();
    let mut channels: Vec<_> = summary.channels.values().collect();
    channels.sort_by_key(|channel| channel.id);
    let rows = channels.iter().map(|channel| {
        let schema = channel.schema.as_ref().unwrap();
        [
            channel.topic.clone(),
            channel.message_encoding.clone(),
            format!("{:?}", channel.metadata),
            schema.name.clone(),
            schema.encoding.clone(),
        ]
    });
    let data = channels
        .iter()
        .map(|channel| channel.schema.as_ref().unwrap().data.to_vec());
    (header.profile, rows.collect(), data.collect())
}

/// The packed points of events.
fn records(events: &[Event], header: &Header) -> Vec<u8> {
    points_of(events, header, &Options::default()).unwrap()
}

/// Slices of so many nanoseconds, with the default rays.
fn sliced(slice_ns: u64) -> Options {
    Options {
        slice_ns: Some(slice_ns),
        ..Options::default()
    }
}

/// A recording that began a second after 1970: two slices of 1 ms with events, out of order.
fn recording() -> (Header, [Event; 4]) {
    let header = Header {
        start_us: 1_000_000,
        ..header()
    };
    let flagged = |flags: Flags| move |event: &mut DepthEvent| event.flags = flags;
    let events = [
        depth_with(4, 7, 60, flagged(Flags::TAIL)),
        depth_with(4, 5, 60, flagged(Flags::SATURATED | Flags::CONFIRMED)),
        depth(5, 30_000, 60),
        block(0, 9_999, 60),
    ];
    (header, events)
}

/// The same events slice by slice, in order of time.
fn in_order([first, second, third, fourth]: [Event; 4]) -> [Vec<Event>; 2] {
    [vec![second, first, fourth], vec![third]]
}

#[test]
fn foxglove_gets_a_cloud_and_statistics_of_each_slice() {
    let (header, events) = recording();
    let (summary, out) = exported(
        &file_with(&header, &events),
        Format::Mcap,
        &sliced(1_000_000),
    );
    assert_eq!((summary.written, summary.late), (4, 0));
    let [first, second] = in_order(events).map(|events| records(&events, &header));
    let cloud = |time, data| foxglove::cloud(EventKind::Depth, time, data).unwrap();
    let begins = [1_000_000_000, 1_003_000_000];
    let clouds = [cloud(begins[0], first), cloud(begins[1], second)];
    let messages = messages(&out);
    let topics: Vec<(&str, u64)> = messages
        .iter()
        .map(|(topic, time, _)| (&**topic, *time))
        .collect();
    let expected = begins.map(|time| [("/events", time), ("/statistics", time)]);
    assert_eq!(topics, expected.concat());
    assert_eq!([&messages[0].2, &messages[2].2], [&clouds[0], &clouds[1]]);
    assert_eq!(
        statistics(&out),
        [
            json!({
                "timestamp": { "sec": 1, "nsec": 0 },
                "duration_s": 0.001,
                "events": 3,
                "events_per_s": 3000.0,
                "pixels": 2,
                "flagged": 2,
                "saturated": 1,
                "clipped": 0,
                "deferred": 0,
                "pile_up": 0,
                "tail": 1,
                "blocks": 1,
                "events_so_far": 3,
            }),
            // It ends with the laser cycle of the last event.
            json!({
                "timestamp": { "sec": 1, "nsec": 3_000_000 },
                "duration_s": 1e-7,
                "events": 1,
                "events_per_s": 1e7,
                "pixels": 1,
                "flagged": 0,
                "saturated": 0,
                "clipped": 0,
                "deferred": 0,
                "pile_up": 0,
                "tail": 0,
                "blocks": 0,
                "events_so_far": 4,
            }),
        ]
    );

    let (profile, rows, schemas) = channels(&out);
    assert_eq!(profile, "");
    let events = [
        "/events",
        "protobuf",
        "{}",
        "foxglove.PointCloud",
        "protobuf",
    ];
    let statistics = ["/statistics", "json", "{}", "dtof.Statistics", "jsonschema"];
    assert_eq!(rows, [events, statistics]);
    let point_cloud = <::foxglove::messages::PointCloud as ::foxglove::Encode>::get_schema();
    assert_eq!(schemas[0], &*point_cloud.unwrap().data);
}

#[test]
fn ros2_gets_a_cloud_of_each_slice() {
    let (header, events) = recording();
    let (summary, out) = exported(
        &file_with(&header, &events),
        Format::Ros2,
        &sliced(1_000_000),
    );
    assert_eq!((summary.written, summary.late), (4, 0));
    let [first, second] = in_order(events).map(|events| records(&events, &header));
    let fields = points_of::fields(EventKind::Depth);
    let message = |time, data: &[u8]| {
        let cloud = ros2::cloud(&fields, "dtof_optical", time, data).unwrap();
        ("/dtof/points".to_owned(), time, cloud)
    };
    let expected = [
        message(1_000_000_000, &first),
        message(1_003_000_000, &second),
    ];
    assert_eq!(messages(&out), expected);

    let (profile, rows, schemas) = channels(&out);
    assert_eq!(profile, "ros2");
    let qos = "{\"offered_qos_profiles\": \"\"}";
    let points = [
        "/dtof/points",
        "cdr",
        qos,
        "sensor_msgs/msg/PointCloud2",
        "ros2msg",
    ];
    assert_eq!(rows, [points]);
    assert!(schemas[0].starts_with(b"std_msgs/Header header\nuint32 height\n"));
}

#[test]
fn each_flag_is_counted() {
    let events = (0..64).map(|bits| {
        let flags = Flags::from_bits(bits).unwrap();
        depth_with(0, bits.into(), 60, |event| event.flags = flags)
    });
    let events: Vec<Event> = events.collect();
    let (_, out) = exported(&file(&events), Format::Mcap, &sliced(1_000_000));
    let [slice] = &statistics(&out)[..] else {
        panic!("not one slice");
    };
    for name in ["saturated", "clipped", "deferred", "pile_up", "tail"] {
        assert_eq!(slice[name], 32, "{name}");
    }
    assert_eq!(
        (&slice["flagged"], &slice["events"]),
        (&json!(63), &json!(64))
    );
}

#[test]
fn a_slice_is_a_hundredth_of_the_run_from_10_us_to_10_ms_in_whole_microseconds() {
    for (end_ns, expected) in [
        (1, 10_000),
        (1_000_000, 10_000),
        (1_000_001, 11_000),
        (15_000_000, 150_000),
        (1_000_000_000, 10_000_000),
        (u64::MAX, 10_000_000),
    ] {
        assert_eq!(mcap::slice_of(end_ns), expected, "{end_ns}");
    }
    // It is that if no other is requested. The last laser cycle of 15 ms is number 149,999.
    let bytes = file(&[
        depth(0, 1500, 60),
        depth(0, 2999, 60),
        depth(0, 149_999, 60),
    ]);
    let (_, out) = exported(&bytes, Format::Mcap, &Options::default());
    assert_eq!(times(&out, "/events"), [150_000, 14_850_000]);
}

/// The beginning and the end of a laser cycle are in one nanosecond.
#[test]
fn a_slice_lasts_a_nanosecond_at_least() {
    let header = Header {
        laser_millihertz: 10_000_000_000_000,
        ..header()
    };
    let (_, out) = exported(
        &file_with(&header, &[depth(0, 10, 60)]),
        Format::Mcap,
        &sliced(1),
    );
    let [slice] = &statistics(&out)[..] else {
        panic!("not one slice");
    };
    let rate = [
        &slice["timestamp"]["nsec"],
        &slice["duration_s"],
        &slice["events_per_s"],
    ];
    assert_eq!(rate, [&json!(1), &json!(1e-9), &json!(1e9)]);
}

#[test]
fn a_message_has_65536_points_at_most_and_as_many_events_wait_for_earlier_ones() {
    // One event every 100 ns, then one of the first laser cycle, and one of the cycle that has been written.
    let events = (1000..)
        .take((1 << 16) + 1)
        .map(|cycle| depth(0, cycle, 60));
    let events: Vec<Event> = events
        .chain([depth(0, 0, 60), depth(0, 1000, 60)])
        .collect();
    let bytes = file(&events);
    let (summary, out) = exported(&bytes, Format::Mcap, &sliced(1_000_000_000));
    assert_eq!((summary.written, summary.late), ((1 << 16) + 2, 1));
    // The second message has the time of its first point: two are of laser cycle 1000.
    let last = 100 * (1000 + (1 << 16) - 1);
    assert_eq!(times(&out, "/events"), [0, last]);
    assert_eq!(times(&out, "/statistics"), [0]);

    let mut changes = vec![dynamic(0, 0, 1000, 60, 1); (1 << 16) + 1];
    changes.push(dynamic(0, 0, 0, 60, 1));
    let (summary, _) = exported(&file(&changes), Format::Evt2, &Options::default());
    assert_eq!((summary.written, summary.late), ((1 << 16) + 1, 1));
}

#[test]
fn files_without_events_have_channels_but_no_messages() {
    for (format, expected) in [(Format::Mcap, 2), (Format::Ros2, 1)] {
        let (summary, out) = exported(&file(&[]), format, &options());
        assert_eq!((summary.written, summary.damage), (0, None));
        assert_eq!(
            (messages(&out).len(), channels(&out).1.len()),
            (0, expected)
        );
    }
}
