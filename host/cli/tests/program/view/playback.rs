//! Recordings, played at the rate of their laser.

use std::time::{Duration, Instant};

use crate::common::aer::{HEADER, depth, file};
use crate::common::{Scratch, assert_contains};
use crate::view::Live;
use crate::view::http::{Stream, post};
use dtof_data::events::aer_file::{Header, Reader};
use dtof_live::{Feed, Playback};

/// Ten events in a second: one laser cycle a millisecond.
fn recording() -> Vec<u8> {
    let header = Header {
        laser_millihertz: 1_000_000,
        ..HEADER
    };
    let events: Vec<_> = (1..=10)
        .map(|number| depth(number, 100 * u64::from(number), 60))
        .collect();
    file(&header, &events)
}

#[test]
fn a_recording_is_played_at_its_rate_paused_and_played_again() {
    let scratch = Scratch::new();
    let path = scratch.file("events.aer", recording());
    let begun = Instant::now();
    let live = Live::of(
        Feed::Playback(Playback::new(path, None, 0.4).unwrap()),
        None,
    );
    let mut page = Stream::open(live.port, 5);
    let frame = page.until("begun", |frame| frame["source"]["laserHz"] == 1000.0);
    assert_eq!(frame["source"]["kind"], "recording");
    let frame = page.until("some", |frame| frame["events"].as_u64() >= Some(2));
    // One each quarter of a second.
    assert!(begun.elapsed() > Duration::from_millis(450) && frame["events"].as_u64() < Some(10));
    assert_contains(&post(live.port, "/play", "{\"on\":false}").body, "paused");
    let frame = page.until("paused", |frame| frame["connection"]["state"] == "paused");
    for _ in 0..5 {
        assert_eq!(page.frame()["events"], frame["events"]);
    }
    post(live.port, "/speed", "{\"speed\":100.0}");
    assert_contains(&post(live.port, "/play", "{\"on\":true}").body, "playing");
    let frame = page.until("the end", |frame| frame["connection"]["state"] == "ended");
    assert_eq!(frame["events"], 10);
    post(live.port, "/play", "{\"on\":true}");
    page.until("again", |frame| frame["events"] == 20);
    // Commands that a recording does not support are refused.
    for (path, body, reason) in [
        (
            "/settings",
            "[detection]\nl1 = 4",
            "a recording has no settings to change",
        ),
        ("/save", "{}", "a recording has no settings to change"),
        ("/record", "{\"on\":true}", "this is a recording already"),
    ] {
        let answer = post(live.port, path, body);
        assert_eq!((answer.status, answer.body.trim()), (422, reason));
    }
}

#[test]
fn a_recording_waits_for_its_first_page() {
    let scratch = Scratch::new();
    let path = scratch.file("events.aer", recording());
    let feed = Feed::Playback(Playback::new(path, None, 100.0).unwrap());
    let live = Live::of(feed, None);
    // Ten times as long as it lasts.
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(live.hub.arrived(), 0);
    let mut page = Stream::open(live.port, 0);
    page.until("the end", |frame| frame["connection"]["state"] == "ended");
    assert_eq!(live.hub.arrived(), 10);
}

