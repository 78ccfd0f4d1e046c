//! Clients: who may connect, several at a time, and those that read slowly or not at all.

use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdout, Stdio};
use std::time::{Duration, Instant};

use dtof_core::Array;
use serde_json::json;
use tungstenite::Message;

use super::client::{Client, PROTOCOL, shake};
use super::{of, play, points, recording};
use crate::common::aer::{depth, file};
use crate::common::{Scratch, assert_contains};
use crate::view::http::{Stream, post};
use crate::view::{Live, fast, until};
use dtof_data::events::aer_file::{Header, Reader};
use dtof_live::MOST_CLIENTS;

#[test]
fn pages_of_other_sites_read_nothing() {
    let scratch = Scratch::new();
    let (header, events) = recording();
    let origin = "http://localhost:8080";
    let feed = play(&scratch, "events.aer", &header, &events);
    let live = Live::with_foxglove(feed, None, &[origin]);
    let protocol = ("sec-websocket-protocol", PROTOCOL);
    for origin in ["https://example.com", "null", "http://localhost:8081"] {
        let refused = shake(live.foxglove, &[protocol, ("origin", origin)]);
        assert_eq!(refused.unwrap_err(), 403, "{origin}");
    }
    // A name of another site that points here.
    let refused = shake(live.foxglove, &[protocol, ("host", "example.com:8765")]);
    assert_eq!(refused.unwrap_err(), 403);
    for origin in ["https://app.foxglove.dev", "file://", origin] {
        let mut socket = shake(live.foxglove, &[protocol, ("origin", origin)]).unwrap();
        assert_contains(socket.read().unwrap().to_text().unwrap(), "serverInfo");
    }
    for offered in ["chat", "foxglove.sdk.v2", "foxglove.sdk.v11"] {
        let refused = shake(live.foxglove, &[("sec-websocket-protocol", offered)]);
        assert_eq!(refused.unwrap_err(), 400, "{offered}");
    }
    let offered = (
        "sec-websocket-protocol",
        "foxglove.sdk.v1.1, foxglove.sdk.v1",
    );
    assert!(shake(live.foxglove, &[offered]).is_ok());
}

#[test]
fn clients_want_different_things_leave_and_come_back() {
    let live = Live::with_foxglove(fast::feed(Some(10_000)), None, &[]);
    let mut clients = [(); 2].map(|()| Client::open(live.foxglove));
    clients[0].subscribe(&["/events"]);
    clients[1].subscribe(&["/range", "/losses"]);
    let mut count = 0;
    let clouds = clients[0].until("clouds", |_| {
        count += 1;
        count == 10
    });
    assert_eq!(of(&clouds, "/events").count(), 10);
    clients[1].next("/range");
    clients[1].unsubscribe("/range");
    clients[1].subscribe(&["/rate"]);
    // The first rates cover a second.
    clients[1].next("/rate");
    let later = clients[1].until("losses", |data| data.topic == "/losses");
    assert!(of(&later, "/range").next().is_none());
    // Events without a subscriber are not kept.
    let [first, second] = clients;
    drop(first);
    until("nothing is kept", || live.hub.memory()[1] == 0);
    std::thread::sleep(Duration::from_secs(1));
    let mut again = Client::open(live.foxglove);
    assert_eq!(
        again.infos[0]["sessionId"],
        second.infos.last().unwrap()["sessionId"]
    );
    again.subscribe(&["/statistics"]);
    // Only events since the subscription are sent.
    let first = again.next("/statistics").json();
    assert!(first["duration_s"].as_f64() < Some(0.9), "{first}");
    again.subscribe(&["/events", "/log"]);
    assert!(!points([&again.next("/events").bytes[..]].into_iter()).is_empty());
    // More clients than allowed: the last is served when another has gone.
    drop((again, second));
    let mut many: Vec<Client> = (0..MOST_CLIENTS)
        .map(|_| Client::open(live.foxglove))
        .collect();
    let port = live.foxglove;
    let last = std::thread::spawn(move || Client::open(port));
    std::thread::sleep(Duration::from_millis(300));
    assert!(!last.is_finished());
    many.pop();
    last.join().unwrap();
}

