//! `dtof calibrate --device` on options that do not suit, and on devices that go, are silent or say
//! nonsense: one clear line and a failure.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::thread;
use std::time::{Duration, Instant};

use crate::common::{Scratch, assert_contains, names};
use crate::device::listen;
use crate::device::wall_sensor::{LONG, PIXELS, Rates, WALL, WallSensor, device};
use dtof_core::fixed::types::I24F8;
use dtof_core::{LaserCycle, PixelAddress};
use dtof_link::endpoint::{Endpoint, Message};
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::message::greeting;
use dtof_link::{HistogramHead, NoHistogram, Report, SensorRecord, message};

/// Runs the program and returns its one line of error.
#[track_caller]
fn refused(options: &str) -> String {
    let scratch = Scratch::new();
    let output = scratch.run(&format!("calibrate --out dtof.toml {options}"));
    assert!(matches!(output.status.code(), Some(1 | 2)), "{output:?}");
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(error.lines().count(), 1, "{error}");
    assert!(names(&scratch.path("")).is_empty());
    error
}

#[test]
fn options_that_do_not_suit_are_refused() {
    let name = device(WallSensor::new(WALL), LONG);
    for (options, part) in [
        ("", "--input"),
        ("--input x.npy --seconds 3", "--seconds is for --device"),
        ("--input x.npy --device tcp:127.0.0.1:1", "--device"),
        (
            "--device DEVICE --axes bins",
            "--axes is for recordings, not for a device",
        ),
        ("--device DEVICE --rebin 2", "--rebin is for recordings"),
        ("--device DEVICE --bins 64", "--bins is for recordings"),
        (
            "--device DEVICE --columns 5",
            "--columns 5: the device has 12 pixels",
        ),
        ("--device DEVICE --seconds 0", "--seconds"),
        (
            "--device DEVICE --photons 100 --recorded-cycles 9",
            "counts its laser cycles",
        ),
    ] {
        let error = refused(&options.replace("DEVICE", &name));
        assert_contains(&error, part);
    }
}

#[test]
fn a_device_that_goes_or_gives_nothing_is_named() {
    let gone = device(WallSensor::new(WALL), Duration::from_millis(900));
    let error = refused(&format!("--device {gone}"));
    assert_contains(&error, &format!("error: {gone}: the device cannot be"));

    let unplugged = WallSensor {
        is_there: false,
        ..WallSensor::new(WALL)
    };
    let name = device(unplugged.clone(), LONG);
    let error = refused(&format!("--device {name}"));
    assert_contains(&error, "no laser cycle for 5 seconds; sensor errors ");
    assert!(error.ends_with(" (last: no answer)\n"), "{error}");
    let whole = WallSensor {
        histogram_cycles: Some((500, 0)),
        ..unplugged
    };
    let error = refused(&format!("--device {}", device(whole, LONG)));
    assert!(error.ends_with(" (last: no answer)\n"), "{error}");

    let dark: Rates = |_| (0.0, 0.0);
    let mut dark = WallSensor::new(dark);
    dark.histogram_cycles = Some((u32::MAX, 0));
    let error = refused(&format!("--device {}", device(dark, LONG)));
    assert_contains(&error, "5 seconds");
}

/// A device that answers a request for a histogram with these messages. An old device counts the
/// request as unknown.
#[derive(Clone)]
struct Fake {
    messages: Vec<(u8, Vec<u8>)>,
    is_old: bool,
}

impl Fake {
    /// The name of its port.
    fn device(self) -> String {
        listen(move |stream| {
            let mut end = Endpoint::device(greeting(128, PIXELS));
            let mut report = Report::default();
            let _ = talk(stream, &mut end, |end, message| {
                let answer = match message.kind {
                    message::CONFIGURE => (message::CONFIGURED, Vec::new()),
                    message::SENSOR_REQUEST => {
                        let sensor = SensorRecord {
                            pixels: PIXELS,
                            bin_width: None,
                            offset: I24F8::ZERO,
                            laser_millihertz: 20_000_000,
                            bins: 128,
                            dead_time: 0,
                            most_dither: 0,
                        };
                        let sensor = SensorRecord::to_le_bytes(Some(&sensor), 10);
                        (message::SENSOR, sensor.to_vec())
                    }
                    message::STATISTICS_REQUEST => {
                        (message::STATISTICS, report.to_le_bytes().to_vec())
                    }
                    _ => {
                        report.unknown += u32::from(self.is_old);
                        for (kind, body) in &self.messages {
                            end.offer(*kind, body).unwrap();
                        }
                        return;
                    }
                };
                end.offer(answer.0, &answer.1).unwrap();
            });
            true
        })
    }
}

/// Handles messages until the host is gone.
fn talk(
    stream: &mut TcpStream,
    end: &mut Endpoint,
    mut act: impl FnMut(&mut Endpoint, Message),
) -> io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(Duration::from_millis(1)))?;
    let (started, mut deframer) = (Instant::now(), Deframer::new());
    loop {
        let now = u32::try_from(started.elapsed().as_millis()).unwrap();
        let mut bytes = [0; 1024];
        let length = match stream.read(&mut bytes) {
            Ok(0) => return Ok(()),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => 0,
            read => read?,
        };
        for &byte in &bytes[..length] {
            if let Some(frame) = deframer.push(byte) {
                end.receive(frame, now);
            }
        }
        while let Some(message) = end.take() {
            act(end, message);
        }
        let mut wire = [0; WIRE_BYTES];
        while let length @ 1.. = end.transmit(now, &mut wire) {
            stream.write_all(&wire[..length])?;
        }
    }
}

#[test]
fn nonsense_silence_and_older_firmware_are_named() {
    let histogram = |body: &[u8]| vec![(message::HISTOGRAM, body.to_vec())];
    let none = |pixel, none: NoHistogram| histogram(&none.message(PixelAddress::new(pixel)));
    let head = HistogramHead {
        pixel: PixelAddress::new(0),
        is_whole: false,
        cycle: LaserCycle::new(1),
        exposure: 9,
    };
    let mut body = heapless::Vec::new();
    head.messages(&[1; 128]).next().unwrap().write(&mut body);
    let answers = [
        (Vec::new(), true, "its firmware is older than this program"),
        (
            Vec::new(),
            false,
            "does not answer a request for a histogram",
        ),
        (histogram(&[1, 2]), false, "an invalid histogram"),
        (
            none(3, NoHistogram::NoPixel),
            false,
            "pixel 3, which was not requested",
        ),
        (
            none(0, NoHistogram::NoPixel),
            false,
            "pixel 0: the device has no such pixel",
        ),
        (
            none(0, NoHistogram::NoConfiguration),
            false,
            "pixel 0: the device is not configured",
        ),
        (
            histogram(&body),
            false,
            "began before the first laser cycle",
        ),
        (
            vec![(message::SENSOR, vec![])],
            false,
            "message 0x86, which was not requested",
        ),
        (vec![(message::EVENTS, vec![1; 16])], false, "error: "),
    ];
    for (messages, is_old, part) in answers {
        let fake = Fake { messages, is_old };
        let name = fake.device();
        let error = refused(&format!("--device {name}"));
        assert_contains(&error, &format!("error: {name}: "));
        assert_contains(&error, part);
    }
    // A device that accepts the connection and stays silent.
    let mute = listen(|stream| {
        thread::sleep(Duration::from_secs(20));
        stream.peer_addr().is_err()
    });
    assert_contains(&refused(&format!("--device {mute}")), "no device answered");
}
