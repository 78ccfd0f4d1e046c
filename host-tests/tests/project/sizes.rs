//! Memory figures in the documentation.

use std::mem::size_of;

use dtof_core::binning::Block;
use dtof_core::{AsyncPixel, Count16, Count24, DepthEvent, Histogram};

#[test]
fn a_macropixel_takes_what_the_documentation_says() {
    println!(
        "AsyncPixel: {} bytes for 8 bins, {} for 128; DepthEvent {}",
        size_of::<AsyncPixel<8>>(),
        size_of::<AsyncPixel<128>>(),
        size_of::<DepthEvent>()
    );
    // The pixel: 72 bytes beside its counters.
    assert_eq!(size_of::<AsyncPixel<128>>(), 128 * 2 + 72);
    let statement = "macropixel of 128 bins takes 328 bytes";
    assert!(include_str!("../../../README.md").contains(statement));
    assert!(include_str!("../../../core/README.md").contains(statement));
    assert_eq!(size_of::<AsyncPixel<128>>(), 328);
    // A block: 8 bytes more.
    assert_eq!(size_of::<Block<128>>(), 128 * 2 + 72 + 8);
    // Histogram: 2 bytes a bin (4 for 24 bits) and 16 bytes more.
    assert_eq!(size_of::<Histogram<128>>(), 128 * 2 + 16);
    assert_eq!(size_of::<Histogram<128, Count16>>(), 128 * 2 + 16);
    assert_eq!(size_of::<Histogram<128, Count24>>(), 128 * 4 + 16);
}
