//! Rules, thresholds, roots and peaks.

mod any_rule;
mod average;
mod background;
mod live;
mod peak;
mod quadrant;
mod root;
mod rules;
mod shares;
mod threshold;
mod window;
mod window_z;
mod window_z_tables;
mod without;
