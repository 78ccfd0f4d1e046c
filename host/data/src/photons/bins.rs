//! Turns the bins of a recording into those of a run: a power of two from 8 to 1024.
//!
//! First, neighbouring bins are summed. Then empty bins are added at the end, or bins at the end
//! are cut off. Nothing is cut off unless fewer bins are requested.

use std::iter::repeat_n;

use anyhow::{Result, ensure};

use crate::options::Refused;
use crate::options::rows::{Row, grouped};
use crate::photons::histograms::Histograms;

/// The most bins of a recording.
pub const MOST_BINS: usize = 4096;
/// The most bins of a run.
const MOST_OF_A_RUN: usize = 1024;
/// The fewest bins in which a peak can be found.
pub const FEWEST: usize = 8;

/// How the bins of a recording become those of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BinFit {
    /// Bins of the recording.
    recorded: usize,
    /// How many of them were measured in full, from the first on.
    measured: usize,
    /// How many neighbours are summed.
    rebin: usize,
    /// Bins of the run.
    run: usize,
}

impl BinFit {
    /// Sums `rebin` neighbours of `recorded` bins, the first `measured` of which were measured in
    /// full. The run has `requested` bins, or the next power of two.
    ///
    /// # Errors
    /// Fails if no run can have so many bins.
    pub fn new(
        recorded: usize,
        measured: usize,
        rebin: usize,
        requested: Option<u16>,
    ) -> Result<Self> {
        ensure!(
            (FEWEST..=MOST_BINS).contains(&recorded),
            Refused::input(format!(
                "{recorded} bins: must be from {FEWEST} to {MOST_BINS} (`axes` says which axis they \
                 are)"
            ))
        );
        let summed = recorded.div_ceil(rebin.max(1));
        let run = requested.map_or(summed.next_power_of_two(), usize::from);
        ensure!(
            run <= MOST_OF_A_RUN,
            Refused::input(format!(
                "{summed} bins are more than {MOST_OF_A_RUN}: add up neighbours with `rebin` {}, or \
                 cut off the last with `bins` {MOST_OF_A_RUN}",
                recorded.div_ceil(MOST_OF_A_RUN)
            ))
        );
        let fit = Self {
            recorded,
            measured: measured.min(recorded),
            rebin: rebin.max(1),
            run,
        };
        ensure!(
            fit.complete_sums() >= FEWEST,
            Refused::value(
                "rebin",
                rebin,
                format!(
                    "makes {} whole bins of {measured}: must be at least {FEWEST}",
                    fit.complete_sums()
                )
            )
        );
        Ok(fit)
    }

    /// Bins of the run.
    #[must_use]
    pub fn bins(&self) -> usize {
        self.run
    }

    /// Bins of the run that are sums of `rebin` measured bins.
    fn complete_sums(&self) -> usize {
        (self.measured / self.rebin).min(self.run)
    }

    /// The first and the last bin that were measured in full, if not all were.
    #[must_use]
    pub fn gate(&self) -> Option<(u16, u16)> {
        let last = u16::try_from(self.complete_sums() - 1).unwrap_or(u16::MAX);
        (self.complete_sums() < self.run).then_some((0, last))
    }

    /// The histograms of a run, and the photons that were cut off.
    #[must_use]
    pub fn apply(&self, recorded: Histograms) -> (Histograms, u64) {
        if self.rebin == 1 && self.run == recorded.bins() {
            return (recorded, 0);
        }
        let (mut all, mut all_cut_off) = (Histograms::new(self.run), 0_u64);
        for histogram in recorded.iter() {
            let sums = histogram.chunks(self.rebin).map(sum);
            let sums: Vec<u64> = sums.chain(repeat_n(0, self.run)).collect();
            let (kept, cut_off) = sums.split_at(self.run);
            all.extend(kept);
            all_cut_off = all_cut_off.saturating_add(sum(cut_off));
        }
        (all, all_cut_off)
    }

    /// The changes as a table; `cut_off` photons were cut off.
    #[must_use]
    pub fn rows(&self, cut_off: u64) -> Vec<Row> {
        let row = |name: &str, value: String| (name.to_owned(), value);
        let mut rows = Vec::new();
        if self.rebin == 1 && self.run == self.recorded {
            return rows;
        }
        rows.push(row("bins of the recording", self.recorded.to_string()));
        let summed = self.recorded.div_ceil(self.rebin);
        if self.rebin > 1 {
            let rest = self.recorded % self.rebin;
            let last = match rest {
                0 => String::new(),
                rest => format!(", the last of {rest}"),
            };
            let text = format!("{summed} sums of {}{last}", self.rebin);
            rows.push(row("neighbours added up", text));
        }
        if summed < self.run {
            rows.push(row("empty bins added", (self.run - summed).to_string()));
        }
        if summed > self.run {
            let text = format!(
                "the last {}, with {} photons",
                summed - self.run,
                grouped(cut_off)
            );
            rows.push(row("bins cut off", text));
        }
        rows
    }
}

