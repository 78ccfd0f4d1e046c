//! Recorded photons one by one, in non-decreasing laser cycle.
//!
//! A file is read twice. The first pass checks every photon and finds the pixels and the end of the
//! recording. The second replays it and holds only one slice at a time. Histograms take a pass of their own.

use anyhow::{Context, Result, bail, ensure};
use dtof_core::{Array, PixelAddress};

use crate::options::Refused;
use crate::options::rows::grouped;
use crate::photons::histograms::Histograms;
use crate::photons::input::Input;
use crate::photons::list_checks::ListWatch;
use crate::photons::recorded::ListTimes;
use crate::photons::source::{Photon, PhotonSource, PixelPhotons, Slice};
use crate::photons::warnings::{greatest_divisor, times_as_cycles};

/// A photon as written in a file: pixel, laser cycle and bin.
pub type RawPhoton = [u64; 3];

/// Reads the photons of a file of any format.
pub trait PhotonReader: Sized {
    /// Opens `input` at its first photon.
    ///
    /// # Errors
    /// Returns what is wrong with the file, after its name.
    fn open(input: &Input) -> Result<Self>;

    /// The next photon.
    ///
    /// # Errors
    /// Returns what is wrong with the photon, without its place.
    fn next(&mut self) -> Result<Option<RawPhoton>>;

    /// The file and the place of the photon that was read last.
    fn place(&self) -> String;
}

/// The photon rate is the highest mean over so many laser cycles.
const SPAN: u64 = 256;

/// A source that can also give histograms.
pub trait CountedSource: PhotonSource {
    /// The photons of all laser cycles to replay, one histogram a pixel of the array. The replay still begins at the first
    /// photon.
    ///
    /// # Errors
    /// Fails if the file has changed since it was checked.
    fn counts(&mut self) -> Result<(Histograms, ListTimes)>;
}

/// The options of a photon list.
#[derive(Clone, Copy, Debug)]
pub struct ListOptions {
    /// Bins of a run.
    pub bins: u16,
    /// How many neighbouring bins of the file are summed.
    pub rebin: u16,
    /// Columns of the array; one row if left out.
    pub columns: Option<u32>,
    /// Whether photons of one pixel, laser cycle and bin count once in histograms.
    pub once_per_bin: bool,
}

/// A photon that has been checked.
#[derive(Clone, Copy, Debug)]
struct ValidPhoton {
    cycle: u64,
    /// Two numbers in one, as wide as a register: written separately or narrower than they are read,
    /// they stall the processor's store forwarding (a third of the time of a replay).
    pixel_and_bin: u64,
}

impl ValidPhoton {
    fn new(pixel: u16, cycle: u64, bin: u16) -> Self {
        Self {
            cycle,
            pixel_and_bin: u64::from(pixel) << 16 | u64::from(bin),
        }
    }

    fn pixel(self) -> usize {
        (self.pixel_and_bin >> 16) as usize
    }

    #[allow(clippy::cast_possible_truncation, reason = "the lower half")]
    fn bin(self) -> u16 {
        self.pixel_and_bin as u16
    }
}

/// So many laser cycles without a photon are a wrong number. A replay would run through all of them.
const GAP: u64 = 1_000_000_000;

/// Checks each photon of a file.
struct Validator<R> {
    rows: R,
    shape: ListOptions,
    /// Photons so far, and the laser cycle of the last.
    photons: u64,
    last_cycle: u64,
    /// A photon so many laser cycles after the last is refused: none before the first, which may come late.
    gap: u64,
    /// The photons of the first pass and the last laser cycle, which a second pass must have, too.
    expected: Option<(u64, u64)>,
}

impl<R: PhotonReader> Validator<R> {
    fn open(input: &Input, shape: ListOptions, expected: Option<(u64, u64)>) -> Result<Self> {
        Ok(Self {
            rows: R::open(input)?,
            shape,
            photons: 0,
            last_cycle: 0,
            gap: u64::MAX,
            expected,
        })
    }

