//! A bus with any chip, I²C or SPI, and its pins. The bus can fail, INT may be stuck, and ENABLE may be broken or not
//! be wired. The model knows whether the laser of the chip may shine.

use std::cell::RefCell;
use std::ops::Range;
use std::rc::Rc;

use dtof_chips::tmf8829::varied_counts;
use dtof_chips::{Chip, Tdc7200 as TdcChip, Tmf882x as NineChip, Tmf8829 as TmfChip};
use dtof_sensors::tmf8829::Spi;
use embedded_hal::digital::{ErrorType as PinErrorType, InputPin, OutputPin, PinState};
use embedded_hal::i2c::{self, ErrorKind, I2c, NoAcknowledgeSource};
use embedded_hal::spi::{self, SpiDevice};

use super::Broken;

/// What a bus does in a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The address is not acknowledged; on SPI, the bus fails before the transfer.
    Nack,
    /// An error of the bus, after the chip has taken the transfer.
    Late,
    /// All bytes that are read are this one.
    All(u8),
    /// A bit of a byte that is read is wrong: at this place, this one.
    Bit(usize, u8),
    /// The chip acknowledges a write, and ignores it.
    Ignored,
}

pub const IMAGE: &[u8] = &[7; 100];

/// A chip that may shine.
pub trait Lit: Chip {
    /// Bytes on SPI before the register.
    const OPCODE: usize = 0;
    /// Just switched on.
    fn fresh() -> Self;
    fn shines(&self) -> bool;
    /// It measures, as an earlier firmware has left it.
    fn leave_on(&mut self);
    /// On I²C.
    fn acknowledges(&self, address: u8) -> bool {
        address == 0x41
    }
    /// One transfer on SPI.
    fn spi(&mut self, sent: &[u8], read: &mut [u8]) {
        exchange(self, sent, read);
    }
}

/// One transfer: a write, or a read from the register.
fn exchange(chip: &mut (impl Chip + ?Sized), sent: &[u8], read: &mut [u8]) {
    match (sent, read) {
        (_, []) => chip.write(sent),
        (&[register], bytes) => chip.read(register, bytes),
        _ => panic!("a read names one register"),
    }
}

