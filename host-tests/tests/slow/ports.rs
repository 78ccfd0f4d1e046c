//! A host that changes between the USB and the UART of a running Pico. Needs Node.js and npm, which installs
//! rp2040js.
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test slow ports:: -- --nocapture
//! ```

use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use dtof_core::Array;
use dtof_device::{Client, Port};

use crate::boards::{decides_alike, settings};
use crate::enabled;
use crate::laser::{AT_ONCE_MS, SILENCE_MS, check_fired, fires, light_over};
use crate::rp2040::{Done, NODE, NPM, Rp2040, image, install};

/// Bytes that the UART's transmitter holds, and a packet of the USB: they may still come after a change.
const UNDER_WAY: usize = 32 + 64;

/// So often the host sends after the device has answered on its port until the device has heard all that it sent to the
/// other: more than the link's window.
const SETTLED: usize = 6;

/// Both ports of a board. Its host uses one at a time.
#[derive(Clone)]
struct Both(Arc<Shared>);

struct Shared {
    /// The UART and the USB; `None` is closed.
    ports: [Mutex<Option<Box<dyn Port>>>; 2],
    over_usb: AtomicBool,
    /// How often the host sends before it changes the port, once the device has answered on it; 0 is never.
    every: usize,
    changes: AtomicUsize,
    /// The device has answered on the port since the last change. So often the host has sent since then.
    is_answered: AtomicBool,
    sent: AtomicUsize,
    /// Bytes from the port that the host does not use.
    left: AtomicUsize,
    /// Those that came when the change was settled: since the last change, and the most after one.
    late: AtomicUsize,
    most_late: AtomicUsize,
}

impl Both {
    fn connect(board: &mut Rp2040, over_usb: bool, every: usize) -> Result<Self> {
        let usb = board.connect()?;
        let uart = board.connect_uart()?;
        Ok(Self(Arc::new(Shared {
            ports: [uart, usb].map(|port| Mutex::new(Some(port))),
            over_usb: over_usb.into(),
            every,
            changes: 0.into(),
            is_answered: false.into(),
            sent: 0.into(),
            left: 0.into(),
            late: 0.into(),
            most_late: 0.into(),
        })))
    }

    fn change(&self) {
        self.0.over_usb.fetch_xor(true, Relaxed);
        self.0.changes.fetch_add(1, Relaxed);
        self.0.is_answered.store(false, Relaxed);
        self.0.sent.store(0, Relaxed);
        self.0.late.store(0, Relaxed);
    }

    fn close(&self, usb: bool) {
        *self.0.ports[usize::from(usb)].lock().unwrap() = None;
    }

    fn with<T>(
        &self,
        usb: bool,
        work: impl FnOnce(&mut dyn Port) -> io::Result<T>,
    ) -> io::Result<T> {
        match self.0.ports[usize::from(usb)].lock().unwrap().as_mut() {
            Some(port) => work(&mut **port),
            None => Err(io::ErrorKind::BrokenPipe.into()),
        }
    }
}

impl Port for Both {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let shared = &self.0;
        if shared.every > 0 && shared.is_answered.load(Relaxed) {
            let sent = shared.sent.fetch_add(1, Relaxed) + 1;
            if sent > shared.every {
                self.change();
            }
        }
        self.with(self.0.over_usb.load(Relaxed), |port| port.send(bytes))
    }

    fn receive(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let shared = &self.0;
        let usb = shared.over_usb.load(Relaxed);
        // What comes from the other port is thrown away.
        let mut other = [0; 256];
        while let Ok(length @ 1..) = self.with(!usb, |port| port.receive(&mut other)) {
            shared.left.fetch_add(length, Relaxed);
            if shared.sent.load(Relaxed) >= SETTLED {
                let late = shared.late.fetch_add(length, Relaxed) + length;
                shared.most_late.fetch_max(late, Relaxed);
            }
        }
        let length = self.with(usb, |port| port.receive(bytes))?;
        if length > 0 {
            shared.is_answered.store(true, Relaxed);
        }
        Ok(length)
    }
}

/// What the device sends to the port that the host has just left is lost, and the link repeats it.
#[test]
fn ports_change_and_every_event_comes_on_the_one_that_spoke_last() -> Result<()> {
    let Some(_alone) = enabled("the Pico's two ports in rp2040js", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    let mut board = Rp2040::start_with_both(&image(&[], None)?)?;
    let both = Both::connect(&mut board, false, 20)?;
    let client = Client::new(Box::new(both.clone()))?;
    let decided = decides_alike(client, &settings(), Array::new(8, 8).unwrap(), 400)?;
    let done = board.stop()?;
    let changes = both.0.changes.load(Relaxed);
    let left = both.0.left.load(Relaxed);
    let late = both.0.most_late.load(Relaxed);
    println!(
        "{decided}; {changes} changes; {left} bytes from the port that the host had left, at most {late} of them late"
    );
    ensure!(changes >= 10, "{changes} changes");
    ensure!(late <= UNDER_WAY, "{late} bytes came late");
    ensure!(
        left <= changes * (UNDER_WAY + 1024),
        "{left} bytes from the port that the host had left"
    );
    ensure!(done.boots.len() == 1 && !done.panicked, "{done:?}");
    Ok(())
}

#[test]
fn ports_change_and_the_laser_keeps_its_rules() -> Result<()> {
    let Some(_alone) = enabled("the laser and the Pico's two ports", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    let image = image(&["photon-timer"], None)?;
    let of_input = |done: &Done| done.last_input_ms;
    let of_close = |done: &Done| done.dtr_low_ms;
    for (what, over_usb, end, expected, from) in [
        (
            "UART, then USB, which closes",
            false,
            End::Close,
            AT_ONCE_MS,
            of_close as fn(&Done) -> _,
        ),
        // Noise at the UART may look like a host.
        (
            "USB, then UART; the USB closes",
            true,
            End::Close,
            AT_ONCE_MS,
            of_close,
        ),
        (
            "USB, then UART, which falls silent",
            true,
            End::Silence,
            SILENCE_MS,
            of_input,
        ),
    ] {
        let done = changes_lit(&image, over_usb, end).context(what)?;
        let from = from(&done).with_context(|| format!("{what}: {done:?}"))?;
        check_fired(what, expected, from, &done)?;
    }
    Ok(())
}

/// How the host ends.
#[derive(Clone, Copy, PartialEq)]
enum End {
    /// It closes the USB.
    Close,
    /// It says no more; the USB stays open.
    Silence,
}

/// The laser fires, the host changes its port, the laser still fires, and the host ends.
fn changes_lit(image: &Path, over_usb: bool, end: End) -> Result<Done> {
    let mut board = Rp2040::start_with_both(image)?;
    let both = Both::connect(&mut board, over_usb, 0)?;
    let (mut client, is_cut) = light_over(Box::new(both.clone()))?;
    fires(&mut client)?;
    both.change();
    let before = client.report()?.cycles;
    while client.report()?.cycles < before + 500 {}
    ensure!(
        client.report()?.sensor_stops == 0,
        "the laser has stopped at the change"
    );
    is_cut.store(true, Relaxed);
    if end == End::Close {
        both.close(true);
    }
    // The emulator has its own time: far more than a second of it.
    thread::sleep(Duration::from_secs(12));
    drop(client);
    board.stop()
}
