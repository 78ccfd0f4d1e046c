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

/// Both ports of a board. Its host uses one at a time.
#[derive(Clone)]
struct Both(Arc<Shared>);

struct Shared {
    /// The UART and the USB; `None` is closed.
    ports: [Mutex<Option<Box<dyn Port>>>; 2],
    over_usb: AtomicBool,
    /// How often the host sends before it changes the port; 0 is never.
    every: usize,
    sent: AtomicUsize,
    changes: AtomicUsize,
    /// Bytes from the port that the host uses, since the last change, and from the other.
    received: [AtomicUsize; 2],
    /// Bytes from the other port when the device had spoken on the port that the host uses, since the last change, and
    /// the most after any change.
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
            sent: 0.into(),
            changes: 0.into(),
            received: Default::default(),
            late: 0.into(),
            most_late: 0.into(),
        })))
    }

    fn change(&self) {
        self.0.over_usb.fetch_xor(true, Relaxed);
        self.0.changes.fetch_add(1, Relaxed);
        self.0.received[0].store(0, Relaxed);
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
        let sent = self.0.sent.fetch_add(1, Relaxed) + 1;
        // The device has heard it on this port, however slow the emulator is.
        let is_heard = self.0.received[0].load(Relaxed) > 0;
        if self.0.every > 0 && sent >= self.0.every && is_heard {
            self.0.sent.store(0, Relaxed);
            self.change();
        }
        self.with(self.0.over_usb.load(Relaxed), |port| port.send(bytes))
    }

    fn receive(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let usb = self.0.over_usb.load(Relaxed);
        // What comes from the other port is thrown away.
        let mut other = [0; 256];
        if let Ok(length) = self.with(!usb, |port| port.receive(&mut other)) {
            self.0.received[1].fetch_add(length, Relaxed);
            if self.0.received[0].load(Relaxed) > 0 {
                let late = self.0.late.fetch_add(length, Relaxed) + length;
                self.0.most_late.fetch_max(late, Relaxed);
            }
        }
        let length = self.with(usb, |port| port.receive(bytes))?;
        self.0.received[0].fetch_add(length, Relaxed);
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
    let both = Both::connect(&mut board, false, 10)?;
    let client = Client::new(Box::new(both.clone()))?;
    let decided = decides_alike(client, &settings(), Array::new(8, 8).unwrap(), 200)?;
    let done = board.stop()?;
    let changes = both.0.changes.load(Relaxed);
    let other = both.0.received[1].load(Relaxed);
    let late = both.0.most_late.load(Relaxed);
    println!(
        "{decided}; {changes} changes; {other} bytes from the other port, at most {late} after the device had changed, too"
    );
    ensure!(changes >= 10, "{changes} changes");
    ensure!(late <= UNDER_WAY, "{late} bytes from the other port");
    ensure!(
        other <= changes * (UNDER_WAY + 1024),
        "{other} bytes from the other port"
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
