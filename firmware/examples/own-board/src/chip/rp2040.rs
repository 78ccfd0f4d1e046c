//! RP2040 on a Raspberry Pi Pico: the laser at GP2, the port over USB. It fails once its host is gone.

use dtof_firmware::board::reset_reason::ResetReason;
use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write, WriteReady};
use heapless::Vec;
use rp2040_hal::clocks::init_clocks_and_plls;
use rp2040_hal::fugit::ExtU32;
use rp2040_hal::gpio::Pins;
use rp2040_hal::pac::{self, SIO, TIMER, USBCTRL_REGS, WATCHDOG};
use rp2040_hal::usb::UsbBus;
use rp2040_hal::{Sio, Timer, Watchdog as HalWatchdog};
use static_cell::StaticCell;
use usb_device::UsbError;
use usb_device::bus::UsbBusAllocator;
use usb_device::device::{UsbDevice, UsbDeviceBuilder, UsbDeviceState, UsbVidPid};
use usbd_serial::{CdcAcmClass, USB_CLASS_CDC};

/// The chip's ROM loads this first: it sets the flash up for reading.
#[unsafe(link_section = ".boot2")]
#[used]
static BOOT2: [u8; 256] = rp2040_boot2::BOOT_LOADER_W25Q080;

static BUS: StaticCell<UsbBusAllocator<UsbBus>> = StaticCell::new();

const LASER: u32 = 1 << 2;

/// Only once the pin is an output does it do something.
pub fn set_laser(on: bool) {
    // SAFETY: a write concerns this pin alone.
    let pins = unsafe { &*SIO::PTR };
    if on {
        pins.gpio_out_set().write(|w| unsafe { w.bits(LASER) });
    } else {
        pins.gpio_out_clr().write(|w| unsafe { w.bits(LASER) });
    }
}

pub fn now_ms() -> u32 {
    // SAFETY: reading the time changes nothing.
    let timer = unsafe { &*TIMER::PTR };
    loop {
        let high = timer.timerawh().read().bits();
        let low = timer.timerawl().read().bits();
        if timer.timerawh().read().bits() == high {
            // It begins anew after 2^32 milliseconds.
            return ((u64::from(high) << 32 | u64::from(low)) / 1000) as u32;
        }
    }
}

/// Resets all of the chip: a reset of the processor alone leaves its other parts as they are.
pub fn end() -> ! {
    rp2040_hal::reset()
}

pub struct Watchdog(HalWatchdog);

impl Watchdog {
    pub fn feed(&mut self) {
        self.0.feed();
    }
}

/// A serial port over USB, polled.
pub struct Port {
    device: UsbDevice<'static, UsbBus>,
    class: CdcAcmClass<'static, UsbBus>,
    received: Vec<u8, 64>,
    /// A packet that has not left yet.
    packet: Vec<u8, 63>,
    was_open: bool,
}

/// # Panics
/// If called twice.
pub fn start() -> (Port, Watchdog, ResetReason) {
    // A debugger may have reset the processor alone: the pin is as it was.
    set_laser(false);
    let device = pac::Peripherals::take().expect("the first start");
    let reason = device.WATCHDOG.reason().read().bits();
    let chip = device.VREG_AND_CHIP_RESET.chip_reset().read().bits();
    let mut resets = device.RESETS;
    let mut watchdog = HalWatchdog::new(device.WATCHDOG);
    let Ok(clocks) = init_clocks_and_plls(
        12_000_000,
        device.XOSC,
        device.CLOCKS,
        device.PLL_SYS,
        device.PLL_USB,
        &mut resets,
        &mut watchdog,
    ) else {
        panic!("this crystal has not 12 MHz");
    };
    let _running = Timer::new(device.TIMER, &mut resets, &clocks);
    let sio = Sio::new(device.SIO);
    let pins = Pins::new(
        device.IO_BANK0,
        device.PADS_BANK0,
        sio.gpio_bank0,
        &mut resets,
    );
    // Its level is low.
    let _laser = pins.gpio2.into_push_pull_output();
    let bus = UsbBus::new(
        device.USBCTRL_REGS,
        device.USBCTRL_DPRAM,
        clocks.usb_clock,
        true,
        &mut resets,
    );
    let bus = BUS.init(UsbBusAllocator::new(bus));
    let class = CdcAcmClass::new(bus, 64);
    let device = UsbDeviceBuilder::new(bus, UsbVidPid(0x16c0, 0x27dd)).device_class(USB_CLASS_CDC);
    let device = device.max_packet_size_0(64).expect("a size of USB").build();
    watchdog.start(1.secs());
    // The laser would stay on while a debugger halts the processor.
    // SAFETY: the watchdog goes on, and nothing else writes the register meanwhile.
    let control = unsafe { &*WATCHDOG::PTR }.ctrl();
    control.modify(|_, w| {
        w.pause_dbg0().clear_bit();
        w.pause_dbg1().clear_bit();
        w.pause_jtag().clear_bit()
    });
    let port = Port {
        device,
        class,
        received: Vec::new(),
        packet: Vec::new(),
        was_open: false,
    };
    (
        port,
        Watchdog(watchdog),
        ResetReason::of_rp2040(reason, chip, true),
    )
}

impl Port {
    /// Moves bytes in both directions.
    ///
    /// # Errors
    /// Fails once a program has had the port open and is gone.
    fn turn(&mut self) -> Result<(), ErrorKind> {
        self.device.poll(&mut [&mut self.class]);
        // SAFETY: reading it changes nothing.
        let status = unsafe { &*USBCTRL_REGS::PTR }.sie_status().read();
        // A cable that is pulled suspends the device.
        let is_there = self.device.state() != UsbDeviceState::Suspend && !status.bus_reset().bit();
        let is_open = is_there && self.class.dtr();
        self.was_open |= is_open;
        if self.was_open && !is_open {
            return Err(ErrorKind::NotConnected);
        }
        if self.received.is_empty() {
            let mut bytes = [0; 64];
            if let Ok(length) = self.class.read_packet(&mut bytes) {
                // There is room.
                let _ = self.received.extend_from_slice(&bytes[..length]);
            }
        }
        if !self.packet.is_empty() {
            match self.class.write_packet(&self.packet) {
                Err(UsbError::WouldBlock) => {}
                _ => self.packet.clear(),
            }
        }
        Ok(())
    }
}

impl ErrorType for Port {
    type Error = ErrorKind;
}

impl ReadReady for Port {
    fn read_ready(&mut self) -> Result<bool, ErrorKind> {
        self.turn()?;
        Ok(!self.received.is_empty())
    }
}

impl Read for Port {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, ErrorKind> {
        while self.received.is_empty() {
            self.turn()?;
        }
        let length = bytes.len().min(self.received.len());
        let (now, later) = self.received.split_at(length);
        bytes[..length].copy_from_slice(now);
        self.received = Vec::from_slice(later).unwrap_or_default();
        Ok(length)
    }
}

impl WriteReady for Port {
    fn write_ready(&mut self) -> Result<bool, ErrorKind> {
        self.turn()?;
        Ok(self.packet.is_empty())
    }
}

impl Write for Port {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        while !self.packet.is_empty() {
            self.turn()?;
        }
        let length = bytes.len().min(self.packet.capacity());
        let _ = self.packet.extend_from_slice(&bytes[..length]);
        self.turn()?;
        Ok(length)
    }

    fn flush(&mut self) -> Result<(), ErrorKind> {
        while !self.packet.is_empty() {
            self.turn()?;
        }
        Ok(())
    }
}
