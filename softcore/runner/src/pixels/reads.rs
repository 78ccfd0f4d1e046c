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
        let is_old = |&(at, ..): &(u64, u8, u16)| at + UNTIL_COUNTED < clock;
        while self.recent.front().is_some_and(is_old) {
            self.recent.pop_front();
        }
        let photon = command.photon.map(|(pixel, code)| (clock, pixel, code));
        self.recent.extend(photon);
        let count = |pixel: usize, bin| pixels.get(pixel)?.histogram().count(bin);
        match command.access {
            Some(Access::Write(register::HISTOGRAM, address)) => {
                let address = address as usize;
                let (pixel, first) = (address >> 4, (address & 15) * 8);
                let range = |bin| {
                    let now = count(pixel, bin)?;
                    let is_of_bin = |&&(_, of, code): &&(u64, u8, u16)| {
                        (usize::from(of), usize::from(code)) == (pixel, bin)
                    };
                    let on_way = self.recent.iter().filter(is_of_bin).count();
                    Some(now.saturating_sub(u32::try_from(on_way).ok()?)..=now)
                };
                let had_time = |&ended: &u64| ended == 0 || ended + UNTIL_ENDED < clock;
                let is_known = self.ended.get(pixel).is_none_or(had_time);
                let expected = is_known.then(|| (first..first + 8).filter_map(range).collect());
                self.requests.push_back(Eight {
                    pixel,
                    first,
                    requested_at: clock,
                    expected,
                });
            }
            // They were there when the program asked before.
            Some(Access::Read(register::BINS)) => {
                let Some(eight) = self.requests.back_mut() else {
                    return;
                };
                let ended = self.ended.get(eight.pixel);
                if ended.is_some_and(|&ended| ended >= eight.requested_at) {
                    eight.expected = None;
                }
                for (bin, range) in (eight.first..).zip(eight.expected.iter_mut().flatten()) {
                    if let Some(now) = count(eight.pixel, bin) {
                        *range = *range.start()..=now;
                    }
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