    #[inline(always)]
    fn next(&mut self) -> Result<Option<ValidPhoton>> {
        let row = match self.rows.next() {
            Ok(None) => self.end(),
            Ok(Some([pixel, cycle, recorded])) => {
                let bin = match self.shape.rebin {
                    1 => recorded,
                    rebin => recorded / u64::from(rebin),
                };
                match (u16::try_from(pixel), u16::try_from(bin)) {
                    // A laser cycle before the last wraps around to a wide gap.
                    (Ok(pixel), Ok(bin))
                        if bin < self.shape.bins
                            && cycle < u64::MAX
                            && cycle.wrapping_sub(self.last_cycle) < self.gap =>
                    {
                        self.photons += 1;
                        self.last_cycle = cycle;
                        self.gap = GAP;
                        return Ok(Some(ValidPhoton::new(pixel, cycle, bin)));
                    }
                    _ => self.wrong([pixel, cycle, recorded]),
                }
            }
            Err(error) => Err(error),
        };
        row.with_context(|| self.rows.place())
    }

    /// The file has ended. Another program may have cut it after the first pass.
    #[cold]
    fn end(&self) -> Result<Option<ValidPhoton>> {
        let read = (self.photons, self.last_cycle);
        let (photons, last_cycle) = self.expected.unwrap_or(read);
        ensure!(
            read == (photons, last_cycle),
            "the file changed while it was read: it had {} photons up to cycle {last_cycle}, and now has {} up to cycle {}",
            grouped(photons),
            grouped(read.0),
            read.1
        );
        Ok(None)
    }

    /// Says why a photon is refused.
    #[cold]
    fn wrong(&self, [pixel, cycle, bin]: RawPhoton) -> Result<Option<ValidPhoton>> {
        if u16::try_from(pixel).is_err() {
            bail!(
                "pixel {pixel} is above 65535, the last address: cut the array into tiles, as docs/recordings.md shows"
            );
        }
        if cycle < self.last_cycle {
            bail!(
                "cycle {cycle} comes after cycle {}: photons must be in order of their cycles",
                self.last_cycle
            );
        }
        ensure!(
            cycle < u64::MAX,
            "cycle {cycle} is the highest number of 64 bits: it is damaged, or stands for no cycle"
        );
        let gap = cycle - self.last_cycle;
        ensure!(
            gap < self.gap,
            "cycle {cycle} comes {} laser cycles after the photon before it: must be less than {}; is the number damaged, \
             or a time?",
            grouped(gap),
            grouped(self.gap)
        );
        let ListOptions { bins, rebin, .. } = self.shape;
        let bins = u32::from(bins) * u32::from(rebin);
        bail!(Refused::input(format!(
            "bin {bin} is past the last of {bins} bins (see `bins` and `rebin`)"
        )))
    }
}

/// Refuses numbers that are probably times: a replay would take hours for the empty laser cycles before the first
/// photon. Photons come in the laser cycles from `first` to before `end`; an early end before that has a warning.
fn check_cycles(first: u64, end: u64) -> Result<(), Refused> {
    const MANY: u64 = 1_000_000_000;
    let span = end.saturating_sub(first);
    // Laser cycles that are replayed without a photon.
    let dark = first.min(end);
    if dark < MANY || dark <= span {
        return Ok(());
    }
    let first = grouped(first);
    if span == 0 {
        return Err(Refused::value(
            "cycles",
            end,
            format!("the first photon comes in laser cycle {first}, after all of them"),
        ));
    }
    let span = grouped(span);
    Err(Refused::input(format!(
        "the first photon comes in laser cycle {first}, and all within {span}: count laser cycles from 0; times are no \
         laser cycles"
    )))
}

/// A checked photon list.
pub struct PhotonList<R> {
    input: Input,
    addresses: Vec<PixelAddress>,
    /// The index in `addresses` of each address, up to the last.
    places: Vec<Option<u16>>,
    array: Array,
    cycles: u64,
    /// The laser cycle of the first photon.
    first_cycle: u64,
    /// Different laser cycles with photons, and the greatest number that divides them, counted from the first.
    different: u64,
    divisor: u64,
    photons_per_cycle: f64,
    /// The most photons of the laser cycles of any span.
    most_of_span: u64,
    not_replayed: u64,
    next_cycle: u64,
    rows: Validator<R>,
    /// A photon of a later slice that has been read already.
    ahead: Option<ValidPhoton>,
}

