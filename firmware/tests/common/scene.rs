//! The main loop of an image: the simulated scene over a serial port.

use dtof_firmware::serial::Buffers;
use dtof_link::endpoint::LinkCounters;
use dtof_link::frame::WIRE_BYTES;
use dtof_link::{Configuration, message};
use dtof_sensors::{SensorInfo, simulated};

use super::host::{CONFIGURATION, Host, device};

/// A host that comes at `start_ms` and stays for so many milliseconds, the device being
/// on from 0 and sending so many bytes a millisecond. What the host has then, and what
/// the device noticed on the link.
pub fn over_serial(start_ms: u32, milliseconds: u32, bytes: usize) -> (Host, LinkCounters) {
    let mut buffers = Buffers::<512, 1024>::new();
    let (mut interrupt, mut serial) = buffers.split(|| {});
    let mut device = device::<16>(Some(SensorInfo::new(256)));
    let mut sensor = simulated::scene();
    for now_ms in 0..start_ms {
        let lost = serial.lost();
        let Ok(()) = device.poll_with(&mut sensor, &mut serial, lost, now_ms);
        assert_eq!(interrupt.next_to_send(), None);
    }
    let mut host = Host::new(1, start_ms);
    let mut wire = [0; WIRE_BYTES];
    let requested = Configuration {
        pixels: 16,
        l1: 40,
        l2: 2_000,
        ..CONFIGURATION
    };
    for now_ms in start_ms..start_ms + milliseconds {
        if now_ms == start_ms + 10 {
            host.ask(message::CONFIGURE, &requested.to_le_bytes());
        }
        let length = host.endpoint.transmit(now_ms, &mut wire);
        let sent = wire[..length].iter();
        sent.for_each(|&byte| interrupt.on_receive(byte));
        let lost = serial.lost();
        let Ok(()) = device.poll_with(&mut sensor, &mut serial, lost, now_ms);
        let sent = std::iter::from_fn(|| interrupt.next_to_send());
        host.hear(&sent.take(bytes).collect::<Vec<_>>(), now_ms);
        host.read(4);
    }
    assert_eq!(serial.lost(), 0);
    assert_eq!(host.answers.len(), 1);
    assert_eq!(host.answers[0].0, message::CONFIGURED);
    (host, *device.endpoint().counters())
}
