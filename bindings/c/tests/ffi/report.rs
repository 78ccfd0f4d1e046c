//! A device with the C functions reports what a sidecar reports.

use core::ptr::null_mut;

use dtof_c::*;
use dtof_core::{BlockLevel, PixelAddress};
use dtof_firmware::sidecar::{Block, Pixel, Sidecar};
use dtof_link::endpoint::{Endpoint, LinkCounters};
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::message::{self, greeting};
use dtof_link::{AdaptiveBinning, Configuration, Report, Source, Token};

use crate::array::{BLOCKS, Driven, PIXELS};
use crate::{OK, link, zeroed};

/// 16 pixels with blocks of four, and photons from the host.
const CONFIGURATION: Configuration = Configuration {
    l1: 20,
    l2: 200,
    pixels: 16,
    columns: 4,
    binning: Some(AdaptiveBinning {
        levels: BlockLevel::saturating(1),
        patience: 8,
    }),
    echo_guard_bins: 0,
    echo_wait: 4,
    source: Source::Link,
    ..Configuration::DEFAULT
};
const LEFT_OUT: u16 = 5;

/// The photons of a laser cycle, pixel by pixel: bright pixels, dim ones that are silent alone, one that is left out,
/// and one that the configuration does not have.
fn photons(cycle: u16) -> Vec<(u16, u16)> {
    let mut photons = vec![(0, 60), (3, cycle % 140), (LEFT_OUT, 60)];
    photons.extend(match cycle % 12 {
        0 => Some((10, 30)),
        6 => Some((11, 30)),
        _ => None,
    });
    photons.extend([(16, 60), (17, 60)]);
    photons
}

/// A sidecar and its host.
struct Rust<'a> {
    sidecar: Sidecar<'a>,
    host: Endpoint,
    up: Deframer,
    down: Deframer,
}

impl<'a> Rust<'a> {
    fn new(
        pixels: &'a mut heapless::Vec<Pixel, { PIXELS as usize }>,
        blocks: &'a mut heapless::Vec<Block, BLOCKS>,
    ) -> Self {
        let mut sidecar = Sidecar::new(pixels, blocks, None);
        sidecar.leave_out(PixelAddress::new(LEFT_OUT));
        let mut rust = Self {
            sidecar,
            host: Endpoint::host(1, greeting(0, 0), 0),
            up: Deframer::new(),
            down: Deframer::new(),
        };
        rust.begin(1);
        rust
    }

    fn begin(&mut self, session: u16) {
        self.host = Endpoint::host(session, greeting(0, 0), 0);
        self.exchange();
        assert!(self.host.is_open());
    }

    /// All that is due goes over the wire. Returns the last message that is no event.
    fn exchange(&mut self) -> Option<(u8, Vec<u8>)> {
        let mut answer = None;
        loop {
            let mut wire = [0; WIRE_BYTES];
            let down = self.host.transmit(0, &mut wire);
            for &byte in &wire[..down] {
                if let Some(frame) = self.down.push(byte) {
                    self.sidecar.receive(frame, 0);
                }
            }
            self.sidecar.work(0);
            let up = self.sidecar.transmit(0, &mut wire);
            for &byte in &wire[..up] {
                if let Some(frame) = self.up.push(byte) {
                    self.host.receive(frame, 0);
                }
            }
            while let Some(message) = self.host.take() {
                if message.kind != message::EVENTS {
                    answer = Some((message.kind, message.body.to_vec()));
                }
            }
            if up + down == 0 {
                return answer;
            }
        }
    }

    fn configure(&mut self) {
        let record = CONFIGURATION.to_le_bytes();
        self.host.offer(message::CONFIGURE, &record).unwrap();
        assert_eq!(self.exchange(), Some((message::CONFIGURED, vec![])));
    }