impl<R: PhotonReader> PhotonList<R> {
    /// Checks all of `input`, to replay its first `cycles` laser cycles. The recording ends with
    /// the laser cycle of its last photon.
    ///
    /// # Errors
    /// Returns what is wrong with the file, after its name and the place.
    pub fn open(input: &Input, shape: ListOptions, cycles: u64) -> Result<Self> {
        let mut rows = Validator::<R>::open(input, shape, None)?;
        let mut is_there = vec![false; Array::MOST_PIXELS as usize];
        let (mut not_replayed, mut recorded) = (0, 0u64);
        let (mut first_cycle, mut different, mut divisor) = (0, 0, 0);
        // The span of the last photon, its photons so far, and the most photons of any span.
        let (mut span, mut of_span, mut most) = (0, 0u64, 0);
        while let Some(row) = rows.next()? {
            is_there[row.pixel()] = true;
            if rows.photons == 1 {
                first_cycle = row.cycle;
            }
            different += u64::from(row.cycle >= recorded);
            if divisor != 1 {
                divisor = greatest_divisor(divisor, row.cycle - first_cycle);
            }
            recorded = row.cycle.saturating_add(1);
            if row.cycle >= cycles {
                not_replayed += 1;
            }
            if row.cycle / SPAN != span {
                (span, of_span) = (row.cycle / SPAN, 0);
            }
            of_span += 1;
            most = most.max(of_span);
        }
        ensure!(rows.photons > 0, "{}: no photons", rows.rows.place());
        let expected = Some((rows.photons, rows.last_cycle));
        check_cycles(first_cycle, recorded.min(cycles)).with_context(|| input.to_string())?;
        let all = (0..=u16::MAX).filter(|&pixel| is_there[usize::from(pixel)]);
        let addresses: Vec<PixelAddress> = all.map(PixelAddress::new).collect();
        let mut places = vec![None; is_there.len()];
        for (place, address) in (0..=u16::MAX).zip(&addresses) {
            places[usize::from(address.raw())] = Some(place);
        }
        let pixels_in_file = addresses.last().map_or(0, |last| u32::from(last.raw()) + 1);
        let columns = shape.columns.unwrap_or(pixels_in_file);
        ensure!(
            columns > 0,
            Refused::value("columns", columns, "must be 1 or more")
        );
        let array = Array::new(columns, pixels_in_file.div_ceil(columns));
        let rows = Validator::<R>::open(input, shape, expected)?;
        Ok(Self {
            input: input.clone(),
            array: array.ok_or_else(|| {
                let reason = "makes more than 65,536 pixels";
                Refused::value("columns", columns, reason)
            })?,
            addresses,
            places,
            cycles: cycles.min(recorded),
            first_cycle,
            different,
            divisor,
            photons_per_cycle: most as f64 / SPAN.min(recorded) as f64,
            most_of_span: most,
            not_replayed,
            next_cycle: 0,
            ahead: None,
            rows,
        })
    }
}

impl<R> PhotonList<R> {
    /// The laser cycle of the first photon.
    pub fn first_cycle(&self) -> u64 {
        self.first_cycle
    }

    /// That the laser cycles may be times.
    pub fn times_as_cycles(&self) -> Option<String> {
        let (photons, _) = self.rows.expected?;
        times_as_cycles(photons, self.first_cycle, self.different, self.divisor)
    }

    /// Laser cycles before the next photon, if that has been read already.
    fn dark_cycles(&self) -> u64 {
        let next = self.ahead.map_or(0, |row| row.cycle);
        next.saturating_sub(self.next_cycle)
    }

    /// Pixels up to the last with a photon.
    pub fn pixels(&self) -> usize {
        self.addresses
            .last()
            .map_or(0, |last| usize::from(last.raw()) + 1)
    }
}

