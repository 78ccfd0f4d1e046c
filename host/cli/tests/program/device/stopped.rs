//! Sensors that stop: at the end of a session in whatever way, while the host is silent, and with
//! a device that fails.

use std::io::Read;
use std::process::Stdio;
use std::thread;
use std::time::{Duration, Instant};

use crate::common::port;
use crate::common::{Scratch, names};
use crate::device::monitor::LONG;
use crate::device::wall_sensor::{self, WALL, WallSensor};
use crate::device::{client, listen, serve, settings};
use dtof_device::{Client, HostTimeout, Stopped, Task};
use dtof_firmware::sidecar::Sidecar;
use dtof_link::{Report, Source, StopReason};
use dtof_sensors::Sensor;

const PIXELS: u16 = 4;

/// A device's report on its sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct SensorState {
    starts: u32,
    stops: u32,
    reason: Option<StopReason>,
}

/// One device that serves one connection after another. `reason` is that of its last stop before.
fn device(reason: Option<StopReason>) -> String {
    device_of(500, reason)
}

/// The same, with more events than a pipe holds in a second or two.
fn bright() -> String {
    device_of(200_000, None)
}

fn device_of(cycles_per_second: u32, reason: Option<StopReason>) -> String {
    let mut sensor = port::sensor(PIXELS, 20, cycles_per_second);
    let pixels = Box::leak(Box::new(heapless::Vec::<_, { PIXELS as usize }>::new()));
    let blocks = Box::leak(Box::new(heapless::Vec::<_, 1>::new()));
    let mut sidecar = Sidecar::new(pixels, blocks, Some(sensor.info()));
    sidecar.set_stop_reason(reason);
    listen(move |stream| {
        let poll = |sidecar: &mut Sidecar<'_>, now| sidecar.poll_sensor(&mut sensor, now);
        let _ = serve(stream, &mut sidecar, LONG, poll);
        true
    })
}

/// The device's report to the next host.
fn sensor_state(name: &str) -> SensorState {
    let report: Report = client(name).report().unwrap();
    SensorState {
        starts: report.sensor_starts,
        stops: report.sensor_stops,
        reason: StopReason::from_number(report.stop_reason),
    }
}

const ENDED: SensorState = SensorState {
    starts: 1,
    stops: 1,
    reason: Some(StopReason::EndOfSession),
};

/// Longer than a test takes.
fn longest() -> HostTimeout {
    HostTimeout::from_milliseconds(60_000).unwrap()
}

/// Has the device take photons from its sensor.
fn start(client: &mut Client, host_timeout: HostTimeout) {
    let task = Task {
        settings: &settings(),
        pixels: PIXELS,
        columns: 2,
        dynamic_depth: None,
        host_timeout,
    };
    let configuration = task.configuration(Source::Sensor).unwrap();
    client.configure(&configuration).unwrap();
    assert_eq!(
        Stopped::check(&client.report().unwrap(), host_timeout),
        Ok(())
    );
}

#[test]
fn a_client_that_is_dropped_ends_its_session() {
    let name = device(None);
    let mut client = client(&name);
    start(&mut client, longest());
    let since = Instant::now();
    drop(client);
    assert!(since.elapsed() < Duration::from_millis(290), "not answered");
    assert_eq!(sensor_state(&name), ENDED);
}

/// A panic also drops the client.
#[test]
fn a_thread_that_panics_ends_its_session() {
    let name = device(None);
    let ended = thread::spawn({
        let name = name.clone();
        move || {
            let mut client = client(&name);
            start(&mut client, longest());
            panic!("on purpose");
        }
    });
    assert!(ended.join().is_err());
    assert_eq!(sensor_state(&name), ENDED);
}

/// `dtof LINE --device NAME` with its output in pipes.
fn spawned(scratch: &Scratch, line: &str, name: &str) -> std::process::Child {
    let mut command = scratch.command(&format!("{line} --device {name}"));
    let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().unwrap()
}

/// Reads all output.
fn rest(mut from: impl Read) -> String {
    let mut text = String::new();
    from.read_to_string(&mut text).unwrap();
    text
}

/// For instance a pager that is not read. Earlier output is complete.
#[test]
fn an_output_that_blocks_stops_the_sensor_and_ends_the_command_with_the_reason() {
    let scratch = Scratch::new();
    let name = bright();
    let line =
        "monitor --pixels 4 --columns 2 --x 4 --l1 20 --host-timeout 0.3 --record events.aer";
    let mut monitor = spawned(&scratch, line, &name);
    // The pipe is full long before that.
    thread::sleep(Duration::from_millis(2_500));
    let events = rest(monitor.stdout.take().unwrap());
    let stderr = rest(monitor.stderr.take().unwrap());
    assert_eq!(monitor.wait().unwrap().code(), Some(1), "{stderr}");
    let error = stderr.lines().last().unwrap();
    assert_eq!(
        error,
        format!("error: {name}: the sensor has stopped: the host was silent for 0.3 s")
    );
    assert!(events.len() > 1 << 16, "{}", events.len());
    assert!(scratch.printed("decode events.aer") == events);
    assert_eq!(names(&scratch.path("")), ["events.aer"]);
    let expected = SensorState {
        reason: Some(StopReason::Silence),
        ..ENDED
    };
    assert_eq!(sensor_state(&name), expected);
}