impl Lit for TmfChip {
    const OPCODE: usize = 1;
    fn fresh() -> Self {
        Self::new(IMAGE, varied_counts())
    }
    fn shines(&self) -> bool {
        self.is_measuring
    }
    fn leave_on(&mut self) {
        self.run();
        self.is_measuring = true;
    }
    fn acknowledges(&self, address: u8) -> bool {
        address == self.address && self.off != Some(0x22)
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

/// The chip, and how its bus fails.
pub struct Wires<C> {
    pub chip: C,
    /// In these transfers. The last that fits counts.
    faults: Vec<(Range<u32>, Fault)>,
    /// Transfers so far.
    pub transfers: u32,
    /// The last transfer was a write that the chip has ignored.
    pub has_ignored: bool,
    /// It shone after a transfer.
    pub has_shone: bool,
    pub is_unplugged: bool,
    pub is_wired: bool,
    pub is_enable_broken: bool,
    pub is_interrupt_broken: bool,
    /// INT is at this level, whatever the chip says.
    pub stuck: Option<bool>,
    /// Every level of ENABLE.
    pub driven: Vec<bool>,
    /// Each transfer: what was written, and what was read.
    pub log: Vec<(Vec<u8>, Option<Vec<u8>>)>,
    /// Clocks of the bus.
    pub clocks: u64,
}

/// A bus with the chip, and both pins; clones are the same.
pub struct Bus<C>(pub Rc<RefCell<Wires<C>>>);

impl<C> Clone for Bus<C> {
    fn clone(&self) -> Self {
        Self(Rc::clone(&self.0))
    }
}

impl<C: Lit> Bus<C> {
    pub fn new(chip: C) -> Self {
        Self(Rc::new(RefCell::new(Wires {
            chip,
            faults: Vec::new(),
            transfers: 0,
            has_ignored: false,
            has_shone: false,
            is_unplugged: false,
            is_wired: true,
            is_enable_broken: false,
            is_interrupt_broken: false,
            stuck: None,
            driven: Vec::new(),
            log: Vec::new(),
            clocks: 0,
        })))
    }

    pub fn shines(&self) -> bool {
        self.0.borrow().chip.shines()
    }

    /// It does not shine, and ENABLE is low.
    pub fn is_off(&self) -> bool {
        !self.shines() && self.0.borrow().driven.last() == Some(&false)
    }

    /// So many transfers fail, after so many others.
    pub fn fail(&self, fault: Fault, after: u32, transfers: u32) {
        let mut wires = self.0.borrow_mut();
        let first = wires.transfers + after;
        let (now, fails) = (wires.transfers, first..first.saturating_add(transfers));
        wires.faults.retain(|(fails, _)| fails.end > now);
        wires.faults.push((fails, fault));
    }

    /// The next transfer fails.
    pub fn fail_next(&self, fault: Fault) {
        self.fail(fault, 0, 1);
    }

    /// No transfer fails any more.
    pub fn heal(&self) {
        self.0.borrow_mut().faults.clear();
    }

    /// Of the transfers in the log, how many begin with these bytes.
    pub fn written(&self, start: &[u8]) -> usize {
        let log = &self.0.borrow().log;
        let begin = |(written, _): &&(Vec<u8>, _)| written.starts_with(start);
        log.iter().filter(begin).count()
    }

    pub fn break_enable(&self, is_broken: bool) {
        self.0.borrow_mut().is_enable_broken = is_broken;
    }

    /// Whether the chip has answered. The log has the bytes from the register on, as on I²C.
    fn carry(
        &self,
        register: usize,
        sent: &[u8],
        read: &mut [u8],
        is_addressed: impl Fn(&C) -> bool,
        exchange: fn(&mut C, &[u8], &mut [u8]),
    ) -> Result<bool, Fault> {
        let wires = &mut *self.0.borrow_mut();
        let now = wires.transfers;
        let mut faults = wires.faults.iter().rev();
        let fault = faults.find_map(|(fails, fault)| fails.contains(&now).then_some(*fault));
        wires.transfers += 1;
        wires.has_ignored = fault == Some(Fault::Ignored) && read.is_empty();
        // A byte may stand between the register and what is read.
        let end = if read.is_empty() {
            sent.len()
        } else {
            register + 1
        };
        wires.log.push((sent[register..end].to_vec(), None));
        if fault == Some(Fault::Nack) {
            return Err(Fault::Nack);
        }
        let is_enabled = !wires.is_wired || wires.driven.last() == Some(&true);
        let is_there = is_enabled && !wires.is_unplugged && is_addressed(&wires.chip);
        if !is_there {
            read.fill(0xFF);
        } else if !wires.has_ignored {
            exchange(&mut wires.chip, sent, read);
            wires.has_shone |= wires.chip.shines();
        }
        match fault {
            Some(Fault::Late) => return Err(Fault::Late),
            Some(Fault::All(byte)) => read.fill(byte),
            Some(Fault::Bit(at, bit)) if !read.is_empty() => {
                read[at % read.len()] ^= 1 << (bit & 7);
            }
            _ => {}
        }
        wires.log.last_mut().unwrap().1 = Some(read.to_vec());
        Ok(is_there)
    }
}

/// A bus of a driver that is made of the wires.
pub trait On<C> {
    fn on(bus: &Bus<C>) -> Self;
}

impl<C> On<C> for Bus<C> {
    fn on(bus: &Self) -> Self {
        bus.clone()
    }
}

impl<C> On<C> for Spi<Bus<C>> {
    fn on(bus: &Bus<C>) -> Self {
        Self(bus.clone())
    }
}

impl<C> i2c::ErrorType for Bus<C> {
    type Error = ErrorKind;
}

impl<C: Lit> I2c for Bus<C> {
    fn transaction(&mut self, to: u8, of: &mut [i2c::Operation<'_>]) -> Result<(), ErrorKind> {
        let (sent, read) = match of {
            [i2c::Operation::Write(sent)] => (sent, &mut [][..]),
            [i2c::Operation::Write(sent), i2c::Operation::Read(read)] => (sent, &mut **read),
            other => panic!("{other:?}"),
        };
        // An address before each direction, and nine clocks a byte.
        let again = usize::from(!read.is_empty());
        self.0.borrow_mut().clocks += 9 * (1 + sent.len() + again + read.len()) as u64;
        match self.carry(0, sent, read, |chip| chip.acknowledges(to), exchange) {
            Ok(true) => Ok(()),
            Ok(false) | Err(Fault::Nack) => {
                self.0.borrow_mut().log.last_mut().unwrap().1 = None;
                Err(ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address))
            }
            Err(_) => Err(ErrorKind::Bus),
        }
    }
}

impl<C> spi::ErrorType for Bus<C> {
    type Error = spi::ErrorKind;
}

/// A chip that is not there does not drive MISO.
impl<C: Lit> SpiDevice for Bus<C> {
    fn transaction(&mut self, of: &mut [spi::Operation<'_, u8>]) -> Result<(), spi::ErrorKind> {
        let mut sent = Vec::new();
        let mut read = &mut [][..];
        for operation in of {
            match operation {
                spi::Operation::Write(bytes) if read.is_empty() => sent.extend_from_slice(bytes),
                spi::Operation::Read(bytes) if read.is_empty() => read = bytes,
                other => panic!("{other:?}"),
            }
        }
        self.0.borrow_mut().clocks += 8 * (sent.len() + read.len()) as u64;
        let taken = self.carry(C::OPCODE, &sent, read, |_| true, C::spi);
        taken.map(drop).map_err(|_| spi::ErrorKind::Other)
    }
}

impl<C> PinErrorType for Bus<C> {
    type Error = Broken;
}

impl<C: Lit> InputPin for Bus<C> {
    fn is_high(&mut self) -> Result<bool, Broken> {
        let wires = self.0.borrow();
        let is_low = wires.chip.interrupts() && !wires.is_unplugged;
        let level = wires.stuck.unwrap_or(!is_low);
        (!wires.is_interrupt_broken).then_some(level).ok_or(Broken)
    }
    fn is_low(&mut self) -> Result<bool, Broken> {
        self.is_high().map(|is_high| !is_high)
    }
}

impl<C: Lit> OutputPin for Bus<C> {
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