/// Saturates: no pixel may have so many photons.
fn sum(counts: &[u64]) -> u64 {
    counts
        .iter()
        .fold(0, |sum: u64, &count| sum.saturating_add(count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The bins of one histogram in a run, and the photons that were cut off.
    fn applied(fit: BinFit, recorded: &[u64]) -> (Vec<u64>, u64) {
        let (of_run, cut_off) = fit.apply(Histograms::of([recorded.to_vec()]).unwrap());
        assert_eq!(of_run.len(), 1);
        (of_run.histogram(0), cut_off)
    }

    #[test]
    fn bins_are_padded_summed_and_cut() {
        let counts: Vec<u64> = (1..=100).collect();
        let fit = |rebin, requested| BinFit::new(100, 100, rebin, requested).unwrap();
        let padded = fit(1, None);
        assert_eq!((padded.bins(), padded.gate()), (128, Some((0, 99))));
        let (bins, cut_off) = applied(padded, &counts);
        assert_eq!((&bins[..100], cut_off), (&counts[..], 0));
        assert_eq!(bins[100..], [0; 28]);
        // 14 sums of 7, one of 2, one empty bin.
        let summed = fit(7, None);
        assert_eq!((summed.bins(), summed.gate()), (16, Some((0, 13))));
        let (bins, _) = applied(summed, &counts);
        assert_eq!((bins[0], bins[13], bins[14], bins[15]), (28, 665, 199, 0));
        let cut = fit(1, Some(64));
        assert_eq!((cut.bins(), cut.gate()), (64, None));
        assert_eq!(applied(cut, &counts).1, (65..=100).sum::<u64>());
        // As many bins as the recording has, but half of them are empty.
        let halved = BinFit::new(16, 16, 2, Some(16)).unwrap();
        assert_eq!(halved.gate(), Some((0, 7)));
        assert_eq!(applied(halved, &[3; 16]), ([[6; 8], [0; 8]].concat(), 0));
    }

    #[test]
    fn rows_say_what_was_changed() {
        let summed = "neighbours added up";
        let (added, cut_off) = ("empty bins added", "bins cut off");
        for (recorded, rebin, requested, expected) in [
            (128, 1, None, &[][..]),
            (100, 1, None, &[(added, "28")]),
            (
                100,
                1,
                Some(64),
                &[(cut_off, "the last 36, with 12,345 photons")],
            ),
            (64, 2, None, &[(summed, "32 sums of 2")]),
            (64, 2, Some(64), &[(summed, "32 sums of 2"), (added, "32")]),
            (
                100,
                7,
                None,
                &[(summed, "15 sums of 7, the last of 2"), (added, "1")],
            ),
            (
                67,
                2,
                Some(16),
                &[
                    (summed, "34 sums of 2, the last of 1"),
                    (cut_off, "the last 18, with 12,345 photons"),
                ],
            ),
        ] {
            let rows = BinFit::new(recorded, recorded, rebin, requested)
                .unwrap()
                .rows(12_345);
            let rows: Vec<_> = rows
                .iter()
                .map(|(name, value)| (&name[..], &value[..]))
                .collect();
            let of_recording = recorded.to_string();
            let first =
                (!expected.is_empty()).then_some(("bins of the recording", &of_recording[..]));
            let expected: Vec<_> = first.into_iter().chain(expected.iter().copied()).collect();
            assert_eq!(rows, expected);
        }
    }

    #[test]
    fn what_fits_no_run_is_refused() {
        let refused = |recorded, rebin| {
            let error = BinFit::new(recorded, recorded, rebin, None).unwrap_err();
            error.to_string()
        };
        for recorded in [7, 4097] {
            assert_eq!(
                refused(recorded, 1),
                format!("{recorded} bins: must be from 8 to 4096 (axes says which axis they are)")
            );
        }
        for (recorded, rebin, sums, least) in [(1025, 1, 1025, 2), (4096, 3, 1366, 4)] {
            assert_eq!(
                refused(recorded, rebin),
                format!(
                    "{sums} bins are more than 1024: add up neighbours with rebin {least}, or cut off the last with \
                     bins 1024"
                )
            );
        }
        assert_eq!(
            refused(64, 9),
            "rebin 9: makes 7 whole bins of 64: must be at least 8"
        );
        assert!(
            BinFit::new(4096, 4096, 4, None).is_ok() && BinFit::new(4096, 4096, 1, Some(8)).is_ok()
        );
    }

    proptest! {
        #[test]
        fn no_photon_is_lost(
            counts in prop::collection::vec(0u64..1000, 8..300),
            rebin in 1usize..5,
            log2 in 3u32..11,
            is_requested in any::<bool>(),
            unmeasured in 0usize..9,
        ) {
            let requested = is_requested.then_some(1u16 << log2);
            let measured = counts.len() - unmeasured.min(counts.len());
            let Ok(fit) = BinFit::new(counts.len(), measured, rebin, requested) else { return Ok(()) };
            let (bins, cut_off) = applied(fit, &counts);
            prop_assert_eq!(bins.len(), fit.bins());
            prop_assert_eq!(bins.iter().sum::<u64>() + cut_off, counts.iter().sum::<u64>());
            for (bin, count) in bins.iter().enumerate() {
                let of = counts.iter().skip(bin * rebin).take(rebin);
                prop_assert_eq!(*count, of.sum::<u64>());
            }
            // All bins within the gate are sums of the same number of measured bins.
            let last = fit.gate().map_or(bins.len() - 1, |gate| gate.1.into());
            prop_assert!((last + 1) * rebin <= measured);
            prop_assert!(requested.is_some() || cut_off == 0);
        }
    }
}
