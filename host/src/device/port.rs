//! Ports a device can be behind.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};

use super::qemu::Emulator;

/// How long a port waits for a byte.
const PATIENCE: Duration = Duration::from_millis(2);
/// A port that takes nothing for so long is gone.
const STUCK: Duration = Duration::from_secs(5);
/// What the boards' serial ports are set to.
const BAUD: u32 = 1_000_000;

/// Bytes to a device and from it.
pub trait Port {
    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// If the port is gone.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Gives what has come, waiting a moment for it; 0 bytes if nothing has.
    ///
    /// # Errors
    /// If the port is gone.
    fn receive(&mut self, bytes: &mut [u8]) -> io::Result<usize>;
}

impl Port for TcpStream {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.write_all(bytes).map_err(gone)
    }

    fn receive(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self.read(bytes) {
            Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
            result => patient(result),
        }
    }
}

impl Port for Box<dyn serialport::SerialPort> {
    fn send(&mut self, mut bytes: &[u8]) -> io::Result<()> {
        let since = Instant::now();
        while !bytes.is_empty() {
            // A full buffer is no error until it stays full.
            let sent = patient(self.write(bytes))?;
            bytes = &bytes[sent..];
            if since.elapsed() > STUCK {
                return Err(ErrorKind::TimedOut.into());
            }
        }
        Ok(())
    }

    fn receive(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        patient(self.read(bytes))
    }
}

/// Nothing yet is no error.
fn patient(result: io::Result<usize>) -> io::Result<usize> {
    match result {
        Err(error)
            if matches!(
                error.kind(),
                ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
            ) =>
        {
            Ok(0)
        }
        result => result.map_err(gone),
    }
}

/// A port that closes is not a reader of the output that has seen enough.
fn gone(error: io::Error) -> io::Error {
    match error.kind() {
        ErrorKind::BrokenPipe => io::Error::new(ErrorKind::NotConnected, "the port is gone"),
        _ => error,
    }
}

/// Opens `tcp:HOST:PORT` or the serial port of that name. `qemu` starts an emulated
/// device, with `image` or the one that xtask has built, and opens its port.
///
/// # Errors
/// If there is none.
pub fn open(name: &str, image: Option<&Path>) -> Result<Box<dyn Port>> {
    if name == "qemu" {
        return Ok(Box::new(Emulator::start(image)?));
    }
    ensure!(image.is_none(), "--image is for --device qemu");
    if let Some(address) = name.strip_prefix("tcp:") {
        return Ok(Box::new(tcp(address).with_context(|| name.to_owned())?));
    }
    let port = serialport::new(name, BAUD).timeout(PATIENCE).open();
    match port {
        Ok(port) => Ok(Box::new(port)),
        Err(error) if error.kind == serialport::ErrorKind::Io(ErrorKind::NotFound) => {
            bail!("{name}: {error}; {}", serial_ports())
        }
        Err(error) => bail!("{name}: {error}"),
    }
}

/// The serial ports there are, for people.
fn serial_ports() -> String {
    let ports = serialport::available_ports().unwrap_or_default();
    let mut names: Vec<String> = ports.into_iter().map(|port| port.port_name).collect();
    names.sort();
    if names.is_empty() {
        return "no serial port is here".to_owned();
    }
    format!("serial ports here: {}", names.join(", "))
}

/// A connection that waits no longer than a port should.
///
/// # Errors
/// If nobody listens.
fn tcp(address: &str) -> io::Result<TcpStream> {
    let mut failed = None;
    let mut connected = None;
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, STUCK) {
            Ok(stream) => {
                connected = Some(stream);
                break;
            }
            Err(error) => failed = Some(error),
        }
    }
    let unknown = || failed.unwrap_or_else(|| ErrorKind::AddrNotAvailable.into());
    prompt(connected.ok_or_else(unknown)?)
}

/// The same connection, which sends at once and does not wait long for a byte.
///
/// # Errors
/// If it is gone.
pub fn prompt(stream: TcpStream) -> io::Result<TcpStream> {
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    Ok(stream)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Else the program would end as if all were well.
    #[test]
    fn a_port_that_closes_is_not_a_closed_output() {
        let closed = |kind| patient(Err(io::Error::from(kind))).unwrap_err().kind();
        assert_eq!(closed(ErrorKind::BrokenPipe), ErrorKind::NotConnected);
        assert_eq!(
            closed(ErrorKind::ConnectionReset),
            ErrorKind::ConnectionReset
        );
    }
}
