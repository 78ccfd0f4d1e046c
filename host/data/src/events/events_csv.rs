//! Events as CSV, one a line.

use std::io::{self, Write};

use dtof_core::DepthEvent;
use dtof_core::events::{DynamicDepthEvent, Polarity};

use crate::events::aer_file::{Event, EventKind};
use crate::photons::ranges::Ranges;

/// The columns of depth events.
///
/// `depth_bins` is measured from the start of bin 0. `flags` is the sum of the flag bits of
/// `docs/aer-format.md`. A `level` above 0 is a block of pixels, the first of which is `pixel`.
/// `echo` counts from 1.
pub const HEADER: &str =
    "cycle,pixel,exposure,peak_bin,depth_bins,range_mm,peak_count,background,flags,level,echo";

/// The columns of dynamic depth events.
///
/// `polarity` is 1 if the depth has grown and -1 if it has shrunk. `range_mm` is the mean after the
/// change, `change_mm` the change.
pub const DYNAMIC_DEPTH_HEADER: &str = "cycle,pixel,polarity,range_mm,change_mm,flags,level";

/// The columns for events of `kind`.
#[must_use]
pub fn header(kind: EventKind) -> &'static str {
    match kind {
        EventKind::Depth => HEADER,
        EventKind::DynamicDepth => DYNAMIC_DEPTH_HEADER,
    }
}

/// Writes one event of either kind.
///
/// # Errors
/// Fails if the writer fails.
pub fn write_event(
    out: &mut (impl Write + ?Sized),
    event: &Event,
    ranges: &Ranges,
) -> io::Result<()> {
    match event {
        Event::Depth(event) => write(out, event, ranges),
        Event::DynamicDepth(event) => write_dynamic_depth(out, event, ranges),
    }
}

/// The range of an event in millimetres, exact: a multiple of 1/256 mm.
#[must_use]
pub fn range_mm(event: &DepthEvent, ranges: &Ranges) -> f64 {
    let range = ranges.of(event.pixel, event.level, event.position());
    range.to_num()
}

/// Writes one event.
///
/// # Errors
/// Fails if the writer fails.
pub fn write(
    out: &mut (impl Write + ?Sized),
    event: &DepthEvent,
    ranges: &Ranges,
) -> io::Result<()> {
    write_at(out, event, range_mm(event, ranges))
}

/// Writes one event at another range.
///
/// # Errors
/// Fails if the writer fails.
pub fn write_at(
    out: &mut (impl Write + ?Sized),
    event: &DepthEvent,
    range_mm: f64,
) -> io::Result<()> {
    let mut row = Row::new();
    row.integer(event.cycle.raw());
    row.integer(event.pixel.raw());
    row.integer(event.exposure);
    row.integer(event.peak_bin.raw());
    row.decimals(f64::from(event.position().raw()) / 256.0, 4);
    row.decimals(range_mm, 3);
    row.integer(event.peak_count.raw());
    row.integer(event.background.raw());
    row.integer(event.flags.bits());
    row.integer(event.level.raw());
    row.integer(event.echo.raw());
    row.write(out)
}

/// Writes one dynamic depth event.
///
/// # Errors
/// Fails if the writer fails.
pub fn write_dynamic_depth(
    out: &mut (impl Write + ?Sized),
    event: &DynamicDepthEvent,
    ranges: &Ranges,
) -> io::Result<()> {
    let position = ranges.of(event.pixel, event.level, event.position);
    let mut row = Row::new();
    row.integer(event.cycle.raw());
    row.integer(event.pixel.raw());
    row.integer(match event.polarity() {
        Polarity::Nearer => -1,
        Polarity::Farther => 1,
    });
    row.decimals(position.to_num(), 3);
    row.decimals(ranges.scale().distance(event.change()).to_num(), 3);
    row.integer(event.flags.bits());
    row.integer(event.level.raw());
    row.write(out)
}

/// A row, cell by cell.
struct Row(Vec<u8>);

impl Row {
    /// Longer than most rows.
    const BYTES: usize = 96;

    fn new() -> Self {
        Self(Vec::with_capacity(Self::BYTES))
    }

    fn integer(&mut self, value: impl itoa::Integer) {
        let mut digits = itoa::Buffer::new();
        self.0.extend_from_slice(digits.format(value).as_bytes());
        self.0.push(b',');
    }

