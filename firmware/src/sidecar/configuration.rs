//! Taking a configuration on.

use dtof_core::{PixelAddress, PixelConfig, RangeGate, RangeScale};
use dtof_link::{Configuration, Refusal, Source};

use super::{Pixel, Sidecar};

impl Sidecar<'_> {
    /// Takes the configuration in `body` on, all pixels at the beginning of an exposure.
    /// The one before stays if the device cannot do what is wanted.
    pub(super) fn configure(&mut self, body: &[u8]) -> Result<(), Refusal> {
        let wanted = Configuration::from_le_bytes(body)?;
        if wanted.source == Source::Sensor {
            let sensor = self.sensor.ok_or(Refusal::NoSensor)?;
            if !sensor.has_bins_of(wanted.bin_width_ps) {
                return Err(Refusal::BinWidth);
            }
        }
        if wanted.pixels == 0 || usize::from(wanted.pixels) > self.pixels.capacity() {
            return Err(Refusal::Pixels);
        }
        let (first, last) = wanted.gate;
        let config = PixelConfig::with_rule(wanted.rule)
            .x(wanted.x)
            .l1(wanted.l1)
            .l2(wanted.l2)
            .gate(RangeGate::new(first, last)?)
            .estimator(wanted.estimator)
            .one_hit_tdc(wanted.one_hit_tdc)
            .build()?;
        let scale = RangeScale::new(wanted.bin_width_ps, wanted.offset_mm)?;
        let dynamic_depth = wanted.dynamic_depth.map(|changes| changes.config(&scale));
        let dynamic_depth = dynamic_depth.transpose()?;
        self.pixels.clear();
        for address in 0..wanted.pixels {
            // There is room: checked above.
            let _ = self.pixels.push(Pixel::new(PixelAddress(address)));
        }
        self.config = Some(config);
        self.dynamic_depth = dynamic_depth;
        self.bin_width = wanted.bin_width_ps;
        self.source = wanted.source;
        self.started = false;
        self.restart_counts();
        Ok(())
    }
}
