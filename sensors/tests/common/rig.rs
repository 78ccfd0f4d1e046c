//! Any chip on a bus that can fail, with an ENABLE that may be broken or not be wired, and whether its laser may shine.

use std::cell::RefCell;
use std::fmt::Debug;
use std::ops::Range;
use std::rc::Rc;

use dtof_chips::{Chip, Tdc7200 as TdcChip, Tmf882x as NineChip, Tmf8829 as TmfChip};
use dtof_core::PixelAddress;
use dtof_core::fixed::types::U16F16;
use dtof_sensors::dither::Dither;
use dtof_sensors::tdc7200::{self, Tdc7200};
use dtof_sensors::tmf882x::{self, Tmf882x};
use dtof_sensors::tmf8829::{self, Spi, Tmf8829, Zones};
use dtof_sensors::{Polled, Sensor};
use embedded_hal::digital::{ErrorType as PinErrorType, InputPin, OutputPin, PinState};
use embedded_hal::i2c::{self, ErrorKind, I2c, NoAcknowledgeSource};
use embedded_hal::spi::{self, SpiDevice};

use super::tdc7200::mode_1;
use super::tmf8829::bench::settings;
use super::tmf8829::bus::{Bus, Fault, Wired, spoil};
use super::{Broken, RecordingSink};

pub const IMAGE: &[u8] = &[7; 100];

/// A chip that may shine.
pub trait Lit: Chip {
    /// Just switched on.
    fn fresh() -> Self;
    fn shines(&self) -> bool;
    /// It measures, as an earlier firmware has left it.
    fn leave_on(&mut self);
    /// One transfer on SPI.
    fn spi(&mut self, sent: &[u8], read: &mut [u8]) {
        exchange(self, sent, read);
    }
}

/// One transfer: a write, or a read from the register.
fn exchange(chip: &mut (impl Chip + ?Sized), sent: &[u8], read: &mut [u8]) {
    match read {
        [] => chip.write(sent),
        bytes => chip.read(sent[0], bytes),
    }
}

impl Lit for TmfChip {
    fn fresh() -> Self {
        let scene = |_, zone: Option<_>, bins| vec![1; zone.map_or(64, |_| bins)];
        Self::new(IMAGE, Rc::new(scene))
    }
    fn shines(&self) -> bool {
        self.is_measuring
    }
    fn leave_on(&mut self) {
        self.run();
        self.is_measuring = true;
    }
    fn spi(&mut self, sent: &[u8], read: &mut [u8]) {
        Self::spi(self, sent, read);
    }
}

/// Its INT is low as long as it measures.
impl Lit for NineChip {
    fn fresh() -> Self {
        Self::default()
    }
    fn shines(&self) -> bool {
        self.interrupts()
    }
    fn leave_on(&mut self) {
        self.write(&[0x08, 0x11]);
        self.write(&[0x08, 0x10]);
    }
}

/// Armed, it raises TRIGG.
impl Lit for TdcChip {
    fn fresh() -> Self {
        Self::default()
    }
    fn shines(&self) -> bool {
        self.interrupts()
    }
    fn leave_on(&mut self) {
        self.write(&[0x40, 0x01]);
    }
}

pub struct Wires<C> {
    pub chip: C,
    /// These transfers fail so.
    pub fault: Fault,
    pub fails: Range<u32>,
    /// Transfers so far.
    pub transfers: u32,
    pub is_wired: bool,
    pub is_enable_broken: bool,
    pub is_interrupt_broken: bool,
    /// Every level of ENABLE.
    pub driven: Vec<bool>,
}

/// A bus with the chip, and both pins; clones are the same.
pub struct Rig<C>(pub Rc<RefCell<Wires<C>>>);

impl<C> Clone for Rig<C> {
    fn clone(&self) -> Self {
        Self(Rc::clone(&self.0))
    }
}

impl<C: Lit> Rig<C> {
    pub fn new(is_wired: bool) -> Self {
        Self(Rc::new(RefCell::new(Wires {
            chip: C::fresh(),
            fault: Fault::Late,
            fails: 0..0,
            transfers: 0,
            is_wired,
            is_enable_broken: false,
            is_interrupt_broken: false,
            driven: Vec::new(),
        })))
    }

    pub fn shines(&self) -> bool {
        self.0.borrow().chip.shines()
    }

    /// It does not shine, and ENABLE is low.
    pub fn is_off(&self) -> bool {
        !self.shines() && self.0.borrow().driven.last() == Some(&false)
    }

