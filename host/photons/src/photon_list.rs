//! Recorded photons one by one, in non-decreasing laser cycle.
//!
//! A file is read twice: once to check every photon before anything is written, and to learn
//! which pixels there are and when the recording ends; once to replay it, without ever
//! holding more than a slice.

use anyhow::{Context, Result, bail, ensure};
use dtof_core::{Array, PixelAddress};

use crate::medium::Medium;
use crate::source::{Photon, PhotonSource, PixelPhotons, Slice};
use dtof_options::Refused;

/// A photon as a file has it: the numbers of its pixel, laser cycle and bin.
pub type Row = [u64; 3];

/// The photons of a file, whatever its format.
pub trait Rows: Sized {
    /// Opens `medium` at its first photon.
    ///
    /// # Errors
    /// What is wrong with the file; its name first.
    fn open(medium: &Medium) -> Result<Self>;

    /// The next photon.
    ///
    /// # Errors
    /// What is wrong with it, without the place.
    fn next(&mut self) -> Result<Option<Row>>;

    /// Where the photon stands that was read last, the file's name first.
    fn place(&self) -> String;
}

/// Laser cycles over which the brightest part of a recording is averaged.
const SPAN: u64 = 256;

/// A source of listed photons.
pub trait Listed: PhotonSource {
    /// The photons of all laser cycles to replay: a histogram for each pixel of the array.
    ///
    /// # Errors
    /// If the file has changed since it was checked.
    fn counts(&mut self) -> Result<Vec<Vec<u64>>>;
}

/// What a user says of a photon list.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Bins of a run.
    pub bins: u16,
    /// Neighbouring bins of the file that make one of these.
    pub rebin: u16,
    /// Columns of the array; without, it is one row.
    pub columns: Option<u32>,
}

/// A photon that can be.
#[derive(Clone, Copy, Debug)]
struct Checked {
    cycle: u64,
    /// Two numbers in one: a processor waits where it reads at once what it wrote in parts.
    pixel_and_bin: u32,
}

