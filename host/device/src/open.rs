//! Opening a device by its name.

use std::io::{self, ErrorKind};
use std::net::{TcpStream, ToSocketAddrs};
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};

use super::port::{PATIENCE, Port, STUCK, prompt};
use super::qemu::Emulator;

use dtof_data::options::Refused;

/// The speed of the boards' serial ports.
const BAUD: u32 = 1_000_000;

/// Opens `tcp:HOST:PORT` or a serial port. `qemu` starts an emulated device with `image`, or with the
/// image that xtask has built, and opens its port.
///
/// # Errors
/// Fails if the port cannot be opened or the emulator does not start.
pub fn open(name: &str, image: Option<&Path>) -> Result<Box<dyn Port>> {
    if name == "qemu" {
        return Ok(Box::new(Emulator::start(image)?));
    }
    ensure!(
        image.is_none(),
        Refused::new("image", "is for `device` qemu")
    );
    if let Some(address) = name.strip_prefix("tcp:") {
        return Ok(Box::new(tcp(address).with_context(|| name.to_owned())?));
    }
    // A device on USB keeps its sensor off while DTR is low.
    let port = serialport::new(name, BAUD).timeout(PATIENCE);
    let port = port.dtr_on_open(true).open();
    match port {
        Ok(port) => Ok(Box::new(port)),
        Err(error) if error.kind == serialport::ErrorKind::Io(ErrorKind::NotFound) => {
            bail!("{name}: {error}; {}", serial_ports())
        }
        Err(error) => bail!("{name}: {error}"),
    }
}

/// Lists the serial ports of this computer, for an error message.
fn serial_ports() -> String {
    let ports = serialport::available_ports().unwrap_or_default();
    let mut names: Vec<String> = ports.into_iter().map(|port| port.port_name).collect();
    names.sort();
    if names.is_empty() {
        return "no serial port found; use tcp:HOST:PORT or qemu".to_owned();
    }
    format!(
        "serial ports found: {}; or use tcp:HOST:PORT or qemu",
        names.join(", ")
    )
}

/// A connection to the first address that accepts it.
///
/// # Errors
/// Fails if none does.
fn tcp(address: &str) -> io::Result<TcpStream> {
    let mut connected = Err(ErrorKind::AddrNotAvailable.into());
    for address in address.to_socket_addrs()? {
        connected = TcpStream::connect_timeout(&address, STUCK);
        if connected.is_ok() {
            break;
        }
    }
    prompt(connected?)
}
