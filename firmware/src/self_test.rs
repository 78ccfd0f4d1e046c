//! Results of `dtof-core` as text: the same lines on every board as on the
//! host, byte for byte.
//!
//! `firmware/self-test.out` holds them as the host writes them. A test compares;
//! `cargo xtask self-test` runs the image `self-test` in the emulator and
//! compares what that writes, and with `--bless` writes the file.

use core::fmt::{self, Write};

use dtof_core::binning::Block;
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::paper::isqrt;
use dtof_core::{
    AerDecoder, AerEncoder, AerRecord, AerWord, Array, ArrayConfig, AsyncPixel, BlockLevel, Count,
    DepthEvent, EchoNumber, LaserCycle, PaperRule, PixelAddress, PixelArray, PixelConfig,
    PixelConfigBuilder, PixelPlace, RangeGate, Statistics, WindowRule, checked,
};

/// The last line of a run that came to its end.
pub const LAST_LINE: &str = "end";

/// Writes every line.
///
/// # Errors
/// The errors of `out`.
pub fn run(out: &mut impl Write) -> fmt::Result {
    roots(out)?;
    let mut encoder = AerEncoder::new();
    stream::<8>(out, &mut encoder, 3)?;
    stream::<128>(out, &mut encoder, 60)?;
    let echoes = windows(&WINDOW).l2(100).echoes(EchoNumber::LAST, 4);
    watched(out, &mut encoder, "echoes", echoes, [2, 4])?;
    let tracking = WINDOW.tracking(&RangeGate::<128>::full());
    let tracking = windows(&WINDOW).l2(200).tracking(Some(tracking));
    watched(out, &mut encoder, "tracking", tracking, [0, 16])?;
    block(out, &mut encoder)?;
    writeln!(out, "{LAST_LINE}")
}

/// Every root of 10 bits, and of wider numbers those beside the squares.
fn roots(out: &mut impl Write) -> fmt::Result {
    let mut checksum = Checksum::new();
    for value in 0..=1023 {
        checksum.add(isqrt::<5>(value));
    }
    writeln!(out, "isqrt 10 bits 0..=1023: {:08x}", checksum.0)?;

    let mut checksum = Checksum::new();
    for root in 1..=255 {
        for value in [root * root - 1, root * root, root * root + 1] {
            checksum.add(isqrt::<8>(value));
            checksum.add(isqrt::<12>(value << 8));
        }
    }
    writeln!(out, "isqrt 16 and 24 bits: {:08x}", checksum.0)
}

/// One macropixel that sees a target at `target`, between and across two bins,
/// with as much background.
fn stream<const BINS: usize>(
    out: &mut impl Write,
    encoder: &mut AerEncoder,
    target: u16,
) -> fmt::Result {
    writeln!(out, "stream of {BINS} bins")?;
    let rule = PaperRule::new(U8F8::lit("4"), Count::saturating(5));
    let config = match PixelConfig::<BINS>::with_rule(rule).x(10).build() {
        Ok(config) => config,
        Err(error) => return writeln!(out, "{error}"),
    };
    let mut pixel = AsyncPixel::<BINS>::new(PixelAddress::new(u16::from(BINS > 8)));
    let mut statistics = Statistics::default();
    let mut random = Random(1);
    // Just before the upper bits of the laser cycle change.
    let first = (1 << 16) - 400;
    for cycle in first..first + 800 {
        if random.below(2) == 0 {
            pixel.count(&config, target + u16::from(random.below(4) == 0));
        }
        // One code in nine lies past the last of 8 bins.
        let bins = if BINS == 8 { 9 } else { BINS };
        if random.below(2) == 0 {
            pixel.count(&config, random.below(bins));
        }
        pixel.end_laser_cycle(&config, &mut statistics, LaserCycle::new(cycle));
        // Now and then the link has no room.
        if cycle % 256 < 160
            && let Some(event) = pixel.take_event()
        {
            write_event(out, encoder, &event)?;
        }
    }
    pixel.add_photons_to(&mut statistics);
    writeln!(out, "{statistics:?}")
}

const WINDOW: WindowRule = checked!(WindowRule::new(3, U4F12::lit("4.5"), Count::saturating(5)));

/// Pixels with a rule of windows.
fn windows(rule: &WindowRule) -> PixelConfigBuilder<128, WindowRule> {
    PixelConfig::with_rule(*rule)
}

