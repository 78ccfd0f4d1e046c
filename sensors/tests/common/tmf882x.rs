//! A TMF8820 on a mocked bus: what its accesses look like, and a bench that
//! brings the driver up.

use std::iter;

use dtof_core::PixelAddress;
use dtof_sensors::tmf882x::{Config, Error, Settings, Tmf882x};
use dtof_sensors::{Polled, Sensor};
use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};
use embedded_hal_mock::eh1::i2c::{Mock, Transaction as Access};

use super::{Broken, Line, RecordingSink, started};

pub type Counts = [[u32; 128]; 10];

pub fn write(address: u8, bytes: &[u8]) -> Access {
    Access::write(address, bytes.to_vec())
}

pub fn read(address: u8, register: u8, bytes: &[u8]) -> Access {
    Access::write_read(address, vec![register], bytes.to_vec())
}

/// The command to stop.
pub fn stop() -> Access {
    write(0x41, &[0x08, 0xFF])
}

/// The answer to a stop and the mode, and the command to load the configuration page.
pub fn stopped(address: u8) -> [Access; 3] {
    [
        read(address, 0x08, &[0x00]),
        read(address, 0x10, &[0x00]),
        write(address, &[0x08, 0x16]),
    ]
}

/// The pages and commands from the common page on, and what they answer.
pub fn page(address: u8) -> Vec<Access> {
    vec![
        read(address, 0x08, &[0x00]),
        read(address, 0x20, &[0x16]),
        write(address, &[0x24, 132, 0, 25, 2]),
        write(address, &[0x34, 1]),
        write(address, &[0x39, 1]),
        write(address, &[0x08, 0x15]),
    ]
}

pub fn measure(address: u8) -> Vec<Access> {
    vec![
        read(address, 0x08, &[0x00]),
        write(address, &[0xE1, 0xFF]),
        write(address, &[0xE2, 0x0A]),
        write(address, &[0x08, 0x10]),
    ]
}

/// The 30 packets of ten histograms.
pub fn packets(counts: &Counts) -> Vec<Vec<u8>> {
    (0..30u8)
        .map(|number| {
            let channel = &counts[usize::from(number % 10)];
            let plane = usize::from(number / 10);
            let [left_l, left_h] = (3840 - 128 * u16::from(number)).to_le_bytes();
            let header = [0x81, number, left_l, left_h, number, 128, 0];
            let data = channel.iter().map(|count| count.to_le_bytes()[plane]);
            header.into_iter().chain(data).collect()
        })
        .collect()
}

/// What is read for one packet, `chunk` bytes at a time.
pub fn packet(address: u8, bytes: &[u8], chunk: usize) -> Vec<Access> {
    let reads = (0x20..=0xA6).step_by(chunk).zip(bytes.chunks(chunk));
    [read(address, 0xE1, &[0x09]), write(address, &[0xE1, 0x08])]
        .into_iter()
        .chain(reads.map(|(register, bytes)| read(address, register, bytes)))
        .collect()
}

pub fn settings() -> Settings {
    Settings {
        reference: Some(PixelAddress::new(99)),
        ..Settings::new(PixelAddress::new(10))
    }
}

pub const IMAGE: &[u8] = &[1, 2, 3];
pub const NACK: ErrorKind = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address);

/// Counts that differ in every bin and use all three bytes.
pub fn some_counts() -> Counts {
    let mut count = 0u32;
    [(); 10].map(|()| {
        [(); 128].map(|()| {
            count = (count.wrapping_mul(1_664_525).wrapping_add(12345)) & 0xff_ffff;
            count
        })
    })
}

pub fn measuring() -> Bench<128> {
    let mut bench = Bench::new(settings(), IMAGE);
    bench.bring_up_running();
    bench
}

pub struct Bench<const CHUNK: usize> {
    pub sensor: Tmf882x<'static, Mock, Line, Line, CHUNK>,
    pub i2c: Mock,
    pub interrupt: Line,
    pub enable: Line,
    pub sink: RecordingSink,
    pub now_ms: u32,
}

type Result = core::result::Result<Polled, Error<ErrorKind, Broken>>;

impl<const CHUNK: usize> Bench<CHUNK> {
    pub fn new(settings: Settings, image: &'static [u8]) -> Self {
        let i2c = Mock::new(&[]);
        let interrupt = Line::new(true);
        let enable = Line::new(false);
        let config = Config::new(settings).unwrap();
        Self {
            sensor: started(Tmf882x::new(
                i2c.clone(),
                interrupt.clone(),
                enable.clone(),
                image,
                config,
            )),
            i2c,
            interrupt,
            enable,
            sink: RecordingSink::default(),
            // So that the milliseconds wrap in the middle of it.
            now_ms: u32::MAX - 5,
        }
    }

