//! Taking a configuration on.

use dtof_core::fixed::types::{I24F8, U4F12, U8F8, U16F16, U24F8};
use dtof_core::{
    AnyRule, CentredWindow, Count, DepthEstimator, DynamicDepthConfig, PaperRule, PixelAddress,
    PixelConfig, RangeGate, RangeScale, Reference, WindowRule,
};

use super::{Pixel, Sidecar};
use dtof_link::{Configuration, Refusal, Source};

impl Sidecar<'_> {
    /// Validates a configuration and takes it on, all pixels at the beginning of
    /// an exposure. The one before stays if it is refused.
    pub(super) fn configure(&mut self, wanted: &Configuration) -> Result<(), Refusal> {
        let bin_width = U16F16::from_bits(wanted.bin_width);
        let source = match (wanted.source, self.sensor) {
            (0, _) => Source::Link,
            (1, Some(sensor)) if sensor.has_bins_of(bin_width) => Source::Sensor,
            (1, Some(_)) => return Err(Refusal::BinWidth),
            (1, None) => return Err(Refusal::NoSensor),
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
        let rule = rule(wanted, minimum)?;
        let config = PixelConfig::with_rule(rule)
            .x(wanted.x)
            .l1(wanted.l1)
            .l2(wanted.l2)
            .gate(gate)
            .estimator(estimator(wanted)?)
            .one_hit_tdc(match wanted.one_hit {
                0 => false,
                1 => true,
                _ => return Err(Refusal::Unknown),
            })
            .build()?;
        let scale = RangeScale::new(bin_width, I24F8::from_bits(wanted.offset))?;
        let dynamic_depth = dynamic_depth(wanted, &scale)?;
        self.pixels.clear();
        for address in 0..wanted.pixels {
            // There is room: checked above.
            let _ = self.pixels.push(Pixel::new(PixelAddress(address)));
        }
        self.config = Some(config);
        self.dynamic_depth = dynamic_depth;
        self.bin_width = bin_width;
        self.source = source;
        self.started = false;
        self.restart_counts();
        Ok(())
    }
}

/// What a configuration has for the other rule is not looked at.
fn rule(wanted: &Configuration, minimum: Count) -> Result<AnyRule, Refusal> {
    Ok(match wanted.rule {
        AnyRule::PAPER => PaperRule::new(U8F8::from_bits(wanted.alpha), minimum).into(),
        AnyRule::WINDOW => {
            WindowRule::new(wanted.window, U4F12::from_bits(wanted.z), minimum)?.into()
        }
        _ => return Err(Refusal::Unknown),
    })
}

fn estimator(wanted: &Configuration) -> Result<DepthEstimator, Refusal> {
    match wanted.estimator {
        DepthEstimator::CENTROID_3 => Ok(DepthEstimator::Centroid3),
        DepthEstimator::CENTRED_WINDOW => CentredWindow::new(U8F8::from_bits(wanted.half_width))
            .map(DepthEstimator::CentredWindow)
            .ok_or(Refusal::HalfWidth),
        _ => Err(Refusal::Unknown),
    }
}

/// None if depth events are wanted themselves.
fn dynamic_depth(
    wanted: &Configuration,
    scale: &RangeScale,
) -> Result<Option<DynamicDepthConfig>, Refusal> {
    let reference = match wanted.output {
        0 => return Ok(None),
        1 => Reference::from_number(wanted.reference).ok_or(Refusal::Unknown)?,
        _ => return Err(Refusal::Unknown),
    };
    let threshold = U24F8::from_bits(wanted.threshold);
    Ok(Some(DynamicDepthConfig::new(threshold, scale, reference)?))
}