/// A slow client affects neither memory nor the recording, and is disconnected.
#[test]
fn a_client_that_reads_nothing_costs_nothing() {
    let scratch = Scratch::new();
    let out = scratch.path("out");
    let live = Live::with_foxglove(fast::feed(None), Some(&out), &[]);
    Stream::open(live.port, 0).until("live", |frame| frame["connection"]["state"] == "live");
    assert_eq!(post(live.port, "/record", "{\"on\":true}").status, 200);
    let mut stuck = Client::open(live.foxglove);
    stuck.subscribe_all();
    let mut good = Client::open(live.foxglove);
    good.subscribe(&["/statistics", "/losses"]);
    let most = 65_536 + 3 * 256;
    let lost = good.until("much more", |data| {
        assert!(live.hub.memory()[1] <= most);
        data.topic == "/losses" && data.json()["events"].as_u64() > Some(1_000_000)
    });
    assert!(lost.len() > 3);
    until("a client less", || {
        // Disconnected: the rest of the socket's buffers arrives, then the end.
        let _ = good.read();
        is_closed(&mut stuck)
    });
    let before = good.next("/losses").json()["events"].as_u64().unwrap();
    let answer = post(live.port, "/record", "{\"on\":false}").body;
    assert_contains(&answer, "Saved ");
    let file = fs::read_dir(&out).unwrap().next().unwrap().unwrap().path();
    let mut reader = Reader::new(BufReader::new(File::open(file).unwrap())).unwrap();
    let (mut events, mut last) = (0, 0);
    while let Some(event) = reader.next_event().unwrap() {
        // Events are ten laser cycles apart: none is missing.
        assert!(last == 0 || event.cycle().raw() == last + 10);
        last = event.cycle().raw();
        events += 1;
    }
    assert!(events >= 1_000_000 && before >= 1_000_000, "{events}");
    live.end();
}

/// Returns whether the server has closed, without reading its data.
fn is_closed(client: &mut Client) -> bool {
    // A closed connection answers with a reset only.
    let stream = client.socket.get_mut();
    stream.write_all(&[0x89, 0x80, 0, 0, 0, 0]).is_err()
}

#[test]
fn a_client_that_reads_slowly_is_told_what_it_missed() {
    let live = Live::with_foxglove(fast::feed(None), None, &[]);
    let mut slow = Client::open(live.foxglove);
    slow.subscribe_all();
    let mut reads = 0;
    while slow.statuses.is_empty() {
        reads += 1;
        assert!(reads < 2000);
        slow.read();
        // Less often than there are messages.
        std::thread::sleep(Duration::from_millis(if reads < 20 { 400 } else { 0 }));
    }
    let status = &slow.statuses[0];
    assert_eq!(
        (&status["level"], &status["id"]),
        (&json!(1), &json!("slow"))
    );
    assert_contains(status["message"].as_str().unwrap(), "frames were left out");
}