impl<R: PhotonReader> CountedSource for PhotonList<R> {
    fn counts(&mut self) -> Result<(Histograms, ListTimes)> {
        let bins = self.rows.shape.bins.into();
        let pixels = self.array.pixels() as usize;
        let mut counts = vec![0; pixels * bins];
        let mut times = ListTimes {
            quarters: vec![[0; 4]; bins],
            ..ListTimes::default()
        };
        let mut watch = ListWatch::new(pixels, bins, self.cycles);
        // The laser cycle of the last photon of each pixel, and of each bin if they count once.
        let mut last = vec![u64::MAX; pixels];
        let once = usize::from(self.rows.shape.once_per_bin);
        let mut last_of_bins = vec![u64::MAX; once * counts.len()];
        let quarter = self.cycles.div_ceil(4);
        while let Some(row) = self.rows.next()? {
            if row.cycle >= self.cycles {
                break;
            }
            let bin = usize::from(row.bin());
            let place = row.pixel() * bins + bin;
            let Some(count) = counts.get_mut(place) else {
                bail!("{} changed while it was read", self.input);
            };
            if let Some(last) = last_of_bins.get_mut(place)
                && std::mem::replace(last, row.cycle) == row.cycle
            {
                continue;
            }
            *count += 1;
            #[allow(clippy::cast_possible_truncation, reason = "0 to 3")]
            let quarter = (row.cycle / quarter) as usize;
            times.quarters[bin][quarter] += 1;
            let last = std::mem::replace(&mut last[row.pixel()], row.cycle);
            times.again += u64::from(last == row.cycle);
            watch.photon(row.pixel(), row.cycle, bin);
        }
        self.rows = Validator::open(&self.input, self.rows.shape, self.rows.expected)?;
        if self.times_as_cycles().is_none() {
            times.checks = watch.checks();
        }
        let mut histograms = Histograms::new(bins);
        histograms.extend(&counts);
        Ok((histograms, times))
    }
}

impl<R: PhotonReader> PhotonSource for PhotonList<R> {
    fn array(&self) -> Array {
        self.array
    }

    fn addresses(&self) -> Vec<PixelAddress> {
        self.addresses.clone()
    }

    fn cycles(&self) -> u64 {
        self.cycles
    }

    fn photons_per_cycle(&self) -> f64 {
        self.photons_per_cycle
    }

    fn sparse_cycles(&self, photons: u64) -> u64 {
        // So many spans in a row reach into one more, and each has at most the photons of the brightest.
        let spans = (photons / self.most_of_span).saturating_sub(1);
        self.dark_cycles() + spans.saturating_mul(SPAN)
    }

    fn not_replayed(&self) -> u64 {
        self.not_replayed
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a number of photons; less than `cycles`"
    )]
    fn next_slice(&mut self, cycles: u16) -> Result<Slice> {
        let first_cycle = self.next_cycle;
        let lit = u64::from(cycles).saturating_sub(self.dark_cycles());
        self.next_cycle += u64::from(cycles);
        let all = self.photons_per_cycle * lit as f64;
        // A quarter more than the mean in the brightest span.
        let expected = (1.25 * all / self.addresses.len() as f64) as usize + 4;
        let pixels = self.addresses.iter().map(|_| PixelPhotons {
            cycles,
            photons: Vec::with_capacity(expected),
        });
        let mut pixels: Vec<PixelPhotons> = pixels.collect();
        loop {
            let row = match self.ahead.take() {
                Some(row) => row,
                None => match self.rows.next()? {
                    Some(row) => row,
                    None => break,
                },
            };
            // Also fails if the file has changed since it was checked.
            let cycle = row.cycle.checked_sub(first_cycle);
            let (Some(cycle), Some(place)) = (cycle, self.places[row.pixel()]) else {
                bail!("{} changed while it was read", self.input);
            };
            if cycle >= u64::from(cycles) {
                self.ahead = Some(row);
                break;
            }
            pixels[usize::from(place)].photons.push(Photon {
                cycle: cycle as u16,
                code: row.bin(),
            });
        }
        Ok(Slice {
            first_cycle,
            pixels,
        })
    }
}

#[cfg(test)]
mod tests;
