//! A sensor's description and faults as the link carries them.

use dtof_link::{FaultRecord, SensorRecord};
use dtof_sensors::{SensorFault, SensorInfo};

pub(super) const fn sensor(info: &SensorInfo) -> SensorRecord {
    SensorRecord {
        pixels: info.pixels,
        bin_width: info.bin_width,
        offset: info.offset,
        laser_millihertz: info.laser_millihertz,
        bins: info.bins,
        dead_time: info.dead_time,
        most_dither: info.most_dither,
    }
}

pub(super) const fn fault(fault: SensorFault) -> FaultRecord {
    match fault {
        SensorFault::NoAnswer => FaultRecord::NoAnswer,
        SensorFault::Bus => FaultRecord::Bus,
        SensorFault::Pin => FaultRecord::Pin,
        SensorFault::WrongChip => FaultRecord::WrongChip,
        SensorFault::Rejected => FaultRecord::Rejected,
        SensorFault::Timeout => FaultRecord::Timeout,
        SensorFault::StuckInterrupt => FaultRecord::StuckInterrupt,
        SensorFault::NoImage => FaultRecord::NoImage,
        SensorFault::Data => FaultRecord::Data,
    }
}
