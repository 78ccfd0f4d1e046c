//! Applies a configuration.

use dtof_core::RangeScale;
use dtof_link::{Configuration, Refusal, Source, StopReason};
use dtof_sensors::dither::Dither;

use super::{Counters, Sidecar};

impl Sidecar<'_> {
    /// Applies the configuration in `body`: all pixels begin an exposure. The last configuration
    /// stays in force if the device does not support the new one.
    pub(super) fn configure(&mut self, body: &[u8]) -> Result<(), Refusal> {
        let requested = Configuration::from_le_bytes(body)?;
        if requested.host_timeout_ms == 0 && !cfg!(feature = "laser-on-without-host") {
            return Err(Refusal::HostTimeout);
        }
        if !requested.rule.fits::<Counters>() {
            return Err(Refusal::MinimumCount);
        }
        let (first, mut last) = requested.gate;
        let mut most_dither = 0;
        if requested.source == Source::Sensor {
            let sensor = self.sensor.ok_or(Refusal::NoSensor)?;
            if !sensor.has_bins_of(requested.bin_width_ps) {
                return Err(Refusal::BinWidth);
            }
            if requested.once_per_bin && sensor.gives_histograms {
                return Err(Refusal::OncePerBin);
            }
            most_dither = sensor.most_dither;
            // Bins that are not measured would count as bins without background.
            last = last.min(sensor.bins.saturating_sub(1));
        }
        if requested.pixels == 0 || usize::from(requested.pixels) > self.array.room() {
            return Err(Refusal::Pixels);
        }
        let dither = Dither::new(requested.dither_bins, requested.dither_seed);
        let dither = dither.map_err(|_| Refusal::Dither)?;
        if dither.range() > u16::from(most_dither) {
            return Err(Refusal::Dither);
        }
        let gives_histograms = self.sensor.is_some_and(|sensor| sensor.gives_histograms);
        let of_histograms = gives_histograms && requested.source == Source::Sensor;
        if requested.neighbours.is_some() && of_histograms {
            return Err(Refusal::Neighbours);
        }
        let measured = Configuration {
            gate: (first, last),
            ..requested
        };
        let dead_time_of_sensor = self.sensor.map_or(0, |sensor| sensor.dead_time);
        let config = measured.device_config(dead_time_of_sensor)?;
        self.array.check(&config)?;
        let scale = RangeScale::new(requested.bin_width_ps, requested.offset_mm)?;
        let dynamic_depth = requested
            .dynamic_depth
            .map(|changes| changes.config(&scale));
        let dynamic_depth = dynamic_depth.transpose()?;
        self.array.configure(&config)?;
        self.dynamic_depth = dynamic_depth;
        self.bin_width = requested.bin_width_ps;
        self.dither = dither;
        self.source = requested.source;
        self.host_timeout_ms = requested.host_timeout_ms;
        self.stopping.get_or_insert(StopReason::Configuration);
        self.started = false;
        self.off = None;
        Ok(())
    }
}
