//! The same mistake in a settings file of the host, in a configuration on the link and in C: one error value each.
//! A flag and a keyword of Python have that of the file (the test `mistakes` of the program).

use dtof_c::dtof_status_t::*;
use dtof_c::*;
use dtof_core::fixed::types::U4F12;
use dtof_core::{AnyRule, Array, BlockLevel, Count, Count10, Neighbours, WindowRule};
use dtof_engine::settings::SettingsFile;
use dtof_link::{AdaptiveBinning, Configuration, Refusal};

use crate::array::Driven;
use crate::paper;

struct Mistake {
    /// The section `[detection]` or `[sensor]` of a file.
    file: &'static str,
    line: &'static str,
    /// Of a configuration, and of its bytes where no value has the mistake.
    link: fn(&mut Configuration),
    bytes: fn(&mut [u8]),
    c: fn(&mut dtof_config_t, &mut dtof_layout_t),
    refusal: Refusal,
    status: dtof_status_t,
}

/// The width of the window in a configuration: `docs/link-format.md`.
const WINDOW: usize = 26;

fn window(configuration: &mut Configuration) {
    let rule = WindowRule::new(3, U4F12::lit("4"), Count::saturating(5));
    configuration.rule = AnyRule::Window(rule.unwrap());
}

const MISTAKES: [Mistake; 5] = [
    // Out of range.
    Mistake {
        file: "[detection]\nrule = 'window'\nwindow = 9",
        line: "window 9: must be a whole number from 1 to 7",
        link: window,
        bytes: |bytes| bytes[WINDOW] = 9,
        c: |config, _| (config.rule, config.window) = (DTOF_RULE_WINDOW, 9),
        refusal: Refusal::WindowWidth,
        status: DTOF_ERROR_WINDOW_WIDTH,
    },
    // Two that do not fit.
    Mistake {
        file: "[detection]\nx = 50\nl1 = 40",
        line: "x 50: must not be greater than l1 40",
        link: |configuration| (configuration.x, configuration.l1) = (50, 40),
        bytes: |_| {},
        c: |config, _| (config.x, config.l1) = (50, 40),
        refusal: Refusal::XAboveL1,
        status: DTOF_ERROR_X_ABOVE_L1,
    },
    // Two that exclude each other.
    Mistake {
        file: "[detection]\nrule = 'window'\nwindow = 3\nneighbours = 8\nbinning = 1",
        line: "neighbours cannot be used with binning",
        link: |configuration| {
            window(configuration);
            configuration.neighbours = Neighbours::new(8);
            configuration.binning = Some(AdaptiveBinning {
                levels: BlockLevel::saturating(1),
                patience: 64,
            });
        },
        bytes: |_| {},
        c: |config, layout| {
            config.rule = DTOF_RULE_WINDOW;
            (layout.neighbours, layout.block_levels, layout.patience) = (8, 1, 64);
        },
        refusal: Refusal::Neighbours,
        status: DTOF_ERROR_NEIGHBOURS,
    },
    // For another rule.
    Mistake {
        file: "[detection]\ntracking = true",
        line: "tracking is for rule window",
        link: |configuration| configuration.tracking = true,
        bytes: |_| {},
        c: |config, _| config.tracking = 1,
        refusal: Refusal::Tracking,
        status: DTOF_ERROR_TRACKING,
    },
    // Too few.
    Mistake {
        file: "[sensor]\ngate = [4, 9]",
        line: "gate 4..9: with 128 bins: the range gate leaves fewer than 8 bins",
        link: |configuration| configuration.gate = (4, 9),
        bytes: |_| {},
        c: |config, _| (config.gate_first, config.gate_last) = (4, 9),
        refusal: Refusal::GateTooNarrow,
        status: DTOF_ERROR_GATE_TOO_NARROW,
    },
];

#[test]
fn a_mistake_is_one_error_in_a_file_on_the_link_and_in_c() {
    let array = Array::new(4, 4).unwrap();
    for mistake in MISTAKES {
        let of_file = SettingsFile::parse(mistake.file)
            .and_then(|file| file.settings(128))
            .and_then(|settings| settings.array_config::<128, Count10, ()>(array))
            .map(drop);
        assert_eq!(of_file.unwrap_err().to_string(), mistake.line);

        let mut configuration = Configuration {
            pixels: 16,
            columns: 4,
            ..Configuration::DEFAULT
        };
        (mistake.link)(&mut configuration);
        let mut bytes = configuration.to_le_bytes();
        (mistake.bytes)(&mut bytes);
        let refused = Configuration::from_le_bytes(&bytes)
            .and_then(|configuration| configuration.device_config::<128, Count10, ()>(0).map(drop))
            .unwrap_err();
        assert_eq!(refused, mistake.refusal, "{}", mistake.line);

        let mut settings = paper();
        let mut layout = dtof_layout_t {
            pixels: 16,
            columns: 4,
            ..dtof_layout_t::default()
        };
        (mistake.c)(&mut settings, &mut layout);
        let status = Driven::new().configure(&settings, &layout);
        assert_eq!(status, mistake.status, "{}", mistake.line);
    }
}
