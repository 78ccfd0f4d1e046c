//! A TMF8829 on a bus that can fail, beside its driver.

pub mod bench;
pub mod bus;
