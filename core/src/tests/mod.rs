//! Tests of what only the array of the crate orders: blocks, and the steps of a look. All others are in `core/tests`.

mod binning;
#[path = "../../tests/common/light.rs"]
mod light;
mod neighbours;
#[path = "../../tests/common/parallel.rs"]
mod parallel;
mod pixel_array;
mod proofs;
#[path = "../../tests/common/small.rs"]
mod small;
#[path = "../../tests/common/window.rs"]
mod window;