/// A macropixel that sees a surface at bin 30 and one at bin 60, with a photon in one of so
/// many laser cycles, or none.
fn watched(
    out: &mut impl Write,
    encoder: &mut AerEncoder,
    name: &str,
    config: PixelConfigBuilder<128, WindowRule>,
    one_in: [usize; 2],
) -> fmt::Result {
    writeln!(out, "stream with {name}")?;
    let config = match config.build() {
        Ok(config) => config,
        Err(error) => return writeln!(out, "{error}"),
    };
    let mut pixel = AsyncPixel::<128>::new(PixelAddress::new(2));
    let mut statistics = Statistics::default();
    let mut random = Random(1);
    for cycle in 0..400 {
        for (target, one_in) in [30, 60].into_iter().zip(one_in) {
            if one_in > 0 && random.below(one_in) == 0 {
                pixel.count(&config, target + u16::from(random.below(4) == 0));
            }
        }
        if random.below(2) == 0 {
            pixel.count(&config, random.below(128));
        }
        pixel.end_laser_cycle(&config, &mut statistics, LaserCycle::new(cycle));
        if let Some(event) = pixel.take_event() {
            write_event(out, encoder, &event)?;
        }
    }
    pixel.add_photons_to(&mut statistics);
    writeln!(out, "{statistics:?}")
}

/// Two macropixels too dim for themselves, and the block that they are in.
fn block(out: &mut impl Write, encoder: &mut AerEncoder) -> fmt::Result {
    writeln!(out, "stream of a block")?;
    let levels = BlockLevel::saturating(1);
    let (Ok(config), Ok(of_blocks), Some(layout)) = (
        windows(&WINDOW).l2(100).build(),
        windows(&WINDOW.of_blocks(levels)).l2(100).build(),
        Array::new(2, 1),
    ) else {
        return writeln!(out, "no such block");
    };
    let mut places: [PixelPlace<128>; 2] = [PixelPlace::new(), PixelPlace::new()];
    let mut blocks: [Block<128>; 1] = [Block::default()];
    let mut array = PixelArray::new(&mut places, &mut blocks);
    let config = ArrayConfig::new(layout, config).blocks(levels, of_blocks, 40);
    if let Err(error) = config.and_then(|config| array.configure(&config)) {
        return writeln!(out, "{error}");
    }
    let mut random = Random(1);
    for _ in 0..400 {
        for pixel in 0..2 {
            for (one_in, code) in [(24, 60), (8, random.below(128))] {
                if random.below(one_in) == 0 {
                    array.photon(pixel, code);
                }
            }
        }
        array.end_laser_cycle();
        while let Some(event) = array.next_event() {
            write_event(out, encoder, &event)?;
        }
    }
    let [pixels, blocks] = array.statistics();
    writeln!(out, "{pixels:?}")?;
    writeln!(out, "{blocks:?}")
}

/// An event, its words, and whether they come back as the event.
fn write_event(out: &mut impl Write, encoder: &mut AerEncoder, event: &DepthEvent) -> fmt::Result {
    writeln!(
        out,
        "level {} echo {} cycle {} exposure {} bin {} offset {} count {} background {} flags {}",
        event.level.raw(),
        event.echo,
        event.cycle.raw(),
        event.exposure,
        event.peak_bin.raw(),
        event.offset.raw(),
        event.peak_count.raw(),
        event.background.raw(),
        event.flags.bits(),
    )?;
    let (time, word) = encoder.encode(event);
    // A time word just for the decoder, which sees no others.
    let mut decoder = AerDecoder::new();
    let _ = decoder.decode(AerWord::time(event.cycle));
    if decoder.decode(word) != Ok(AerRecord::Event(*event)) {
        writeln!(out, "the next word does not come back as this event")?;
    }
    for word in time.into_iter().chain([word]) {
        write!(out, "word ")?;
        for byte in word.to_le_bytes() {
            write!(out, "{byte:02x}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// FNV-1a of 32 bits over the four bytes of each value, the lowest first.
struct Checksum(u32);

impl Checksum {
    const fn new() -> Self {
        Self(0x811c_9dc5)
    }

    fn add(&mut self, value: u32) {
        for byte in value.to_le_bytes() {
            self.0 = (self.0 ^ u32::from(byte)).wrapping_mul(0x0100_0193);
        }
    }
}

/// A generator good enough here: multiplier and increment are those of
/// Numerical Recipes.
struct Random(u32);

impl Random {
    /// The next number below `limit`, at most 2¹⁶.
    #[allow(clippy::cast_possible_truncation, reason = "below 2¹⁶ twice over")]
    fn below(&mut self, limit: usize) -> u16 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (((self.0 >> 16) * limit as u32) >> 16) as u16
    }
}

#[cfg(test)]
mod tests {
    use std::string::String;

    use super::*;

    #[test]
    fn the_host_writes_the_expected_lines() {
        let mut text = String::new();
        run(&mut text).unwrap();
        assert_eq!(
            text,
            include_str!("../self-test.out"),
            "if that is meant: cargo xtask self-test --bless"
        );
    }

    #[test]
    fn the_lines_show_what_they_should() {
        let text = include_str!("../self-test.out");
        for part in [
            "offset ",
            "rejected: ",
            "flags 4",
            "deferred: ",
            "level 0 echo 2 ",
            "level 1 echo 1 ",
        ] {
            assert!(text.contains(part), "{part}");
        }
        assert!(!text.contains("does not come back"));
        assert!(text.matches("word ").count() > 2 * text.matches("stream ").count());
        assert!(text.ends_with("end\n"));
    }
}