#[test]
fn a_command_that_fails_stops_the_sensor() {
    let scratch = Scratch::new();
    let name = device(None);
    // Its data is lost.
    let full = std::fs::File::options().write(true).open("/dev/full");
    let Ok(full) = full else {
        return;
    };
    let mut command = scratch.command(&format!(
        "monitor --pixels 4 --host-timeout 60 --device {name}"
    ));
    let status = command.stdout(full).stderr(Stdio::null()).status();
    assert_eq!(status.unwrap().code(), Some(1));
    assert_eq!(sensor_state(&name), ENDED);
}

#[test]
fn a_calibration_that_is_silent_ends_with_the_reason() {
    let name = wall_sensor::device(WallSensor::new(WALL), LONG);
    let timeout = HostTimeout::from_milliseconds(200).unwrap();
    let mut calls = 0;
    let collected = dtof_device::histograms::collect(
        &mut client(&name),
        &settings(),
        wall_sensor::PIXELS,
        timeout,
        |so_far| {
            calls += 1;
            if calls == 100 {
                thread::sleep(Duration::from_millis(600));
            }
            so_far.elapsed > Duration::from_secs(3)
        },
    );
    assert_eq!(
        collected.unwrap_err().to_string(),
        "the sensor has stopped: the host was silent for 0.2 s"
    );
}

/// A device that fails so long after it was configured, and its reason.
fn failing(reason: Option<StopReason>) -> String {
    listen(move |stream| {
        let mut sensor = port::sensor(PIXELS, 20, 500);
        let fresh = |reason| {
            let pixels = Box::leak(Box::new(heapless::Vec::<_, { PIXELS as usize }>::new()));
            let blocks = Box::leak(Box::new(heapless::Vec::<_, 1>::new()));
            let info = port::sensor(PIXELS, 20, 500).info();
            let mut sidecar = Sidecar::new(pixels, blocks, Some(info));
            sidecar.set_stop_reason(reason);
            sidecar
        };
        let mut sidecar = fresh(None);
        let mut has_failed = false;
        let poll = |sidecar: &mut Sidecar<'_>, now| {
            if now > 1_500 && !std::mem::replace(&mut has_failed, now > 1_500) {
                *sidecar = fresh(reason);
            }
            sidecar.poll_sensor(&mut sensor, now);
        };
        let _ = serve(stream, &mut sidecar, LONG, poll);
        true
    })
}

#[test]
fn a_device_that_fails_tells_why() {
    for (reason, part) in [
        (None, ""),
        (Some(StopReason::Panic), " (the firmware panicked)"),
        (Some(StopReason::Watchdog), " (the watchdog)"),
    ] {
        let scratch = Scratch::new();
        let name = failing(reason);
        let output = scratch.run(&format!(
            "monitor --pixels 4 --columns 2 --record events.aer --device {name}"
        ));
        assert_eq!(output.status.code(), Some(1));
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(
            stderr.lines().last().unwrap(),
            format!(
                "error: {name}: the device has been restarted{part} and has forgotten this session"
            )
        );
        assert!(scratch.printed("decode events.aer").as_bytes() == output.stdout);
    }
}

#[test]
fn a_device_that_has_failed_before_is_worth_one_warning() {
    for (reason, part) in [
        (StopReason::Fault, "(a hard fault)"),
        (StopReason::BrownOut, "(the supply voltage was too low)"),
        (StopReason::Reset, ""),
        (StopReason::Silence, ""),
    ] {
        let name = device(Some(reason));
        let scratch = Scratch::new();
        let output = scratch.run(&format!("monitor --pixels 4 --seconds 2 --device {name}"));
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{stderr}");
        let warned: Vec<&str> = stderr
            .lines()
            .filter(|line| line.starts_with("warning: "))
            .collect();
        if part.is_empty() {
            assert_eq!(warned, [""; 0]);
        } else {
            let expected = format!(
                "warning: {name}: the device has been restarted {part} before this session"
            );
            assert_eq!(warned, [expected]);
        }
    }
}

#[test]
fn host_timeouts_that_no_device_takes_are_refused() {
    let scratch = Scratch::new();
    let name = device(None);
    for command in ["monitor", "view", "calibrate --out dtof.toml"] {
        for seconds in ["0.1", "-1", "61", "1.0001", "x"] {
            let line = format!("{command} --device {name} --host-timeout {seconds}");
            let output = scratch.run(&line);
            assert_eq!(output.status.code(), Some(2), "{line}");
            scratch.refused(
                &output,
                &[
                    &format!("--host-timeout {seconds}: "),
                    "must be seconds from 0.2 to 60 with at most three decimals, or 0",
                ],
            );
        }
    }
    for command in ["monitor", "calibrate --out dtof.toml"] {
        let line = format!("{command} --device {name} --host-timeout 0");
        scratch.refused(
            &scratch.run(&line),
            &[
                &name,
                "--host-timeout 0 needs firmware that was built with laser-on-without-host",
            ],
        );
    }
    for line in [
        "view events.aer --host-timeout 3",
        "calibrate --input x.npy --out dtof.toml --host-timeout 3",
    ] {
        assert!(!scratch.run(line).status.success());
    }
    assert_eq!(names(&scratch.path("")), [""; 0]);
    // The sensor was never on.
    assert_eq!(sensor_state(&name).starts, 0);
}