    /// So many transfers fail, after so many that do not.
    pub fn fail(&self, fault: Fault, after: u32, transfers: u32) {
        let mut wires = self.0.borrow_mut();
        let first = wires.transfers + after;
        (wires.fault, wires.fails) = (fault, first..first.saturating_add(transfers));
    }

    pub fn break_enable(&self, is_broken: bool) {
        self.0.borrow_mut().is_enable_broken = is_broken;
    }

    /// Whether somebody was there.
    fn carry(
        &self,
        sent: &[u8],
        read: &mut [u8],
        exchange: fn(&mut C, &[u8], &mut [u8]),
    ) -> Result<bool, Fault> {
        let mut wires = self.0.borrow_mut();
        let fault = wires
            .fails
            .contains(&wires.transfers)
            .then_some(wires.fault);
        wires.transfers += 1;
        if fault == Some(Fault::Nack) {
            return Err(Fault::Nack);
        }
        let is_there = !wires.is_wired || wires.driven.last() == Some(&true);
        if is_there {
            exchange(&mut wires.chip, sent, read);
        } else {
            read.fill(0xFF);
        }
        if !read.is_empty() {
            spoil(fault, read);
        }
        match fault {
            Some(Fault::Late) => Err(Fault::Late),
            _ => Ok(is_there),
        }
    }
}

impl<C> i2c::ErrorType for Rig<C> {
    type Error = ErrorKind;
}

impl<C: Lit> I2c for Rig<C> {
    fn transaction(&mut self, _: u8, of: &mut [i2c::Operation<'_>]) -> Result<(), ErrorKind> {
        let taken = match of {
            [i2c::Operation::Write(sent)] => self.carry(sent, &mut [], exchange),
            [i2c::Operation::Write(sent), i2c::Operation::Read(read)] => {
                self.carry(sent, read, exchange)
            }
            other => panic!("{other:?}"),
        };
        match taken {
            Ok(true) => Ok(()),
            Ok(false) | Err(Fault::Nack) => {
                Err(ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address))
            }
            Err(_) => Err(ErrorKind::Bus),
        }
    }
}

impl<C> spi::ErrorType for Rig<C> {
    type Error = spi::ErrorKind;
}