#[test]
fn a_recording_can_be_moved_to_a_place_and_change_its_speed() {
    let scratch = Scratch::new();
    let path = scratch.file("events.aer", recording());
    let feed = Feed::Playback(Playback::new(path, None, 1e-6).unwrap());
    let live = Live::of(feed, None);
    let mut page = Stream::open(live.port, 5);
    let frame = page.until("playing", |frame| frame["connection"]["state"] == "playing");
    let playhead = &frame["playhead"];
    assert_eq!(playhead["length"], 1.0);
    assert_eq!(
        (&playhead["all"], &playhead["speed"]),
        (&10.into(), &1e-6.into())
    );
    // The page shows what has come until then, and nothing later.
    for (seconds, events) in [(0.55, 5), (0.95, 9), (0.0, 0), (0.35, 3)] {
        let body = format!("{{\"seconds\":{seconds}}}");
        assert_eq!(post(live.port, "/seek", &body).status, 200);
        let frame = page.until("moved", |frame| frame["playhead"]["events"] == events);
        assert!((frame["playhead"]["seconds"].as_f64().unwrap() - seconds).abs() < 1e-3);
        assert_eq!(frame["connection"]["state"], "playing");
        let frame = page.until("all pixels", |frame| frame["drawn"]["left"] == 0);
        assert_eq!(frame["playhead"]["events"], events);
    }
    assert_eq!(post(live.port, "/speed", "{\"speed\":1000.0}").status, 200);
    let frame = page.until("the end", |frame| frame["connection"]["state"] == "ended");
    assert_eq!(frame["playhead"]["speed"], 1000.0);
    assert_eq!(
        (&frame["playhead"]["seconds"], &frame["playhead"]["events"]),
        (&1.0.into(), &10.into())
    );
    // It plays on from a place before its end. A place after its end is its end.
    post(live.port, "/speed", "{\"speed\":0.001}");
    post(live.port, "/seek", "{\"seconds\":0.5}");
    page.until("playing", |frame| frame["connection"]["state"] == "playing");
    post(live.port, "/play", "{\"on\":false}");
    post(live.port, "/seek", "{\"seconds\":0.25}");
    let frame = page.until("paused", |frame| frame["playhead"]["events"] == 2);
    assert_eq!(frame["connection"]["state"], "paused");
    post(live.port, "/seek", "{\"seconds\":1e300}");
    page.until("the end", |frame| frame["connection"]["state"] == "ended");
    for (path, body, status) in [
        ("/speed", "{\"speed\":0}", 422),
        ("/speed", "{\"speed\":-1}", 422),
        ("/speed", "{\"speed\":1e999}", 400),
        ("/seek", "{\"seconds\":-1}", 200),
        ("/seek", "{\"seconds\":\"1\"}", 400),
    ] {
        assert_eq!(post(live.port, path, body).status, status, "{path} {body}");
    }
}

#[test]
fn a_recording_is_played_faster_and_a_damaged_one_is_named() {
    let scratch = Scratch::new();
    let mut bytes = recording();
    let path = scratch.file("events.aer", &bytes);
    // A hundred seconds of a slower laser.
    let live = Live::of(
        Feed::Playback(Playback::new(path, Some(10), 100.0).unwrap()),
        None,
    );
    let begun = Instant::now();
    Stream::open(live.port, 0).until("the end", |frame| frame["events"] == 10);
    assert!(begun.elapsed() < Duration::from_secs(30));

    // A bit that only the checksum detects, and a truncated file.
    let cut = bytes[..64 + 16 * 5 + 7].to_vec();
    bytes[64 + 16 * 5] ^= 1;
    for (bytes, events) in [(bytes, 10), (cut, 4)] {
        let path = scratch.file("damaged.aer", bytes);
        let live = Live::of(
            Feed::Playback(Playback::new(path, None, 100.0).unwrap()),
            None,
        );
        let mut page = Stream::open(live.port, 0);
        let frame = page.until("failed", |frame| frame["connection"]["state"] == "failed");
        let reason = frame["connection"]["reason"].as_str().unwrap();
        assert_contains(reason, "damaged.aer: byte ");
        // The events before the damage are shown, and can be shown again.
        assert_eq!(frame["events"], events);
        assert_eq!(frame["playhead"]["all"], events);
        post(live.port, "/seek", "{\"seconds\":0}");
        page.until("again", |frame| frame["events"] == 2 * events);
    }
}