impl Checked {
    fn new(pixel: u16, cycle: u64, bin: u16) -> Self {
        Self {
            cycle,
            pixel_and_bin: u32::from(pixel) << 16 | u32::from(bin),
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

/// The photons of a file, each checked.
struct Checks<R> {
    rows: R,
    shape: Shape,
    last_cycle: u64,
}

impl<R: Rows> Checks<R> {
    fn open(medium: &Medium, shape: Shape) -> Result<Self> {
        Ok(Self {
            rows: R::open(medium)?,
            shape,
            last_cycle: 0,
        })
    }

    #[inline(always)]
    fn next(&mut self) -> Result<Option<Checked>> {
        let row = match self.rows.next() {
            Ok(None) => return Ok(None),
            Ok(Some([pixel, cycle, recorded])) => {
                let bin = match self.shape.rebin {
                    1 => recorded,
                    rebin => recorded / u64::from(rebin),
                };
                match (u16::try_from(pixel), u16::try_from(bin)) {
                    (Ok(pixel), Ok(bin)) if bin < self.shape.bins && cycle >= self.last_cycle => {
                        self.last_cycle = cycle;
                        return Ok(Some(Checked::new(pixel, cycle, bin)));
                    }
                    _ => self.wrong([pixel, cycle, recorded]),
                }
            }
            Err(error) => Err(error),
        };
        row.with_context(|| self.rows.place())
    }

    /// Why a photon is refused.
    #[cold]
    fn wrong(&self, [pixel, cycle, bin]: Row) -> Result<Option<Checked>> {
        if u16::try_from(pixel).is_err() {
            bail!("pixel {pixel} is above 65535, the last address");
        }
        if cycle < self.last_cycle {
            bail!("cycle {cycle} comes after cycle {}", self.last_cycle);
        }
        let Shape { bins, rebin, .. } = self.shape;
        let bins = u32::from(bins) * u32::from(rebin);
        bail!(Refused::input(format!(
            "bin {bin} is past the last of {bins} bins (see `bins` and `rebin`)"
        )))
    }
}

/// A checked photon list.
pub struct PhotonList<R> {
    medium: Medium,
    addresses: Vec<PixelAddress>,
    /// Of each address up to the last, its place in `addresses`.
    places: Vec<Option<u16>>,
    array: Array,
    cycles: u64,
    photons_per_cycle: f64,
    not_replayed: u64,
    next_cycle: u64,
    rows: Checks<R>,
    /// Read, but of a later slice.
    ahead: Option<Checked>,
}

impl<R: Rows> PhotonList<R> {
    /// Checks all of `medium`, to replay its first `cycles` laser cycles. The recording lasts
    /// until the laser cycle of its last photon.
    ///
    /// # Errors
    /// What is wrong with the file; its name and the place first.
    pub fn open(medium: &Medium, shape: Shape, cycles: u64) -> Result<Self> {
        let can_be = medium.can_be_read_twice();
        ensure!(
            can_be.with_context(|| medium.to_string())?,
            "{medium}: not a file that can be read twice"
        );
        let mut rows = Checks::<R>::open(medium, shape)?;
        let mut is_there = vec![false; 1 << 16];
        let (mut photons, mut not_replayed, mut recorded) = (0u64, 0, 0u64);
        // Of the span in which the last photon was, and the most of one.
        let (mut span, mut of_span, mut most) = (0, 0u64, 0);
        while let Some(row) = rows.next()? {
            is_there[row.pixel()] = true;
            photons += 1;
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
        ensure!(photons > 0, "{}: no photons", rows.rows.place());
        let all = (0..=u16::MAX).filter(|&pixel| is_there[usize::from(pixel)]);
        let addresses: Vec<PixelAddress> = all.map(PixelAddress).collect();
        let mut places = vec![None; 1 << 16];
        for (place, address) in (0..=u16::MAX).zip(&addresses) {
            places[usize::from(address.0)] = Some(place);
        }
        let pixels_in_file = addresses.last().map_or(0, |last| u32::from(last.0) + 1);
        let columns = shape.columns.unwrap_or(pixels_in_file);
        ensure!(
            columns > 0,
            Refused::value("columns", columns, "must be 1 or more")
        );
        let array = Array::new(columns, pixels_in_file.div_ceil(columns));
        let rows = Checks::<R>::open(medium, shape)?;
        Ok(Self {
            medium: medium.clone(),
            array: array.ok_or_else(|| {
                let reason = "makes more than 65,536 pixels";
                Refused::value("columns", columns, reason)
            })?,
            addresses,
            places,
            cycles: cycles.min(recorded),
            photons_per_cycle: most as f64 / SPAN.min(recorded) as f64,
            not_replayed,
            next_cycle: 0,
            ahead: None,
            rows,
        })
    }
}

impl<R: Rows> Listed for PhotonList<R> {
    fn counts(&mut self) -> Result<Vec<Vec<u64>>> {
        let bins = self.rows.shape.bins.into();
        let mut counts = vec![vec![0; bins]; self.array.pixels() as usize];
        while let Some(row) = self.rows.next()? {
            if row.cycle >= self.cycles {
                break;
            }
            let histogram = counts.get_mut(row.pixel());
            let Some(count) = histogram.and_then(|bins| bins.get_mut(usize::from(row.bin())))
            else {
                bail!("{} changed while it was read", self.medium);
            };
            *count += 1;
        }
        Ok(counts)
    }
}

impl<R: Rows> PhotonSource for PhotonList<R> {
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
        self.next_cycle += u64::from(cycles);
        let all = self.photons_per_cycle * f64::from(cycles);
        // Somewhat more than there are on average where it is brightest.
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
            // Also where the file has changed since it was checked.
            let cycle = row.cycle.checked_sub(first_cycle);
            let (Some(cycle), Some(place)) = (cycle, self.places[row.pixel()]) else {
                bail!("{} changed while it was read", self.medium);
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
