//! Ports that connect a device.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Longest wait for a byte, or for room in the output buffer.
pub(super) const PATIENCE: Duration = Duration::from_millis(2);
/// A port that accepts no byte for so long is gone.
pub(super) const STUCK: Duration = Duration::from_secs(5);

/// Bytes to a device and from it.
pub trait Port: Send {
    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// Fails if the port is gone.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Receives into `bytes` and returns the number of bytes, 0 if none has come after a short wait.
    ///
    /// # Errors
    /// Fails if the port is gone.
    fn receive(&mut self, bytes: &mut [u8]) -> io::Result<usize>;
}

impl Port for TcpStream {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        send(self, bytes, STUCK)
    }

    fn receive(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self.read(bytes) {
            Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
            result => patient(result),
        }
    }
}

impl Port for Box<dyn serialport::SerialPort> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        send(self, bytes, STUCK)
    }

    fn receive(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        patient(self.read(bytes))
    }
}

/// Sends all bytes. A full buffer is an error only if it stays full for as long as `stuck`.
fn send(port: &mut impl Write, mut bytes: &[u8], stuck: Duration) -> io::Result<()> {
    let mut since = Instant::now();
    while !bytes.is_empty() {
        let sent = patient(port.write(bytes))?;
        bytes = &bytes[sent..];
        if sent > 0 {
            since = Instant::now();
        } else if since.elapsed() > stuck {
            return Err(ErrorKind::TimedOut.into());
        }
    }
    Ok(())
}

/// A timeout counts as 0 bytes, not as an error.
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

/// Turns a broken pipe into another error: the program takes a broken pipe for a closed output.
fn gone(error: io::Error) -> io::Error {
    match error.kind() {
        ErrorKind::BrokenPipe => io::Error::new(ErrorKind::NotConnected, "the port is gone"),
        _ => error,
    }
}

/// The same connection, which sends at once and waits at most [`PATIENCE`].
///
/// # Errors
/// Fails if it is gone.
pub fn prompt(stream: TcpStream) -> io::Result<TcpStream> {
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    Ok(stream)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The buffers take some bytes first.
    #[test]
    fn a_tcp_port_that_takes_nothing_is_gone() {
        let listener = std::net::TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let stream = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let mut port = prompt(stream).unwrap();
        let stuck = Duration::from_millis(300);
        let began = Instant::now();
        let bytes = [0; 1 << 16];
        let error = loop {
            if let Err(error) = send(&mut port, &bytes, stuck) {
                break error;
            }
            assert!(began.elapsed() < 100 * stuck, "the buffers have no end");
        };
        assert_eq!(error.kind(), ErrorKind::TimedOut);
        assert!(began.elapsed() >= stuck);
    }

    /// Otherwise the program would end with success.
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
