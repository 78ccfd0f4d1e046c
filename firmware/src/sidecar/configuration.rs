//! Taking a configuration on.

use dtof_core::{AnyRule, Array, Binning, Feed, PixelAddress, PixelConfig, RangeGate, RangeScale};
use dtof_link::{AdaptiveBinning, Configuration, Refusal, Source, StopReason};

use super::{Block, Pixel, Sidecar};

impl Sidecar<'_> {
    /// Takes the configuration in `body` on, all pixels at the beginning of an exposure.
    /// The one before stays if the device cannot do what is wanted.
    pub(super) fn configure(&mut self, body: &[u8]) -> Result<(), Refusal> {
        let wanted = Configuration::from_le_bytes(body)?;
        if wanted.host_timeout_ms == 0 && !cfg!(feature = "laser-on-without-host") {
            return Err(Refusal::HostTimeout);
        }
        let (first, mut last) = wanted.gate;
        if wanted.source == Source::Sensor {
            let sensor = self.sensor.ok_or(Refusal::NoSensor)?;
            if !sensor.has_bins_of(wanted.bin_width_ps) {
                return Err(Refusal::BinWidth);
            }
            // Bins that are not measured would be taken for ones without background.
            last = last.min(sensor.bins.saturating_sub(1));
        }
        if wanted.pixels == 0 || usize::from(wanted.pixels) > self.pixels.capacity() {
            return Err(Refusal::Pixels);
        }
        let gate = RangeGate::new(first, last)?;
        let config_of = |rule: AnyRule| {
            let tracking = rule.tracking(&gate).filter(|_| wanted.tracking);
            if wanted.tracking && tracking.is_none() {
                return Err(Refusal::Tracking);
            }
            let config = PixelConfig::with_rule(rule)
                .x(wanted.x)
                .l1(wanted.l1)
                .l2(wanted.l2)
                .gate(gate)
                .estimator(wanted.estimator)
                .one_hit_tdc(wanted.one_hit_tdc)
                .tracking(tracking)
                .echoes(wanted.echoes, wanted.peel_reach)
                .echo_wait(wanted.echo_wait);
            Ok(config.build()?)
        };
        let config = config_of(wanted.rule)?;
        let binning = match wanted.binning {
            None => None,
            Some(binning) => Some((
                self.blocks_of(&wanted, binning)?,
                config_of(wanted.rule.of_blocks(binning.levels))?,
                binning.patience,
            )),
        };
        let scale = RangeScale::new(wanted.bin_width_ps, wanted.offset_mm)?;
        let dynamic_depth = wanted.dynamic_depth.map(|changes| changes.config(&scale));
        let dynamic_depth = dynamic_depth.transpose()?;
        self.pixels.clear();
        self.blocks.clear();
        let blocks = binning.as_ref().map(|(blocks, ..)| blocks);
        for address in (0..wanted.pixels).map(PixelAddress) {
            let feed = blocks.map_or(Feed::NONE, |blocks| blocks.feed_of(address));
            // There is room: checked above.
            let _ = self.pixels.push(Pixel::new(address, feed));
        }
        for place in blocks.into_iter().flat_map(Binning::blocks) {
            let _ = self.blocks.push(Block::new(place));
        }
        self.config = Some(config);
        self.binning = binning.map(|(_, config, patience)| (config, patience));
        self.dynamic_depth = dynamic_depth;
        self.bin_width = wanted.bin_width_ps;
        self.source = wanted.source;
        self.host_timeout_ms = wanted.host_timeout_ms;
        self.stopping.get_or_insert(StopReason::Configuration);
        self.started = false;
        self.off = false;
        self.restart_counts();
        Ok(())
    }

    /// The blocks that are wanted, if there is room for them.
    fn blocks_of(
        &self,
        wanted: &Configuration,
        binning: AdaptiveBinning,
    ) -> Result<Binning, Refusal> {
        let columns = wanted.columns.into();
        let rows = u32::from(wanted.pixels).checked_div(columns);
        let rows = rows.ok_or(Refusal::Blocks)?;
        // The last row may not be full.
        let rows = rows + u32::from(rows * columns < u32::from(wanted.pixels));
        let array = Array::new(columns, rows).ok_or(Refusal::Blocks)?;
        let blocks = Binning::new(array, binning.levels).ok_or(Refusal::Blocks)?;
        let room = u32::try_from(self.blocks.capacity()).unwrap_or(u32::MAX);
        if blocks.number_of_blocks() > room {
            return Err(Refusal::Blocks);
        }
        Ok(blocks)
    }
}
