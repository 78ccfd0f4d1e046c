//! Settings for a required rate of false alarms:
//! `cargo run --release --package dtof-light --example tune`.

use dtof_core::BlockLevel;
use dtof_light::looks::table::Table;
use dtof_light::progress::NONE;
use dtof_light::tune::{FalseAlarmLimit, Request, tune};

fn main() -> anyhow::Result<()> {
    let request = Request {
        background: 0.02,
        signal: 0.5,
        sigma: 1.0,
        bins: 128,
        minimum_count: 5,
        x: 4,
        l1: None,
        l2: 2000,
        limit: FalseAlarmLimit::PerExposure(0.01),
        levels: BlockLevel::PIXEL,
        seed: 1,
    };
    let tuned = tune(&request, &Table::load()?, NONE)?;
    println!("α = {}, L1 = {}", tuned.alpha, tuned.l1);
    println!("false alarms an exposure: {:.4}", tuned.false_alarms);
    assert!(tuned.false_alarms <= tuned.limit);
    Ok(())
}
