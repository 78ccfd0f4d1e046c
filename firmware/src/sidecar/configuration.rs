//! Taking a configuration on.

use dtof_core::fixed::types::{I24F8, U8F8, U16F16};
use dtof_core::{AsyncPixel, Count, PaperRule, PixelAddress, PixelConfig, RangeGate, RangeScale};

use super::Sidecar;
use crate::link::message::{Configuration, Refusal, Source};

impl Sidecar<'_> {
    /// Validates a configuration and takes it on, all pixels at the beginning of
    /// an exposure. The one before stays if it is refused.
    pub(super) fn configure(&mut self, wanted: &Configuration) -> Result<(), Refusal> {
        let bin_width = U16F16::from_bits(wanted.bin_width);
        let source = match (wanted.source, wanted.rule, self.sensor) {
            (0, 0, _) => Source::Link,
            (1, 0, Some(sensor)) if sensor.has_bins_of(bin_width) => Source::Sensor,
            (1, 0, Some(_)) => return Err(Refusal::BinWidth),
            (1, 0, None) => return Err(Refusal::NoSensor),
            _ => return Err(Refusal::Unknown),
        };
        let minimum = Count::saturating(wanted.minimum_count.into());
        if !(1..=1023).contains(&wanted.minimum_count) {
            return Err(Refusal::MinimumCount);
        }
        if wanted.pixels == 0 || usize::from(wanted.pixels) > self.pixels.capacity() {
            return Err(Refusal::Pixels);
        }
        let gate = RangeGate::new(wanted.gate_first, wanted.gate_last)?;
        let rule = PaperRule::new(U8F8::from_bits(wanted.alpha), minimum);
        let config = PixelConfig::new(wanted.x, wanted.l1, wanted.l2, gate, rule)?;
        RangeScale::new(bin_width, I24F8::from_bits(wanted.offset))?;
        self.pixels.clear();
        for address in 0..wanted.pixels {
            // There is room: checked above.
            let _ = self.pixels.push(AsyncPixel::new(PixelAddress(address)));
        }
        self.config = Some(config);
        self.bin_width = bin_width;
        self.source = source;
        self.started = false;
        self.restart_counts();
        Ok(())
    }
}
