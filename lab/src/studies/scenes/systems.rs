//! The paper's two systems, and the sources of their settings.
//!
//! | | PC (section III) | FPGA (section IV) | source |
//! |---|---|---|---|
//! | bins | 8 of 8.75 ns | 128 of 250 ps | III-A, IV-B |
//! | laser | 1.2 MHz | 10 MHz | III-A, IV-B |
//! | pulse | rectangle of 10 ns: σ = 0.33 bins | 120 ps FWHM: σ = 0.2 bins | III-A, IV-B |
//! | background | average of all bins | two quadrants | II-A, IV-B |
//! | α | 8 | 8, ours | III-B |
//! | L1 | 100 (III-B), 40 (III-D, III-E) | 40 | Table I for the FPGA |
//! | L2 | 2000; ours in III-D, III-E | 2000, ours | III-B |
//! | X | 10; ours in III-D, III-E | 4 | III-B, IV-A |
//!
//! The paper has no minimum count: it is 1. It gives neither background nor signal of its scenes.
//! We use B = 0.05, that of its analysis (II-C), and 0.02 for the FPGA. With a jitter of 70 ps, our
//! assumption, the pulse of the FPGA has σ = 0.35 bins.
//!
//! The PC takes mini-frames of five laser cycles. Every look falls on the end of a mini-frame, so
//! counting single photons is equivalent.

use crate::sweep::Point;
use anyhow::Result;
use dtof_core::fixed::types::{U8F8, U16F16};
use dtof_core::{AnyRule, AverageRule, Count, PaperRule};
use dtof_data::photons::MM_PER_PS;
use dtof_engine::settings::Settings;
use dtof_light::scene::Scene;

/// Standard deviation of the PC's pulse in bins.
pub const PC_SIGMA: f64 = 0.33;
/// Standard deviation of the FPGA's pulse in bins, without and with a jitter of 70 ps.
pub const FPGA_SIGMAS: [f64; 2] = [0.2, 0.35];
/// Pairs of the parameter `fpga` and the pulse.
pub const PULSES: [(f64, f64); 3] = [
    (0.0, PC_SIGMA),
    (1.0, FPGA_SIGMAS[0]),
    (1.0, FPGA_SIGMAS[1]),
];
/// L1 of all studies except the static scene.
pub const L1: u16 = 40;

/// The background estimate of the threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Background {
    /// The average of all bins.
    Average,
    /// The smaller of two quadrants.
    Quadrants,
}

impl Background {
    /// Both estimates.
    pub const ALL: [Self; 2] = [Self::Average, Self::Quadrants];

    pub const fn name(self) -> &'static str {
        match self {
            Self::Average => "average",
            Self::Quadrants => "quadrants",
        }
    }

    fn rule(self) -> AnyRule {
        let (alpha, minimum) = (U8F8::lit("8"), Count::saturating(1));
        match self {
            Self::Average => AverageRule::new(alpha, minimum).into(),
            Self::Quadrants => PaperRule::new(alpha, minimum).into(),
        }
    }
}

/// A system.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct System {
    pub name: &'static str,
    pub bins: u16,
    pub bin_width_ps: f64,
    pub laser_rate_mhz: f64,
    /// Laser cycles from one look to the next.
    pub x: u16,
    /// Background photons a bin and laser cycle.
    pub background: f64,
    /// The background estimate of its threshold.
    pub by: Background,
}

/// Section III.
pub const PC: System = System {
    name: "PC",
    bins: 8,
    bin_width_ps: 8750.0,
    laser_rate_mhz: 1.2,
    x: 10,
    background: 0.05,
    by: Background::Average,
};

/// Section IV.
pub const FPGA: System = System {
    name: "FPGA",
    bins: 128,
    bin_width_ps: 250.0,
    laser_rate_mhz: 10.0,
    x: 4,
    background: 0.02,
    by: Background::Quadrants,
};

impl System {
    /// The system of a point, by its parameter `fpga`.
    pub fn of(point: &Point) -> Self {
        if point["fpga"] > 0.0 { FPGA } else { PC }
    }

    /// The value for this system, such as a function for its number of bins.
    pub fn choose<T>(self, pc: T, fpga: T) -> T {
        if self == PC { pc } else { fpga }
    }

    /// Its name, and the pulse.
    pub fn with_pulse(&self, sigma: f64) -> String {
        format!("{}, σ {sigma} bins", self.name)
    }

    /// Millimetres of range a bin.
    pub fn mm_per_bin(&self) -> f64 {
        self.bin_width_ps * MM_PER_PS
    }

    /// Its settings with the background estimate `by`.
    pub fn settings(&self, by: Background, l1: u16, seed: u64) -> Settings {
        let settings = Settings::static_scene(seed).with_bins(self.bins.into());
        settings.configured(|system| {
            system.bin_width_ps = U16F16::from_num(self.bin_width_ps);
            (system.rule, system.l1, system.x) = (by.rule(), l1, self.x);
        })
    }

    /// The scene of a file with a pulse of this standard deviation in bins.
    pub fn scene(&self, text: &str, sigma: f64) -> Result<Scene> {
        Ok(Scene {
            bins: self.bins,
            bin_width_ps: self.bin_width_ps,
            laser_rate_mhz: self.laser_rate_mhz,
            background: self.background,
            pulse_sigma_bins: sigma,
            ..Scene::parse(text)?
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The standard deviation of a rectangle is its width over √12; the width is 1.2 % of 1/1.2
    /// MHz. The FWHM of a Gaussian is 2.3548 standard deviations.
    #[test]
    fn pulses_are_as_wide_as_the_lasers() {
        let rectangle_ps = 0.012 * 1e6 / PC.laser_rate_mhz;
        let sigma = rectangle_ps / 12.0_f64.sqrt() / PC.bin_width_ps;
        assert!((sigma - PC_SIGMA).abs() < 0.005);
        let sigma_ps = 120.0 / 2.3548;
        for (jitter_ps, sigma) in [0.0, 70.0].into_iter().zip(FPGA_SIGMAS) {
            let bins = f64::hypot(sigma_ps, jitter_ps) / FPGA.bin_width_ps;
            assert!((bins - sigma).abs() < 0.005, "{bins}");
        }
    }

    #[test]
    fn settings_are_the_papers() {
        let settings = PC.settings(PC.by, 100, 0);
        assert_eq!((settings.bins, settings.configuration.l1), (8, 100));
        assert_eq!(
            (settings.configuration.l2, settings.configuration.x),
            (2000, 10)
        );
        assert!(matches!(settings.configuration.rule, AnyRule::Average(_)));
        let settings = FPGA.settings(FPGA.by, L1, 0);
        assert_eq!((settings.bins, settings.configuration.x), (128, 4));
        assert!(matches!(settings.configuration.rule, AnyRule::Paper(_)));
    }
}
