//! A cable that is pulled: the port closes, is silent for ever or is reset, in the middle of a
//! frame; the device is reset, or hears nothing any more. What was recorded until then is whole.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use crate::common::{Scratch, names};
use crate::device::listen;
use crate::device::monitor::{LONG, device, reference};

/// A fault after some bytes of the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    /// The connection is closed.
    Vanishes,
    /// The connection stays open without data.
    Stalls,
    /// The connection is reset.
    Resets,
    /// Another device replaces the first, as after a reset.
    Restarts,
    /// The device receives nothing any more, and goes on.
    IsDeaf,
}

fn connect(name: &str) -> TcpStream {
    let stream = TcpStream::connect(name.strip_prefix("tcp:").unwrap()).unwrap();
    stream.set_nodelay(true).unwrap();
    stream
}

/// Copies bytes until one end is gone. Bytes are lost while the cable `is_cut`.
fn copy(mut from: TcpStream, mut to: TcpStream, is_cut: &AtomicBool) -> io::Result<()> {
    let mut bytes = [0; 1024];
    loop {
        match from.read(&mut bytes)? {
            0 => return Ok(()),
            _ if is_cut.load(Ordering::Relaxed) => {}
            length => to.write_all(&bytes[..length])?,
        }
    }
}

/// A cable to a device: `fault` after `cut` of its bytes.
fn cable(fault: Fault, cut: usize) -> String {
    let first = device(true, LONG);
    listen(move |host| {
        host.set_nodelay(true).unwrap();
        let mut device = connect(&first);
        let is_cut = Arc::new(AtomicBool::new(false));
        let down = thread::spawn({
            let (host, device) = (host.try_clone().unwrap(), device.try_clone().unwrap());
            let is_cut = Arc::clone(&is_cut);
            move || copy(host, device, &is_cut)
        });
        let mut left = cut;
        let mut byte = [0];
        // Byte by byte, for an exact position of the cut.
        while left > 0 && device.read(&mut byte).unwrap_or(0) == 1 {
            if host.write_all(&byte).is_err() {
                return false;
            }
            left -= 1;
        }
        match fault {
            Fault::Vanishes => {
                let _ = host.shutdown(Shutdown::Both);
            }
            Fault::Stalls => {
                let mut rest = Vec::new();
                // Until the host gives up.
                let _ = device.read_to_end(&mut rest);
            }
            Fault::Resets => {
                // Closing with unread bytes resets a connection.
                let _ = device.shutdown(Shutdown::Both);
                let _ = down.join();
                thread::sleep(Duration::from_millis(300));
            }
            Fault::Restarts => {
                let second = connect(&crate::device::monitor::device(true, LONG));
                let _ = device.shutdown(Shutdown::Both);
                let _ = down.join();
                let below = (host.try_clone().unwrap(), second.try_clone().unwrap());
                thread::spawn(move || copy(below.0, below.1, &AtomicBool::new(false)));
                let _ = copy(second, host.try_clone().unwrap(), &is_cut);
            }
            Fault::IsDeaf => {
                is_cut.store(true, Ordering::Relaxed);
                let _ = copy(device, host.try_clone().unwrap(), &AtomicBool::new(false));
            }
        }
        false
    })
}

/// Records the device behind such a cable. Returns the rows and the last line.
#[track_caller]
fn pulled(fault: Fault, cut: usize) -> (String, String) {
    let scratch = Scratch::new();
    scratch.file("events.aer", "older");
    let name = cable(fault, cut);
    let line = format!("monitor --pixels 4 --columns 2 --device {name} --record events.aer");
    let output = scratch.run(&line);
    assert_eq!(output.status.code(), Some(1), "{fault:?} {cut}: {output:?}");
    let rows = String::from_utf8(output.stdout).unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    let errors: Vec<&str> = message
        .lines()
        .filter(|line| !line.starts_with("events/s "))
        .collect();
    let [error] = errors[..] else {
        panic!("{fault:?} {cut}: {message}");
    };
    assert!(message.ends_with(&format!("{error}\n")), "{message}");
    assert!(error.starts_with(&format!("error: {name}: ")), "{error}");
    assert_eq!(names(&scratch.path("")), ["events.aer"]);
    if rows.lines().count() > 1 {
        // A complete file ends with an end word.
        assert!(scratch.printed("decode events.aer") == rows);
        assert!(reference().starts_with(&rows), "{fault:?} {cut}");
    } else {
        assert_eq!(scratch.read("events.aer"), "older");
    }
    (rows, error.to_owned())
}

/// All cuts at once, each with its own device.
fn pulled_at(faults: &[(Fault, &str)], cuts: &[usize]) {
    let all = faults
        .iter()
        .flat_map(|fault| cuts.iter().map(move |cut| (fault, *cut)));
    let mut events = 0;
    thread::scope(|scope| {
        let runs = all.map(|(&(fault, part), cut)| {
            scope.spawn(move || {
                let (rows, error) = pulled(fault, cut);
                assert!(error.contains(part), "{fault:?} {cut}: {error}");
                rows.lines().count().saturating_sub(1)
            })
        });
        let runs: Vec<_> = runs.collect();
        events = runs.into_iter().map(|run| run.join().unwrap()).sum();
    });
    assert!(events > 0);
    println!(
        "faults: cable pulled {} times ({} ways): {events} events recorded, 0 wrong, 0 files damaged, each \
         named in one line",
        faults.len() * cuts.len(),
        faults.len()
    );
}

#[test]
fn what_came_before_the_cable_was_pulled_is_recorded_whole() {
    let faults = [
        (Fault::Vanishes, "the device cannot be read from: "),
        (Fault::Stalls, "the device says nothing for 5 seconds"),
        (Fault::Resets, "the device cannot be "),
        (
            Fault::Restarts,
            "the device has been restarted and has forgotten this session",
        ),
    ];
    pulled_at(&faults, &[300, 701, 1202, 1903]);
}

/// It takes half a minute.
#[test]
#[ignore = "30 seconds"]
fn a_device_that_hears_nothing_is_given_up() {
    let faults = [(Fault::IsDeaf, "the device does not answer for 30 seconds")];
    pulled_at(&faults, &[1202]);
    // Unread photons, too.
    let scratch = Scratch::new();
    let scene = "columns = 2\nrows = 2\ncycles = 200_000\nbackground = 0.5\n\
                 [[surface]]\nrange_mm = 2000\nreflectivity = 0.8\n";
    let scene = scratch.file("scene.toml", scene);
    let name = cable(Fault::IsDeaf, 400);
    let output = scratch.simulate(&scene, &format!("--device {name}"));
    scratch.refused(&output, &["the device does not answer for 30 seconds"]);
}
