//! What the drivers say of a sensor, as the link carries it.

use dtof_link::{FaultRecord, SensorRecord};
use dtof_sensors::{About, SensorFault};

pub(super) const fn sensor(about: &About) -> SensorRecord {
    SensorRecord {
        pixels: about.pixels,
        bin_width: about.bin_width,
        offset: about.offset,
        laser_millihertz: about.laser_millihertz,
        bins: about.bins,
    }
}

pub(super) const fn fault(fault: SensorFault) -> FaultRecord {
    match fault {
        SensorFault::NoAnswer => FaultRecord::NoAnswer,
        SensorFault::Bus => FaultRecord::Bus,
        SensorFault::Pin => FaultRecord::Pin,
        SensorFault::WrongChip => FaultRecord::WrongChip,
        SensorFault::NotTaken => FaultRecord::NotTaken,
        SensorFault::Timeout => FaultRecord::Timeout,
        SensorFault::StuckInterrupt => FaultRecord::StuckInterrupt,
        SensorFault::NoImage => FaultRecord::NoImage,
        SensorFault::Data => FaultRecord::Data,
    }
}
