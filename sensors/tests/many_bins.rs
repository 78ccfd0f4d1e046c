//! A sensor of one's own with more than 128 bins, and a sink that turns its histograms into depth.

use std::convert::Infallible;

use dtof_core::fixed::types::U16F16;
use dtof_core::{PixelAddress, PixelConfig, RangeScale, Statistics, WholeHistogram};
use dtof_sensors::dither::Dither;
use dtof_sensors::{PhotonSink, Polled, Sensor, SensorInfo};

const BINS: usize = 256;

/// It always has a histogram with a peak in bin 200.
struct Counted;

impl Sensor<BINS> for Counted {
    type Error = Infallible;

    fn info(&self) -> SensorInfo {
        SensorInfo {
            bin_width: Some(U16F16::lit("100")),
            bins: 256,
            gives_histograms: true,
            ..SensorInfo::new(1)
        }
    }

    fn start(&mut self, _: U16F16, _: Dither) {}

    fn stop(&mut self) {}

    fn poll(&mut self, _: u32, sink: &mut impl PhotonSink<BINS>) -> Result<Polled, Infallible> {
        let mut counts = [10; BINS];
        counts[200] = 1000;
        sink.begin_frame(5000);
        sink.histogram(PixelAddress::new(0), &counts);
        Ok(Polled::Data)
    }
}

/// The range of the last histogram in millimetres.
struct Depth {
    config: PixelConfig<BINS>,
    scale: RangeScale,
    millimetres: Option<i32>,
}

impl PhotonSink<BINS> for Depth {
    fn photon(&mut self, _: PixelAddress, _: u16) {}

    fn end_laser_cycles(&mut self, _: u16) {}

    fn begin_frame(&mut self, _: u32) {}

    fn histogram(&mut self, _: PixelAddress, counts: &[u32; BINS]) {
        let (mut whole, mut statistics) = (WholeHistogram::<BINS>::new(), Statistics::new());
        whole.decide(&self.config, counts, 5000, &mut statistics, |_, found| {
            self.millimetres = Some(self.scale.range(found.position()).round().to_num());
        });
    }
}

#[test]
fn histograms_of_256_bins_become_depth() {
    let mut sensor = Counted;
    let info = sensor.info();
    let mut sink = Depth {
        config: PixelConfig::paper().build().unwrap(),
        scale: RangeScale::new(info.bin_width.unwrap(), info.offset).unwrap(),
        millimetres: None,
    };
    assert_eq!(sensor.poll(0, &mut sink), Ok(Polled::Data));
    // 200.5 bins of 100 ps there and back.
    assert_eq!(sink.millimetres, Some(3005));
}