    /// The same as `{value:.digits$}`: rounded to the nearest, and to the even of two. That of a multiple of 1/256, as
    /// positions and ranges are, is the quotient of two integers.
    fn decimals(&mut self, value: f64, digits: u8) {
        const MOST: f64 = (1u64 << 40) as f64;
        let parts = value.abs() * 256.0;
        if parts.fract() != 0.0 || parts >= MOST {
            let digits = usize::from(digits);
            // Writing to memory does not fail.
            let _ = write!(self.0, "{value:.digits$},");
            return;
        }
        let scale = 10u64.pow(digits.into());
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a whole number below 2^40"
        )]
        let parts = parts as u64 * scale;
        let (floor, rest) = (parts / 256, parts % 256);
        let rounded = floor + u64::from(rest > 128 || rest == 128 && floor % 2 == 1);
        if value.is_sign_negative() {
            self.0.push(b'-');
        }
        let mut digits = itoa::Buffer::new();
        self.0
            .extend_from_slice(digits.format(rounded / scale).as_bytes());
        self.0.push(b'.');
        // A 1 before them keeps their zeros.
        let behind = digits.format(scale + rounded % scale).as_bytes();
        self.0.extend_from_slice(&behind[1..]);
        self.0.push(b',');
    }

    /// Ends the row, and writes it at once.
    fn write(mut self, out: &mut (impl Write + ?Sized)) -> io::Result<()> {
        if let Some(end) = self.0.last_mut() {
            *end = b'\n';
        }
        out.write_all(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_core::{
        BinIndex, BlockLevel, Count, EchoNumber, Flags, LaserCycle, PixelAddress, SubBinOffset,
    };
    use proptest::prelude::*;

    fn text(value: f64, digits: u8) -> String {
        let mut row = Row::new();
        row.decimals(value, digits);
        String::from_utf8(row.0).unwrap()
    }

    /// All fractions of 256 with whole numbers of each length, and below 0: those that stand between two numbers, too.
    #[test]
    fn decimals_are_those_of_the_standard_library() {
        let wholes = (0..40).flat_map(|bits| [(1u64 << bits) / 256, 10u64.pow(bits / 4)]);
        for whole in wholes {
            for part in 0..256u16 {
                for sign in [1.0, -1.0] {
                    let value = sign * (whole as f64 + f64::from(part) / 256.0);
                    assert_eq!(text(value, 3), format!("{value:.3},"));
                    assert_eq!(text(value, 4), format!("{value:.4},"));
                }
            }
        }
    }

    proptest! {
        #[test]
        fn any_number_is_written_as_the_standard_library_does(bits: u64, digits in 1u8..8) {
            let value = f64::from_bits(bits);
            let places = usize::from(digits);
            prop_assert_eq!(text(value, digits), format!("{value:.places$},"));
        }

        #[test]
        fn a_row_has_the_cells_of_its_event(
            cycle: u64, pixel: u16, exposure: u16, bin in 0u16..1024, count in 0u32..1 << 16,
            background in 0u32..1 << 16, flags: u8, level in 0u8..4, echo in 1u8..5, offset in -256i16..=256, range in -1e6..1e6f64,
        ) {
            let event = DepthEvent {
                pixel: PixelAddress::new(pixel),
                level: BlockLevel::saturating(level),
                echo: EchoNumber::new(echo).unwrap(),
                cycle: LaserCycle::new(cycle),
                exposure,
                peak_bin: BinIndex::saturating(bin),
                offset: SubBinOffset::new(offset).unwrap(),
                peak_count: Count::saturating(count),
                background: Count::saturating(background),
                flags: Flags::from_bits(flags & 1).unwrap(),
            };
            let mut row = Vec::new();
            write_at(&mut row, &event, range).unwrap();
            let depth_bins = f64::from(event.position().raw()) / 256.0;
            let expected = format!(
                "{},{pixel},{exposure},{},{depth_bins:.4},{range:.3},{},{},{},{},{}\n",
                event.cycle.raw(), event.peak_bin, event.peak_count, event.background, event.flags, event.level,
                event.echo,
            );
            prop_assert_eq!(String::from_utf8(row).unwrap(), expected);
        }
    }
}
