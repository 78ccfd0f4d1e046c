//! Applies a configuration.

use dtof_core::neighbours::NeighbourConfig;
use dtof_core::{AnyRule, Array, ArrayConfig, PixelConfig, RangeGate, RangeScale};
use dtof_link::{AdaptiveBinning, Configuration, Refusal, Source, StopReason};
use dtof_sensors::dither::Dither;

use super::{BINS, Counters, Sidecar};

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
        let gate = RangeGate::new(first, last)?;
        let of_sensor = self.sensor.map_or(0, |sensor| sensor.dead_time);
        #[allow(clippy::cast_possible_truncation, reason = "128")]
        let dead_time = requested.dead_time_in_force(of_sensor, BINS as u16)?;
        let config_of = |rule: AnyRule| {
            let tracking = rule.tracking(&gate).filter(|_| requested.tracking);
            if requested.tracking && tracking.is_none() {
                return Err(Refusal::Tracking);
            }
            let config = PixelConfig::with_rule(rule)
                .x(requested.x)
                .l1(requested.l1)
                .l2(requested.l2)
                .gate(gate)
                .estimator(requested.estimator)
                .dead_time(dead_time)
                .tracking(tracking)
                .echoes(requested.echoes, requested.echo_guard_bins)
                .echo_wait(requested.echo_wait);
            Ok(config.build()?)
        };
        let neighbours = self.neighbours_of(&requested)?;
        let own = neighbours.map_or(requested.rule, |neighbours| {
            (*neighbours.rule().own()).into()
        });
        let pixels = config_of(own)?;
        let array = array_of(&requested).or(Array::new(requested.pixels.into(), 1));
        let array = array.ok_or(Refusal::Pixels)?;
        let mut config = ArrayConfig::new(array, pixels).first(requested.pixels.into())?;
        if let Some(neighbours) = neighbours {
            config = config
                .neighbours(neighbours)
                .map_err(|_| Refusal::Neighbours)?;
        }
        if let Some(AdaptiveBinning { levels, patience }) = requested.binning {
            array_of(&requested).ok_or(Refusal::Blocks)?;
            let blocks = config_of(requested.rule.of_blocks(levels))?;
            config = config.blocks(levels, blocks, patience)?;
        }
        if requested.once_per_bin {
            config = config.once_per_bin();
        }
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

    /// The requested neighbours.
    fn neighbours_of(&self, requested: &Configuration) -> Result<Option<NeighbourConfig>, Refusal> {
        let Some(neighbours) = requested.neighbours else {
            return Ok(None);
        };
        let of_sensor = requested.source == Source::Sensor;
        let gives_histograms = self.sensor.is_some_and(|sensor| sensor.gives_histograms);
        let array = array_of(requested).ok_or(Refusal::Neighbours)?;
        match &requested.rule {
            AnyRule::Window(rule)
                if requested.binning.is_none() && !(of_sensor && gives_histograms) =>
            {
                Ok(Some(NeighbourConfig::new(array, neighbours, rule)))
            }
            _ => Err(Refusal::Neighbours),
        }
    }
}

/// The array of the requested pixels; `None` without columns. Its last row may not be full.
fn array_of(requested: &Configuration) -> Option<Array> {
    let (pixels, columns) = (u32::from(requested.pixels), requested.columns.into());
    let rows = pixels.checked_div(columns)?;
    Array::new(columns, rows + u32::from(rows * columns < pixels))
}