    /// Polls with exactly these accesses.
    pub fn poll(&mut self, accesses: &[Access]) -> Result {
        self.i2c.update_expectations(accesses);
        let polled = self.sensor.poll(self.now_ms, &mut self.sink);
        self.i2c.done();
        polled
    }

    /// The same with the interrupt active.
    pub fn serve(&mut self, accesses: &[Access]) -> Result {
        self.interrupt.set(false);
        self.poll(accesses)
    }

    pub fn wait(&mut self, ms: u32) {
        self.now_ms = self.now_ms.wrapping_add(ms);
    }

    /// A step that comes to [`Polled::Working`].
    pub fn work(&mut self, accesses: &[Access]) {
        assert_eq!(self.poll(accesses), Ok(Polled::Working));
    }

    /// From off to the first access, with ENABLE driven low before if `reset`.
    pub fn switch_on(&mut self, reset: bool) {
        self.enable.driven.take();
        self.work(&[]);
        if reset {
            assert_eq!(*self.enable.driven.borrow(), [false]);
            self.wait(5);
            assert_eq!(self.poll(&[]), Ok(Polled::Idle));
            self.wait(1);
            self.work(&[]);
        }
        assert_eq!(self.enable.driven.borrow().last(), Some(&true));
        assert_eq!(self.enable.driven.borrow().len(), 1 + usize::from(reset));
        self.wait(10);
        assert_eq!(self.poll(&[]), Ok(Polled::Idle));
        self.wait(1);
        self.work(&[]);
    }

    /// What runs is `application`.
    pub fn identify(&mut self, application: u8, then: &[u8]) {
        self.work(&[
            read(0x41, 0xE0, &[0x41]),
            read(0x41, 0xE3, &[0x08]),
            read(0x41, 0x00, &[application]),
            write(0x41, then),
        ]);
    }

    /// From the page to measuring.
    pub fn configure(&mut self) {
        self.work(&page(0x41));
        self.work(&measure(0x41));
        self.work(&[read(0x41, 0x08, &[0x01])]);
        assert!(self.sensor.is_measuring());
        assert_eq!(self.poll(&[]), Ok(Polled::Idle));
    }

    /// A sensor that runs the application already.
    pub fn bring_up_running(&mut self) {
        self.switch_on(false);
        self.identify(0x03, &[0x08, 0xFF]);
        assert_eq!(self.poll(&[read(0x41, 0x08, &[0xFF])]), Ok(Polled::Idle));
        self.work(&stopped(0x41));
        self.configure();
    }

    /// The bootloader takes the image 1, 2, 3.
    pub fn load(&mut self) {
        let done = || read(0x41, 0x08, &[0x00, 0x00, 0xFF]);
        self.identify(0x80, &[0x08, 0x14, 0x01, 0x29, 0xC1]);
        self.work(&[done(), write(0x41, &[0x08, 0x43, 0x02, 0x00, 0x00, 0xBA])]);
        self.work(&[done(), write(0x41, &[0x08, 0x41, 0x03, 1, 2, 3, !0x4A])]);
        self.work(&[done(), write(0x41, &[0x08, 0x11, 0x00, 0xEE])]);
    }

    /// A sensor that has to be loaded.
    pub fn bring_up_loading(&mut self) {
        self.switch_on(true);
        self.load();
        self.wait(11);
        self.work(&[read(0x41, 0x00, &[0x03]), write(0x41, &[0x08, 0x16])]);
        self.configure();
    }

    pub fn packet(&mut self, bytes: &[u8]) -> Result {
        let polled = self.serve(&packet(0x41, bytes, CHUNK));
        self.interrupt.set(true);
        polled
    }

    /// A whole set comes out as it went in.
    pub fn set(&mut self, counts: &Counts) {
        let working = iter::repeat_n(Polled::Working, 20);
        let expected = working.chain(iter::repeat_n(Polled::Data, 10));
        for (bytes, expected) in packets(counts).iter().zip(expected) {
            assert_eq!(self.packet(bytes), Ok(expected));
        }
        let pixels = iter::once(99).chain(10..19);
        let histograms = pixels
            .zip(counts)
            .map(|(pixel, counts)| super::SinkCall::Histogram(pixel, counts.to_vec()));
        let frame = super::SinkCall::Frame(537 * 1024);
        let given: Vec<_> = iter::once(frame).chain(histograms).collect();
        assert_eq!(self.sink.take(), given);
    }
}
