//! Tests of the project: its packages, pages, sizes and rules.

mod architecture;
mod clocks;
mod doors;
mod eye_safety;
mod lines;
mod links;
mod modules;
mod packages;
mod paper;
mod scripts;