/// Nobody drives MISO of a chip that is not there.
impl<C: Lit> SpiDevice for Rig<C> {
    fn transaction(&mut self, of: &mut [spi::Operation<'_, u8>]) -> Result<(), spi::ErrorKind> {
        let mut sent = Vec::new();
        let mut read = &mut [][..];
        for operation in of {
            match operation {
                spi::Operation::Write(bytes) => sent.extend_from_slice(bytes),
                spi::Operation::Read(bytes) => read = bytes,
                other => panic!("{other:?}"),
            }
        }
        let taken = self.carry(&sent, read, C::spi);
        taken.map(drop).map_err(|_| spi::ErrorKind::Other)
    }
}

impl<C> PinErrorType for Rig<C> {
    type Error = Broken;
}

impl<C: Lit> InputPin for Rig<C> {
    fn is_high(&mut self) -> Result<bool, Broken> {
        let wires = self.0.borrow();
        let level = !wires.chip.interrupts();
        (!wires.is_interrupt_broken).then_some(level).ok_or(Broken)
    }
    fn is_low(&mut self) -> Result<bool, Broken> {
        self.is_high().map(|is_high| !is_high)
    }
}

impl<C: Lit> OutputPin for Rig<C> {
    fn set_low(&mut self) -> Result<(), Broken> {
        self.set_state(false.into())
    }
    fn set_high(&mut self) -> Result<(), Broken> {
        self.set_state(true.into())
    }
    fn set_state(&mut self, level: PinState) -> Result<(), Broken> {
        let mut wires = self.0.borrow_mut();
        if wires.is_enable_broken {
            return Err(Broken);
        }
        wires.driven.push(level.into());
        if wires.is_wired && level == PinState::Low {
            wires.chip.reset();
        }
        Ok(())
    }
}

/// A driver on a rig.
pub trait Part: Sensor<Error: Debug + PartialEq> + Sized {
    type Chip: Lit;
    /// It has no command to stop, and needs a reset to come up.
    const NEEDS_ENABLE: bool;
    fn on(rig: &Rig<Self::Chip>) -> Self;
    /// The next poll goes on with the measurement.
    fn goes_on(&self) -> bool;
    fn errors(&self) -> u32;
    /// Releases it: ENABLE, and its error.
    fn give_back(self) -> (Rig<Self::Chip>, Option<Broken>);
}

pub type Of8829<B> = Tmf8829<'static, B, Rig<TmfChip>, Rig<TmfChip>, 252>;
pub type OfI2c = Of8829<Rig<TmfChip>>;
pub type OfSpi = Of8829<Spi<Rig<TmfChip>>>;
pub type OfNine = Tmf882x<'static, Rig<NineChip>, Rig<NineChip>, Rig<NineChip>>;
pub type OfTdc = Tdc7200<Rig<TdcChip>, Rig<TdcChip>, Rig<TdcChip>>;

pub fn config_8829(interface: tmf8829::Interface) -> tmf8829::Config {
    tmf8829::Config::new(tmf8829::Settings {
        interface,
        ..settings(Zones::Z8x8)
    })
    .unwrap()
}

pub fn config_nine() -> tmf882x::Config {
    tmf882x::Config::new(tmf882x::Settings::new(PixelAddress::new(0))).unwrap()
}

/// The driver, its chip, whether it is up, and how it is made of bus and pins.
macro_rules! part {
    ($part:ty, $chip:ty, $needs_enable:expr, $is_up:ident, $new:expr) => {
        impl Part for $part {
            type Chip = $chip;
            const NEEDS_ENABLE: bool = $needs_enable;
            fn on(rig: &Rig<$chip>) -> Self {
                $new(rig.clone(), rig.clone(), rig.clone())
            }
            fn goes_on(&self) -> bool {
                self.$is_up()
            }
            fn errors(&self) -> u32 {
                self.counts().errors
            }
            fn give_back(self) -> (Rig<$chip>, Option<Broken>) {
                match self.release() {
                    Ok((_, _, enable)) => (enable, None),
                    Err(failed) => (failed.enable, Some(failed.error)),
                }
            }
        }
    };
}

part!(
    OfI2c,
    TmfChip,
    false,
    is_measuring,
    |bus, interrupt, enable| {
        Self::new(bus, interrupt, enable, IMAGE, config_8829(Bus::INTERFACE))
    }
);
part!(
    OfSpi,
    TmfChip,
    false,
    is_measuring,
    |bus, interrupt, enable| {
        Self::new(
            Spi(bus),
            interrupt,
            enable,
            IMAGE,
            config_8829(tmf8829::Interface::Spi),
        )
    }
);
part!(
    OfNine,
    NineChip,
    false,
    is_measuring,
    |bus, interrupt, enable| { Self::new(bus, interrupt, enable, IMAGE, config_nine()) }
);
part!(OfTdc, TdcChip, true, is_armed, |bus, interrupt, enable| {
    Self::new(
        bus,
        interrupt,
        enable,
        tdc7200::Config::new(mode_1()).unwrap(),
    )
});

/// A driver beside its chip.
pub struct Bench<P: Part> {
    pub sensor: P,
    pub rig: Rig<P::Chip>,
    pub sink: RecordingSink,
    pub now_ms: u32,
}

impl<P: Part> Bench<P> {
    /// Not started.
    pub fn new(is_wired: bool) -> Self {
        let rig = Rig::new(is_wired);
        Self {
            sensor: P::on(&rig),
            rig,
            sink: RecordingSink::default(),
            // So that the milliseconds wrap in the middle of it.
            now_ms: u32::MAX - 5,
        }
    }

    /// Started, and after so many polls.
    pub fn after(polls: u32, is_wired: bool) -> Self {
        let mut bench = Self::new(is_wired);
        bench.start();
        for _ in 0..polls {
            let _ = bench.poll().unwrap();
        }
        bench
    }

    pub fn start(&mut self) {
        self.sensor.start(U16F16::lit("250"), Dither::OFF);
    }

    pub fn poll(&mut self) -> Result<Polled, P::Error> {
        self.now_ms = self.now_ms.wrapping_add(1);
        self.sensor.poll(self.now_ms, &mut self.sink)
    }

    pub fn transfers(&self) -> u32 {
        self.rig.0.borrow().transfers
    }

    /// It ends its stop in three polls at most. Then it is dark, and nothing is driven or transferred.
    pub fn ends_its_stop(&mut self) {
        let errors = self.sensor.errors();
        for _ in 0..3 {
            if self.sensor.is_stopping() {
                assert_eq!(self.poll(), Ok(Polled::Idle));
            }
        }
        let before = (self.transfers(), self.rig.0.borrow().driven.len());
        for _ in 0..20 {
            assert!(!self.sensor.is_stopping() && self.rig.is_off());
            assert_eq!(self.poll(), Ok(Polled::Idle));
        }
        assert_eq!((self.transfers(), self.rig.0.borrow().driven.len()), before);
        assert_eq!(self.sensor.errors(), errors);
    }
}
