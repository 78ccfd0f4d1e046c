//! Depth events as records of an array, and back.

use anyhow::{Context, Error, Result, ensure};
use dtof_core::fixed::traits::Fixed;
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{
    BinIndex, BlockLevel, Count, DepthEvent, EchoNumber, Flags, LaserCycle, PixelAddress,
    SubBinOffset,
};
use dtof_data::events::aer_file::{Event, Header};
use dtof_data::events::events_csv::range_mm;
use dtof_data::options::numbers::bins_of;
use dtof_data::photons::ranges::{Ranges, RangesError};
use pyo3::prelude::*;

/// Bytes of a record of `dtof.EVENT`: little-endian, with padding.
pub const RECORD: usize = 48;

/// Appends the record of `event`.
pub fn push(records: &mut Vec<u8>, event: &DepthEvent, ranges: &Ranges) {
    let mut record = [0; RECORD];
    let mut put = |at: usize, bytes: &[u8]| record[at..at + bytes.len()].copy_from_slice(bytes);
    // 18 bits, a multiple of 1/256: exact as f32.
    #[allow(clippy::cast_precision_loss, reason = "18 bits")]
    let depth_bins = event.position().raw() as f32 / 256.0;
    put(0, &event.cycle.raw().to_le_bytes());
    put(8, &event.pixel.raw().to_le_bytes());
    put(10, &event.exposure.to_le_bytes());
    put(12, &event.peak_bin.raw().to_le_bytes());
    put(16, &depth_bins.to_le_bytes());
    put(24, &range_mm(event, ranges).to_le_bytes());
    put(32, &event.peak_count.raw().to_le_bytes());
    put(36, &event.background.raw().to_le_bytes());
    put(
        40,
        &[event.flags.bits(), event.level.raw(), event.echo.raw()],
    );
    records.extend(record);
}

/// The array of events, as Python has it.
#[derive(FromPyObject, IntoPyObject, Clone, Debug)]
pub struct Array {
    pub bins: u32,
    pub rows: u32,
    pub columns: u32,
    pub bin_width_ps: f64,
    pub offset_mm: f64,
    pub laser_millihertz: u64,
    pub start_us: i64,
    /// Of each pixel, `None` if it is left out; none if they are 0.
    pub offsets_mm: Option<Vec<Option<f64>>>,
}

impl Array {
    pub fn of(header: &Header) -> Self {
        Self {
            bins: header.bins,
            rows: header.array.rows(),
            columns: header.array.columns(),
            bin_width_ps: header.bin_width_ps.to_num(),
            offset_mm: header.offset_mm.to_num(),
            laser_millihertz: header.laser_millihertz,
            start_us: header.start_us,
            offsets_mm: (!header.offsets_mm.is_empty()).then(|| {
                let offsets = header.offsets_mm.iter();
                let offsets = offsets.map(|offset| offset.map(|offset| offset.to_num()));
                offsets.collect()
            }),
        }
    }

    /// The header of an AER file.
    ///
    /// # Errors
    /// Fails if the size or a number is out of range.
    pub fn header(&self) -> Result<Header> {
        let (columns, rows) = (self.columns, self.rows);
        let array = dtof_core::Array::new(columns, rows).with_context(|| {
            format!("{columns} columns and {rows} rows: must be 1 to 65,536 pixels")
        })?;
        let (width, offset) = (self.bin_width_ps, self.offset_mm);
        let bins = u16::try_from(self.bins).unwrap_or(u16::MAX);
        let valid = bins_of(bins).map_err(Error::msg);
        valid.with_context(|| format!("bins {}", self.bins))?;
        let header = Header {
            bins: self.bins,
            array,
            bin_width_ps: exact::<U16F16>(width)
                .with_context(|| format!("bin_width_ps {width}: must be a multiple of 1/65536"))?,
            offset_mm: exact::<I24F8>(offset)
                .with_context(|| format!("offset_mm {offset}: must be a multiple of 1/256"))?,
            laser_millihertz: self.laser_millihertz,
            start_us: self.start_us,
            offsets_mm: self.pixel_offsets()?,
        };
        header.ranges().with_context(|| match header.ranges() {
            Err(RangesError::Scale(_)) => format!("bin_width_ps {width}, offset_mm {offset}"),
            _ => "offsets_mm".to_owned(),
        })?;
        Ok(header)
    }

