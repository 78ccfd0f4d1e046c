//! `dtof export`: each format, and files and options that it refuses.

mod damage;
mod echoes;
mod event_camera;
#[cfg(target_os = "linux")]
mod memory;
mod one_per_pixel;
mod plane;
mod points;
mod rates;
mod refused;
