//! The histograms of the report: that of the last event of each pixel.

use std::collections::BTreeSet;

use dtof_core::Array;
use serde_json::json;

use super::packed::Packed;
use dtof_data::events::events_csv::range_mm;
use dtof_data::photons::ranges::Ranges;
use dtof_engine::decisions::{Decision, KeptPixels};
use dtof_engine::explain::{Explanation, explain_decisions};
use dtof_engine::settings::Settings;

/// The last decisions of a run.
#[derive(Clone, Copy, Debug)]
pub struct Decisions<'a> {
    /// The settings of the pixels.
    pub settings: &'a Settings,
    /// The pixels whose decisions were kept.
    pub kept: KeptPixels,
    /// In order of level and pixel.
    pub all: &'a [Decision],
    /// The array.
    pub array: Array,
}

impl Decisions<'_> {
    /// The data for the script and its size, at most `room` bytes of base64. If there is no room for all
    /// pixels, those of every second column and row, then of every fourth, and so on.
    pub(super) fn data(&self, room: usize) -> (serde_json::Value, usize) {
        let all = self.last();
        let looks = explain_decisions(self.settings, &all);
        let ranges = self.settings.ranges(self.array).ok();
        let mut kept = self.kept;
        let (packed, count) = loop {
            let pairs = all.iter().zip(&looks);
            let pairs = pairs.filter(|(decision, _)| kept.contains(decision.event.pixel));
            let (mut packed, mut count) = (Packed::default(), 0);
            for (decision, look) in pairs {
                self.push(&mut packed, decision, look, ranges.as_ref());
                count += 1;
            }
            if packed.len() <= room || count == 0 {
                break (packed, count);
            }
            kept.step = kept.step.saturating_mul(2);
            if kept.step > u32::from(u16::MAX) {
                break (Packed::default(), 0);
            }
        };
        let bins = self.settings.bins;
        let last = bins.saturating_sub(1);
        let gate = self.settings.gate();
        let data = json!({
            "bins": bins,
            "gate": gate.map_or([0, last], |(first, last)| [first.into(), last.into()]),
            "quadrants": looks.first().map(|look| look.quadrants),
            "every": kept.step,
            "count": count,
            "deadTime": if self.settings.weighs_dead_time() { self.settings.dead_time() } else { 0 },
            "packed": packed.base64(),
        });
        (data, packed.len())
    }

    /// The last decision of each pixel: the latest of the pixel and of its blocks, and of several at the
    /// same time that of the smallest block.
    fn last(&self) -> Vec<Decision> {
        let mut last: Vec<Option<usize>> = vec![None; self.array.pixels() as usize];
        for (number, decision) in self.all.iter().enumerate() {
            for pixel in self
                .array
                .pixels_of(decision.event.pixel, decision.event.level)
            {
                if let Some(last) = last.get_mut(usize::from(pixel.raw())) {
                    let before = last.map(|before| self.all[before].event.cycle);
                    if before.is_none_or(|before| before < decision.event.cycle) {
                        *last = Some(number);
                    }
                }
            }
        }
        let shown: BTreeSet<usize> = last.into_iter().flatten().collect();
        shown
            .into_iter()
            .map(|number| self.all[number].clone())
            .collect()
    }

    /// Packs event, look, excluded bins and counts.
    fn push(
        &self,
        packed: &mut Packed,
        decision: &Decision,
        look: &Explanation,
        ranges: Option<&Ranges>,
    ) {
        let Decision { event, counts, .. } = decision;
        packed.push(event.pixel.raw());
        packed.push(super::events::kind(event.level, event.echo, event.flags));
        packed.push(event.cycle.raw());
        packed.push(decision.cycles);
        packed.push_range(ranges.map_or(0.0, |ranges| range_mm(event, ranges)));
        packed.push(event.peak_bin.raw());
        // The number plus 1, or 0 for none.
        packed.push(look.needed.map_or(0, |needed| u64::from(needed) + 1));
        let background = look.background.unwrap_or_default();
        packed.push_range(background);
        let [first, width] = look
            .window
            .map_or([0; 2], |(first, last)| [first, last + 1 - first]);
        packed.push(width);
        if width > 0 {
            packed.push(first);
        }
        let excluded = self.excluded_ranges(decision);
        packed.push(excluded.len() as u64);
        for [first, last] in excluded {
            packed.push(first);
            packed.push(last);
        }
        for &count in counts {
            packed.push(count);
        }
    }

    /// First and last bin of each excluded range around earlier echoes.
    fn excluded_ranges(&self, decision: &Decision) -> Vec<[u16; 2]> {
        let mut ranges: Vec<[u16; 2]> = Vec::new();
        let bins = u16::try_from(self.settings.bins).unwrap_or(0);
        for bin in (0..bins).filter(|&bin| decision.excluded.contains(bin)) {
            match ranges.last_mut() {
                Some([_, last]) if *last + 1 == bin => *last = bin,
                _ => ranges.push([bin, bin]),
            }
        }
        ranges
    }
}
