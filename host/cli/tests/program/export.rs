//! `dtof export`: what the program prints and refuses. `dtof-run` tests what is in the files, and so does the test
//! `readers` of `dtof-host-tests` with other projects' readers.

mod damage;
#[cfg(target_os = "linux")]
mod memory;
mod one_per_pixel;
mod plane;
mod points;
mod rates;
mod refused;
