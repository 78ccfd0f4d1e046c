//! What the program reads of the histograms while photons come.

use std::collections::VecDeque;
use std::ops::RangeInclusive;

use anyhow::{Context, Result, ensure};
use dtof_core::AsyncPixel;

use super::command::{Access, Command, register};

/// Clocks after which a photon is in the histogram.
const UNTIL_COUNTED: u64 = 8;

/// Clocks after a look by which every exposure that ends with it has ended.
const UNTIL_ENDED: u64 = 64;

/// Eight bins that were asked for.
#[derive(Debug)]
struct Eight {
    pixel: usize,
    first: usize,
    requested_at: u64,
    /// What each has to be read as; `None` if its exposure ended meanwhile.
    expected: Option<Vec<RangeInclusive<u32>>>,
}

/// What was asked for, and what was read.
#[derive(Debug, Default)]
pub struct Reads {
    recent: VecDeque<(u64, u8, u16)>,
    /// When the last exposure of each macropixel ended.
    ended: Vec<u64>,
    requests: VecDeque<Eight>,
    are_there: bool,
    read: Vec<u32>,
    /// How many were as they had to be.
    pub compared: u64,
}

impl Reads {
    /// What a clock brings, after its photon was counted.
    pub fn clock(&mut self, clock: u64, command: &Command, pixels: &[AsyncPixel<128>]) {
        while self
            .recent
            .front()
            .is_some_and(|&(at, ..)| at + UNTIL_COUNTED < clock)
        {
            self.recent.pop_front();
        }
        self.recent
            .extend(command.photon.map(|(pixel, code)| (clock, pixel, code)));
        let count = |eight: &Eight, bin: usize| {
            pixels
                .get(eight.pixel)
                .and_then(|pixel| pixel.histogram().count(eight.first + bin))
        };
        match command.access {
            Some(Access::Write(register::HISTOGRAM, address)) => {
                let address = address as usize;
                let mut eight = Eight {
                    pixel: address >> 4,
                    first: (address & 15) * 8,
                    requested_at: clock,
                    expected: None,
                };
                let had_time = |&ended: &u64| ended == 0 || ended + UNTIL_ENDED < clock;
                if self.ended.get(eight.pixel).is_none_or(had_time) {
                    let ranges = (0..8).filter_map(|bin| {
                        let now = count(&eight, bin)?;
                        let of_bin = |&&(_, pixel, code): &&(u64, u8, u16)| {
                            (usize::from(pixel), usize::from(code))
                                == (eight.pixel, eight.first + bin)
                        };
                        let on_way =
                            u32::try_from(self.recent.iter().filter(of_bin).count()).ok()?;
                        Some(now.saturating_sub(on_way)..=now)
                    });
                    eight.expected = Some(ranges.collect());
                }
                self.requests.push_back(eight);
            }
            // They were there when the program asked before.
            Some(Access::Read(register::BINS)) => {
                if let Some(mut eight) = self.requests.pop_back() {
                    let ended = self
                        .ended
                        .get(eight.pixel)
                        .is_some_and(|&ended| ended >= eight.requested_at);
                    let ranges = eight.expected.take().filter(|_| !ended);
                    let until = |(bin, range): (usize, RangeInclusive<u32>)| {
                        Some(*range.start()..=count(&eight, bin)?)
                    };
                    eight.expected = ranges
                        .map(|ranges| ranges.into_iter().enumerate().filter_map(until).collect());
                    self.requests.push_back(eight);
                }
            }
            _ => {}
        }
    }

    /// A look in this clock; which exposures ended is what their histograms say.
    pub fn look(&mut self, clock: u64, pixels: &[AsyncPixel<128>]) {
        self.ended.resize(pixels.len(), 0);
        for (ended, pixel) in self.ended.iter_mut().zip(pixels) {
            if (0..128).all(|bin| pixel.histogram().count(bin) == Some(0)) {
                *ended = clock;
            }
        }
    }

    /// A register of the histograms was read.
    pub fn read(&mut self, clock: u64, address: u32, data: u32) -> Result<()> {
        if address == register::HISTOGRAM {
            self.are_there = data == 0;
            self.read.clear();
            return Ok(());
        }
        self.read.extend([data & 0xffff, data >> 16]);
        if address < register::LAST_BINS {
            return Ok(());
        }
        let eight = self
            .requests
            .pop_front()
            .context("no bins were asked for")?;
        let Some(expected) = eight.expected.as_ref().filter(|_| self.are_there) else {
            return Ok(());
        };
        let is_right = expected
            .iter()
            .zip(&self.read)
            .all(|(range, bin)| range.contains(bin));
        ensure!(
            is_right && expected.len() == self.read.len(),
            "clock {clock}: bins read as {:?}: {eight:?}",
            self.read
        );
        self.compared += 1;
        Ok(())
    }
}