    fn laser_cycle(&mut self, cycle: u16) {
        let (mut body, mut at) = (Vec::new(), 0);
        for (pixel, code) in photons(cycle) {
            if pixel > at {
                let pixels = u8::try_from(pixel - at).unwrap();
                body.extend(Token::Advance { pixels }.to_bytes());
                at = pixel;
            }
            body.extend(Token::Photon { code }.to_bytes());
        }
        body.extend(Token::EndOfCycles { cycles: 1 }.to_bytes());
        self.host.offer(message::PHOTONS, &body).unwrap();
        assert_eq!(self.exchange(), None);
    }

    /// The report, but for the link.
    fn report(&mut self) -> Report {
        self.host.offer(message::STATISTICS_REQUEST, &[]).unwrap();
        let (kind, body) = self.exchange().unwrap();
        assert_eq!(kind, message::STATISTICS);
        Report {
            link: LinkCounters::default(),
            ..Report::from_le_bytes(&body).unwrap()
        }
    }
}

/// The same with the functions of C, as `examples/device.c` calls them.
struct C(Driven);

impl C {
    fn new() -> Self {
        let mut driven = Driven::new();
        // SAFETY: the pointer leads to an array.
        let status = unsafe { dtof_array_leave_out(&mut driven.array, LEFT_OUT) };
        assert_eq!(status, OK);
        Self(driven)
    }

    fn clear(&mut self) {
        // SAFETY: the pointer leads to an array.
        assert_eq!(unsafe { dtof_array_clear(&mut self.0.array) }, OK);
    }

    fn configure(&mut self) {
        let (body, mut read) = (CONFIGURATION.to_le_bytes(), zeroed());
        // SAFETY: both pointers lead to objects of their types.
        let status = unsafe { dtof_device_config_read(body.as_ptr(), body.len(), 0, &mut read) };
        assert_eq!(status, OK);
        assert_eq!(self.0.configure(&read.pixel, &read.layout), OK);
    }

    fn laser_cycle(&mut self, cycle: u16) {
        let array = &raw mut self.0.array;
        for (pixel, code) in photons(cycle) {
            // SAFETY: the pointer leads to an array.
            assert_eq!(unsafe { dtof_array_photon(array, pixel, code) }, OK);
        }
        // SAFETY: the same, and a pointer that may be null.
        let status = unsafe { dtof_array_end_laser_cycles(array, 1, null_mut()) };
        assert_eq!(status, OK);
        while self.0.next_event().is_some() {}
    }

    fn report(&self) -> Report {
        let (array, link, mut report) = (&self.0.array, link(), dtof_report_t::default());
        let (mut pixels, mut blocks, mut losses) = (zeroed(), zeroed(), dtof_losses_t::default());
        let mut body = [0; DTOF_REPORT_BYTES];
        // SAFETY: each pointer leads to an object of its type.
        unsafe {
            let status = dtof_array_statistics(array, &mut pixels, &mut blocks, &mut losses);
            assert_eq!(status, OK);
            assert_eq!(dtof_array_cycles(array, &mut report.cycles), OK);
            report.unaddressed = losses.unaddressed + losses.left_out;
            let room = body.as_mut_ptr();
            assert_eq!(
                dtof_report_write(&report, &pixels, &blocks, &link, room),
                OK
            );
        }
        Report::from_le_bytes(&body).unwrap()
    }
}

#[test]
fn a_device_reports_what_a_sidecar_reports() {
    let (mut pixels, mut blocks) = (heapless::Vec::new(), heapless::Vec::new());
    let (mut rust, mut c) = (Rust::new(&mut pixels, &mut blocks), C::new());
    for session in 1..3 {
        // Before the first configuration of a session there is nothing of the session before.
        assert_eq!(c.report(), Report::default());
        assert_eq!(rust.report(), Report::default());
        rust.configure();
        c.configure();
        for cycle in 0..100 {
            rust.laser_cycle(cycle);
            c.laser_cycle(cycle);
        }
        let report = c.report();
        assert_eq!(report, rust.report());
        assert_eq!((report.cycles, report.unaddressed), (100, 300));
        assert!(report.statistics.events > 3 && report.blocks.events > 0);
        rust.begin(session + 1);
        c.clear();
    }
}
