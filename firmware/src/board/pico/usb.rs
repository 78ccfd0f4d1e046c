//! The link over USB: a serial port for the host (CDC ACM), in addition to the UART.
//!
//! A chip of version B0 or B1 does not leave a reset of the bus behind a busy hub (RP2040-E5). rp2040-hal
//! then takes GP15 for about a millisecond and shows the USB an idle bus there. It has to be called until
//! the reset ends, and its interrupt stays meanwhile: see [`Usb::is_in_reset`].

use heapless::Vec;
use static_cell::StaticCell;
use usb_device::UsbError;
use usb_device::bus::UsbBusAllocator;
use usb_device::device::{
    StringDescriptors, UsbDevice, UsbDeviceBuilder, UsbDeviceState, UsbVidPid,
};
use usbd_serial::{CdcAcmClass, USB_CLASS_CDC};

use super::chip::hal::clocks::UsbClock;
use super::chip::hal::pac::RESETS;
use super::chip::hal::usb::UsbBus;
use super::chip::{UsbMemory, UsbRegisters};
use crate::serial::SerialInterrupt;

/// Bytes of a packet from the host.
const PACKET: u16 = 64;
/// Bytes of one to it: after a full packet the host would wait for another.
const SENT: usize = PACKET as usize - 1;

/// For serial ports of anybody's, by the list of V-USB.
const ID: UsbVidPid = UsbVidPid(0x16c0, 0x27dd);

static BUS: StaticCell<UsbBusAllocator<UsbBus>> = StaticCell::new();

/// The port.
pub struct Usb {
    device: UsbDevice<'static, UsbBus>,
    class: CdcAcmClass<'static, UsbBus>,
    /// A packet that has not left yet.
    packet: Vec<u8, SENT>,
}

impl Usb {
    /// Appears to the host.
    pub fn start(
        registers: UsbRegisters,
        memory: UsbMemory,
        clock: UsbClock,
        resets: &mut RESETS,
    ) -> Self {
        let bus = UsbBus::new(registers, memory, clock, true, resets);
        let bus = BUS.init(UsbBusAllocator::new(bus));
        let class = CdcAcmClass::new(bus, PACKET);
        let names = StringDescriptors::default()
            .manufacturer("dtof")
            .product("dtof sidecar");
        let device = UsbDeviceBuilder::new(bus, ID).device_class(USB_CLASS_CDC);
        // As long as the others are: descriptors then come in fewer packets.
        let device = device.max_packet_size_0(64);
        let Ok(device) = device.and_then(|device| device.strings(&[names])) else {
            panic!("a packet of 64 bytes and one language can be");
        };
        Self {
            device: device.build(),
            class,
            packet: Vec::new(),
        }
    }

    /// Fetches what has been received. Returns whether there was something. Runs on each interrupt
    /// of the USB.
    pub fn receive(&mut self, port: &mut SerialInterrupt<'_>) -> bool {
        let mut received = false;
        if !self.device.poll(&mut [&mut self.class]) {
            return false;
        }
        let mut bytes = [0; PACKET as usize];
        while let Ok(length) = self.class.read_packet(&mut bytes) {
            received |= length > 0;
            for &byte in bytes.iter().take(length) {
                port.on_receive(byte);
            }
        }
        received
    }

    /// Whether a program has the port open. It raises DTR then; a host takes DTR down when the
    /// program ends, however it ends, and a cable that is pulled suspends the device.
    pub fn listens(&self) -> bool {
        !self.is_in_reset() && self.device.state() == UsbDeviceState::Configured && self.class.dtr()
    }

    /// Whether a reset of the bus goes on that [`receive`](Self::receive) could not handle yet: the
    /// interrupt is pending until it can.
    #[allow(clippy::unused_self, reason = "of this port")]
    pub fn is_in_reset(&self) -> bool {
        // SAFETY: it is only read, and reading it changes nothing.
        #[allow(unsafe_code, reason = "the chip's crate keeps the register to itself")]
        let status = unsafe { &*UsbRegisters::PTR }.sie_status().read();
        status.bus_reset().bit()
    }

    /// Hands over what there is to send, as far as the host takes it. Runs again when a packet
    /// has left.
    pub fn send(&mut self, port: &mut SerialInterrupt<'_>) {
        loop {
            while !self.packet.is_full()
                && let Some(byte) = port.next_to_send()
            {
                // There is room, as was just seen.
                let _ = self.packet.push(byte);
            }
            if self.packet.is_empty() {
                return;
            }
            match self.class.write_packet(&self.packet) {
                Ok(_) => self.packet.clear(),
                Err(UsbError::WouldBlock) => return,
                // No host has configured the device: nobody waits for the data.
                Err(_) => self.packet.clear(),
            }
        }
    }
}
