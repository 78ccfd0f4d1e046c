//! `cargo xtask check-boards`: the images do in QEMU what they should.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use dtof_firmware::serial::RECEIVE_CAPACITY;

use crate::firmware::Board;
use crate::log;
use crate::qemu::{self, Emulator};
use crate::tools::DEFMT_PRINT;

/// Bytes sent to mps2-an386 and back.
const BYTES: usize = 1 << 20;

/// Runs all of it.
pub fn check(root: &Path) -> Result<()> {
    let cannot = qemu::cannot_run(Board::Stm32F405)?;
    let image = Board::Mps2An386.sidecar(root, &[])?;
    ends(&image)?;
    echoes(&image)?;
    match cannot {
        Some(reason) => println!("{reason}"),
        None => boots(&Board::Stm32F405.sidecar(root, &["pll-off"])?)?,
    }
    Ok(())
}

/// However the image ends, QEMU ends with it, and the reason is to be seen.
fn ends(image: &Path) -> Result<()> {
    for (word, success, message) in [
        ("exit", true, "mps2-an386 started"),
        ("panic", false, "as asked for on the command line"),
        ("fault", false, "hard fault at 0x"),
    ] {
        let (status, output) = Emulator::start(Board::Mps2An386, image, &[word])?.wait()?;
        ensure!(
            status.success() == success,
            "mps2-an386: `{word}` ends QEMU with {status}"
        );
        if !DEFMT_PRINT.is_there() {
            println!(
                "SKIPPED: the message of `{word}`: {}",
                DEFMT_PRINT.missing()
            );
            continue;
        }
        let text = log::decode(image, output)?;
        ensure!(
            text.contains(message),
            "mps2-an386: `{word}` does not log `{message}` but\n{text}"
        );
        println!("mps2-an386: `{word}` ends QEMU with {status} and is logged");
    }
    Ok(())
}

/// A million random bytes come back as they were sent.
fn echoes(image: &Path) -> Result<()> {
    let mut emulator = Emulator::start(Board::Mps2An386, image, &[])?;
    let mut port = emulator.connect()?;
    let sent = random_bytes(BYTES);
    let start = Instant::now();
    let received = exchange(&mut port, &sent).context("mps2-an386: echo")?;
    let seconds = start.elapsed().as_secs_f64();
    let output = emulator.stop()?;
    if let Some(at) = first_difference(&sent, &received) {
        if let Ok(text) = log::decode(image, output) {
            println!("{text}");
        }
        bail!("mps2-an386: byte {at} comes back wrong");
    }
    println!(
        "mps2-an386: {BYTES} bytes sent and received back in {seconds:.1} s, {:.1} kB/s each way",
        BYTES as f64 / seconds / 1e3
    );
    Ok(())
}

/// The image of the real board starts and sends back a few bytes.
fn boots(image: &Path) -> Result<()> {
    let mut emulator = Emulator::start(Board::Stm32F405, image, &[])?;
    let mut port = emulator.connect()?;
    // What comes before the port is started is lost: knock until it answers.
    let start = Instant::now();
    port.set_read_timeout(Some(Duration::from_millis(200)))?;
    let mut answer = [0];
    while port.read_exact(&mut answer).is_err() {
        ensure!(
            start.elapsed() < Duration::from_secs(20),
            "stm32f405: does not start or does not answer"
        );
        port.write_all(&[0])?;
    }
    // The answers to what else was knocked.
    thread::sleep(Duration::from_millis(500));
    while port.read_exact(&mut answer).is_ok() {}

    port.set_read_timeout(Some(Duration::from_secs(20)))?;
    let sent = random_bytes(512);
    let received = exchange(&mut port, &sent).context("stm32f405: echo")?;
    ensure!(received == sent, "stm32f405: bytes come back wrong");
    println!("stm32f405: boots and sends {} bytes back", sent.len());
    emulator.stop()?;
    Ok(())
}

/// Sends all and receives as much, with never more bytes on their way than the
/// board has room for.
fn exchange(port: &mut TcpStream, bytes: &[u8]) -> Result<Vec<u8>> {
    let mut received = Vec::with_capacity(bytes.len());
    let mut sent = 0;
    let mut buffer = [0; 4096];
    while received.len() < bytes.len() {
        let room = RECEIVE_CAPACITY - (sent - received.len());
        let next = &bytes[sent..bytes.len().min(sent + room)];
        port.write_all(next)?;
        sent += next.len();
        let count = port.read(&mut buffer).with_context(|| {
            let missing = sent - received.len();
            format!("{missing} of {sent} bytes do not come back")
        })?;
        ensure!(count > 0, "QEMU closes the serial port");
        received.extend_from_slice(&buffer[..count]);
        ensure!(received.len() <= sent, "more comes back than was sent");
    }
    Ok(received)
}

/// The same every time (xorshift of Marsaglia).
fn random_bytes(count: usize) -> Vec<u8> {
    let mut state = 0x2545_f491_u32;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state.to_le_bytes()[1]
    };
    (0..count).map(|_| next()).collect()
}

fn first_difference(left: &[u8], right: &[u8]) -> Option<usize> {
    left.iter()
        .zip(right)
        .position(|(left, right)| left != right)
}
