//! Memory figures in the documentation.

use std::mem::size_of;

use dtof_core::binning::Block;
use dtof_core::{AsyncPixel, Count8, Count16, Count24, DepthEvent, Histogram, PixelPlace};

#[test]
fn a_macropixel_takes_what_the_documentation_says() {
    println!(
        "AsyncPixel: {} bytes for 8 bins, {} for 128; DepthEvent {}",
        size_of::<AsyncPixel<8>>(),
        size_of::<AsyncPixel<128>>(),
        size_of::<DepthEvent>()
    );
    // The pixel: 64 bytes beside its counters.
    assert_eq!(size_of::<AsyncPixel<128>>(), 320);
    assert_eq!(size_of::<AsyncPixel<128, Count8>>(), 192);
    let statement = "macropixel of 128 bins takes 320 bytes, with 8-bit counters 192.";
    assert!(include_str!("../../../README.md").contains(statement));
    assert!(include_str!("../../../core/README.md").contains(statement));
    // In an array that is driven: 12 bytes more.
    assert_eq!(size_of::<PixelPlace<128>>(), 320 + 12);
    assert!(include_str!("../../../core/README.md").contains("In an array it takes 12 more."));
    // A block: 4 bytes more.
    assert_eq!(size_of::<Block<128>>(), 128 * 2 + 64 + 4);
    assert_eq!(size_of::<DepthEvent>(), 28);
    // Histogram: 2 bytes a bin (1 for 8 bits, 4 for 24) and 16 bytes more.
    assert_eq!(size_of::<Histogram<128>>(), 128 * 2 + 16);
    assert_eq!(size_of::<Histogram<128, Count8>>(), 128 + 16);
    assert_eq!(size_of::<Histogram<128, Count16>>(), 128 * 2 + 16);
    assert_eq!(size_of::<Histogram<128, Count24>>(), 128 * 4 + 16);
}