    fn pixel_offsets(&self) -> Result<Vec<Option<I24F8>>> {
        let offsets = self.offsets_mm.iter().flatten().map(|&offset| {
            let Some(offset) = offset else {
                return Ok(None);
            };
            let exact = exact::<I24F8>(offset);
            let reason = || format!("offsets_mm {offset}: must be a multiple of 1/256");
            exact.map(Some).with_context(reason)
        });
        offsets.collect()
    }
}

/// `number` in fixed point, if that is exact.
fn exact<T: Fixed>(number: f64) -> Option<T> {
    let finite = Some(number).filter(|number| number.is_finite())?;
    T::checked_from_num(finite).filter(|fixed| *fixed == finite)
}

/// The events of `records`, from an array with this header.
///
/// # Errors
/// Returns the index of an invalid event, and the reason.
pub fn events(records: &[u8], header: &Header) -> Result<Vec<Event>> {
    let (records, rest) = records.as_chunks::<RECORD>();
    ensure!(rest.is_empty(), "not whole records of events");
    let all = records.iter().enumerate().map(|(index, record)| {
        let event = event(record).and_then(|event| {
            let event = Event::Depth(event);
            header.check(&event).map(|()| event)
        });
        event.with_context(|| format!("event {index}"))
    });
    all.collect()
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "a number of bins that is checked"
)]
fn event(record: &[u8; RECORD]) -> Result<DepthEvent> {
    let two = |at: usize| u16::from_le_bytes([record[at], record[at + 1]]);
    let four = |at: usize| {
        let [a, b, c, d] = [0, 1, 2, 3].map(|next| record[at + next]);
        [a, b, c, d]
    };
    let count = |name: &str, at: usize| {
        let raw = u32::from_le_bytes(four(at));
        Count::new(raw).with_context(|| format!("{name} {raw}: must be at most {}", Count::MAX))
    };
    let peak_bin = two(12);
    let depth_bins = f32::from_le_bytes(four(16));
    let steps = (depth_bins - f32::from(peak_bin)) * 256.0;
    let offset = (steps.fract() == 0.0 && steps.abs() < 1024.0)
        .then(|| SubBinOffset::new(steps as i16))
        .flatten();
    let [flags, level, echo] = [record[40], record[41], record[42]];
    let cycle =
        u64::from(u32::from_le_bytes(four(0))) | u64::from(u32::from_le_bytes(four(4))) << 32;
    ensure!(
        i64::try_from(cycle).is_ok(),
        "cycle {}: must be at least 0",
        cycle.cast_signed()
    );
    Ok(DepthEvent {
        pixel: PixelAddress::new(two(8)),
        level: BlockLevel::new(level)
            .with_context(|| format!("level {level}: must be 0 to {}", BlockLevel::MAX))?,
        echo: EchoNumber::new(echo).with_context(|| format!("echo {echo}: must be 1 to 4"))?,
        cycle: LaserCycle::new(cycle),
        exposure: two(10),
        peak_bin: BinIndex::new(peak_bin)
            .with_context(|| format!("peak_bin {peak_bin}: must be 0 to {}", BinIndex::MAX))?,
        offset: offset.with_context(|| {
            format!(
                "depth_bins {depth_bins}: must be a multiple of 1/256, and at most two bins from \
                 peak_bin {peak_bin}"
            )
        })?,
        peak_count: count("peak_count", 32)?,
        background: count("background", 36)?,
        flags: Flags::from_bits(flags).with_context(|| format!("flags {flags}: not known"))?,
    })
}
