//! The program as its users run it, and the libraries behind it.

mod common;

mod arguments;
mod calibrate;
mod compare;
mod counter_bits;
mod dead_time;
mod decide_once;
mod depth_map;
mod device;
mod export;
mod interrupt;
mod kinds;
mod neighbours;
mod offsets;
mod once_per_bin;
mod replay;
mod saving;
mod scene;
mod simulation;
mod view;