/// As `export` does.
#[test]
fn a_recording_without_a_laser_rate_is_played_at_10_mhz() {
    let scratch = Scratch::new();
    let path = scratch.file("slow.aer", file(&HEADER, &[depth(1, 1000, 60)]));
    let playback = Playback::new(path.clone(), None, 1.0).unwrap();
    let warning = playback.warning.clone().unwrap();
    assert_contains(
        &warning,
        "the laser rate is not known; times are for 10 MHz",
    );
    let live = Live::of(Feed::Playback(playback), None);
    let frame = Stream::open(live.port, 0).until("the end", |frame| frame["events"] == 1);
    assert_eq!(frame["playhead"]["length"], 1e-4);
    let told = post(live.port, "/seek", "{\"seconds\":1}");
    assert_contains(&told.body, "The recording is at 0.100 ms.");
    assert_eq!(Playback::new(path, Some(10), 1.0).unwrap().warning, None);
}

#[test]
fn the_command_says_what_is_wrong() {
    let scratch = Scratch::new();
    scratch.file("slow.aer", file(&HEADER, &[depth(1, 5, 60)]));
    scratch.file("none.aer", "no");
    scratch.all_refused(
        "view",
        "none.aer | none.aer: not an AER file
         gone.aer | gone.aer: 
         --out x | <FILE.aer> is needed
         slow.aer --device qemu | cannot be used with
         slow.aer --laser-hz 5 --alpha 4 | slow.aer: a recording has its own settings
         slow.aer --laser-hz 5 --pixels 4 | leave out the options of a device
         slow.aer --out x | cannot be used with
         slow.aer --speed 0 | must be a number above 0
         --device tcp:127.0.0.1:1 --settings gone.toml | gone.toml",
    );
}

/// The output of `dtof LINE`, which Ctrl-C ends once its page shows what `is_reached`.
#[cfg(unix)]
fn ended_by_ctrl_c(
    scratch: &Scratch,
    line: &str,
    is_reached: fn(&serde_json::Value) -> bool,
) -> std::process::Output {
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};

    let mut command = scratch.command(line);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut program = command.spawn().unwrap();
    let mut line = String::new();
    let mut out = BufReader::new(program.stdout.take().unwrap());
    out.read_line(&mut line).unwrap();
    let port = line.trim().strip_prefix("http://127.0.0.1:").unwrap();
    let port = port.trim_end_matches('/').parse().unwrap();
    // The page stays open.
    let mut stream = Stream::open(port, 0);
    stream.until("reached", is_reached);
    let killed = Command::new("kill")
        .args(["-INT", &program.id().to_string()])
        .status();
    assert!(killed.unwrap().success());
    program.wait_with_output().unwrap()
}

#[cfg(unix)]
#[test]
fn the_terminal_names_a_damaged_recording() {
    let scratch = Scratch::new();
    let whole = recording();
    let header = Reader::new(&whole[..]).unwrap().offset();
    let header = usize::try_from(header).unwrap();
    // At its end, and at its first event.
    for length in [whole.len() - 7, header + 7] {
        scratch.file("damaged.aer", &whole[..length]);
        let output = ended_by_ctrl_c(&scratch, "view damaged.aer --speed 100", |frame| {
            frame["connection"]["state"] == "failed"
        });
        let lines = String::from_utf8(output.stderr).unwrap();
        assert_contains(&lines, "damaged.aer: byte ");
        assert_eq!(lines.lines().count(), 1, "{lines}");
    }
}

#[cfg(unix)]
#[test]
fn the_command_prints_its_address_and_ends_at_ctrl_c() {
    let scratch = Scratch::new();
    scratch.file("events.aer", recording());
    let output = ended_by_ctrl_c(&scratch, "view events.aer --speed 0.5", |frame| {
        frame["events"].as_u64() > Some(0)
    });
    assert!(
        output.status.success() && output.stderr.is_empty(),
        "{output:?}"
    );
    // Two programs cannot share a port.
    let holder = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = holder.local_addr().unwrap().port();
    let output = scratch.run(&format!("view events.aer --port {taken}"));
    scratch.refused(&output, &[format!("--port {taken}: ")]);
}