/// Half a megabyte of images ten times a second that the client does not read.
#[cfg(target_os = "linux")]
#[test]
fn memory_does_not_grow_while_a_client_reads_nothing() {
    let scratch = Scratch::new();
    let header = Header {
        array: Array::new(256, 256).unwrap(),
        ..recording().0
    };
    let events = (0..2000).map(|number| depth(number, 20 * u64::from(number), 40));
    scratch.file("large.aer", file(&header, &events.collect::<Vec<_>>()));
    let mut programs = [(); 3].map(|()| Program::start(&scratch, "view large.aer --foxglove=0"));
    let mut stuck = Client::open(programs[0].port);
    stuck.subscribe_all();
    // Each ping causes an answer that is not read either: those of all these would be 76 MB.
    let mut asks = Client::open(programs[1].port);
    let stream = asks.socket.get_mut();
    stream
        .set_write_timeout(Some(Duration::from_secs(1)))
        .unwrap();
    let ping = Message::Ping(vec![0; 125].into());
    // Shorter than the time until they are disconnected.
    let begun = Instant::now();
    for _ in 0..600_000 {
        if begun.elapsed() > Duration::from_secs(8) || asks.socket.send(ping.clone()).is_err() {
            break;
        }
    }
    std::thread::sleep(Duration::from_secs(8).saturating_sub(begun.elapsed()));
    let [images, pings, none] = [0, 1, 2].map(|number| programs[number].peak_kb());
    println!("view: {images} kB with unread images, {pings} kB with unread answers, {none} kB");
    // A few frames wait; 40 MB if all were kept.
    assert!(images < none + 25_000, "{images} kB, {none} kB without");
    // 8 MB of answers in a buffer that doubles; hundreds if all were kept.
    assert!(pings < none + 50_000, "{pings} kB, {none} kB without");
    for program in &mut programs {
        assert_eq!(program.end(), "");
    }
}

/// The running program.
struct Program {
    child: Child,
    out: BufReader<ChildStdout>,
    page: String,
    port: u16,
}

impl Program {
    fn start(scratch: &Scratch, line: &str) -> Self {
        let mut command = scratch.command(line);
        let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        let mut lines = [String::new(), String::new()];
        for line in &mut lines {
            out.read_line(line).unwrap();
        }
        let [page, address] = lines;
        let port = address.trim().strip_prefix("ws://127.0.0.1:").unwrap();
        Self {
            child,
            out,
            page,
            port: port.parse().unwrap(),
        }
    }

    #[cfg(target_os = "linux")]
    fn peak_kb(&self) -> u64 {
        let status = format!("/proc/{}/status", self.child.id());
        let status = fs::read_to_string(status).unwrap();
        let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let peak = peak.and_then(|peak| peak.trim().strip_suffix(" kB"));
        peak.unwrap().parse().unwrap()
    }

    /// Ends the program and returns its standard error.
    fn end(&mut self) -> String {
        self.child.kill().unwrap();
        let mut printed = String::new();
        let mut stderr = self.child.stderr.take().unwrap();
        stderr.read_to_string(&mut printed).unwrap();
        self.child.wait().unwrap();
        // Standard output has the addresses only.
        assert_eq!(self.out.read_line(&mut String::new()).unwrap(), 0);
        printed
    }
}

#[test]
fn the_command_says_where_foxglove_connects_and_what_is_wrong() {
    let scratch = Scratch::new();
    let (header, events) = recording();
    scratch.file("events.aer", file(&header, &events));
    let holder = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = holder.local_addr().unwrap().port();
    let output = scratch.run(&format!("view events.aer --foxglove={taken}"));
    scratch.refused(&output, &[format!("--foxglove {taken}: ")]);
    scratch.all_refused(
        "view",
        "events.aer --foxglove=65536 | --foxglove
         events.aer --foxglove=localhost:8765 | --foxglove
         events.aer --foxglove-origin http://localhost:8080 | --foxglove
         events.aer --foxglove --foxglove-origin * | must be http://HOST",
    );
    let mut program = Program::start(&scratch, "view events.aer --speed 0.1 --foxglove=0");
    assert_contains(&program.page, "http://127.0.0.1:");
    Client::open(program.port);
    // The terminal shows once why a page cannot connect.
    for _ in 0..2 {
        let headers = [
            ("sec-websocket-protocol", PROTOCOL),
            ("origin", "http://localhost:9"),
        ];
        assert_eq!(shake(program.port, &headers).unwrap_err(), 403);
    }
    let printed = program.end();
    assert_eq!(printed.lines().count(), 1, "{printed}");
    assert_contains(&printed, "--foxglove-origin http://localhost:9 ");
}
