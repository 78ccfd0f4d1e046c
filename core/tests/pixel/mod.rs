//! The asynchronous pixel against its flow chart (section II-B).

mod config;
mod counted;
mod dead_time;
mod echoes;
mod flow_chart;
mod model;
mod narrow;
mod once_per_bin;
mod pile_up;
mod whole;
