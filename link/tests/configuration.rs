//! What a configuration builds, and the combinations that it refuses.

use dtof_core::events::ZeroThresholdError;
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{
    AnyRule, Array, ArrayConfig, ArrayError, BlockLevel, Count, Count16, GateError, Neighbours,
    PaperRule, PixelConfig, PixelConfigError, RangeScaleError, WindowRule, WindowWidthError,
};
use dtof_link::{AdaptiveBinning, Configuration, Refusal};

const BINS: usize = 128;

fn window() -> AnyRule {
    let rule = WindowRule::new(3, U4F12::lit("4.5"), Count::saturating(5));
    rule.unwrap().into()
}

fn blocks(patience: u16) -> Option<AdaptiveBinning> {
    let levels = BlockLevel::saturating(1);
    Some(AdaptiveBinning { levels, patience })
}

const EIGHT: Option<Neighbours> = Some(Neighbours::Eight);

/// 8 × 8 pixels with the window rule.
fn configuration() -> Configuration {
    Configuration {
        rule: window(),
        pixels: 64,
        columns: 8,
        ..Configuration::DEFAULT
    }
}

fn pixel(configuration: &Configuration) -> Result<PixelConfig<BINS, AnyRule>, Refusal> {
    configuration.pixel_config(0)
}

fn array(configuration: &Configuration) -> Result<(), Refusal> {
    let layout = Array::new(8, 8).unwrap();
    let config: Result<ArrayConfig<BINS, AnyRule, Count16, ()>, _> =
        configuration.array_config(layout, 64, 0);
    config.map(|_| ())
}

fn device(configuration: &Configuration) -> Result<(), Refusal> {
    let config: Result<ArrayConfig<BINS, AnyRule, Count16, ()>, _> = configuration.device_config(0);
    config.map(|_| ())
}

#[test]
fn plain_pixels_blocks_and_neighbours_are_built() {
    for (binning, neighbours) in [(None, None), (blocks(1), None), (None, EIGHT)] {
        for tracking in [false, true] {
            let configuration = Configuration {
                binning,
                neighbours,
                tracking,
                ..configuration()
            };
            assert!(pixel(&configuration).is_ok(), "{configuration:?}");
            assert_eq!(array(&configuration), Ok(()));
            assert_eq!(device(&configuration), Ok(()));
        }
    }
}

#[test]
fn neighbours_need_the_window_rule_without_blocks_and_without_a_dead_time() {
    let with = |configuration| Configuration {
        neighbours: EIGHT,
        ..configuration
    };
    let paper = PaperRule::new(U8F8::lit("4"), Count::saturating(5)).into();
    for refused in [
        Configuration {
            rule: paper,
            ..configuration()
        },
        Configuration {
            binning: blocks(40),
            ..configuration()
        },
        Configuration {
            dead_time: Some(20),
            ..configuration()
        },
    ] {
        let refused = with(refused);
        assert_eq!(pixel(&refused).err(), Some(Refusal::Neighbours));
        assert_eq!(array(&refused), Err(Refusal::Neighbours));
        assert_eq!(device(&refused), Err(Refusal::Neighbours));
        // Without neighbours each is right.
        let neighbours = None;
        let plain = Configuration {
            neighbours,
            ..refused
        };
        assert_eq!(device(&plain), Ok(()));
    }
    // A dead time is weighed whoever says it, also that of a TDC of the first photon.
    for (dead_time, of_sensor, is_built) in [
        (Some(0), 128, true),
        (Some(128), 0, false),
        (None, 0, true),
        (None, 128, false),
    ] {
        let configuration = with(Configuration {
            dead_time,
            ..configuration()
        });
        let built = configuration.pixel_config::<BINS>(of_sensor);
        assert_eq!(built.is_ok(), is_built, "{dead_time:?} {of_sensor}");
    }
}

#[test]
fn tracking_needs_the_window_rule() {
    let paper = Configuration {
        rule: Configuration::DEFAULT.rule,
        ..configuration()
    };
    assert!(pixel(&paper).is_ok());
    let tracking = Configuration {
        tracking: true,
        ..paper
    };
    assert_eq!(pixel(&tracking).err(), Some(Refusal::Tracking));
}

#[test]
fn blocks_wait_at_least_a_laser_cycle() {
    for (patience, expected) in [(0, Err(Refusal::Patience)), (1, Ok(())), (40, Ok(()))] {
        let binning = blocks(patience);
        let configuration = Configuration {
            binning,
            ..configuration()
        };
        assert_eq!(array(&configuration), expected);
        assert_eq!(device(&configuration), expected);
    }
}

#[test]
fn pixels_without_columns_are_a_row_which_has_neither_blocks_nor_neighbours() {
    let columns = 0;
    let row = Configuration {
        columns,
        ..configuration()
    };
    assert_eq!(device(&row), Ok(()));
    let neighbours = EIGHT;
    let with = Configuration { neighbours, ..row };
    assert_eq!(device(&with), Err(Refusal::Neighbours));
    let binning = blocks(40);
    let with = Configuration { binning, ..row };
    assert_eq!(device(&with), Err(Refusal::Blocks));
}

#[test]
fn every_error_of_the_core_is_a_refusal() {
    let of_pixels = [
        (PixelConfigError::ZeroX, Refusal::ZeroX),
        (PixelConfigError::XAboveL1, Refusal::XAboveL1),
        (PixelConfigError::L2NotAboveL1, Refusal::L2NotAboveL1),
        (PixelConfigError::NoLook, Refusal::NoLook),
    ];
    for (error, refusal) in of_pixels {
        assert_eq!(Refusal::from(error), refusal);
    }
    let of_arrays = [
        (ArrayError::Pixels, Refusal::Pixels),
        (ArrayError::Layout, Refusal::Pixels),
        (ArrayError::Blocks, Refusal::Blocks),
        (ArrayError::NoLevel, Refusal::Blocks),
        (ArrayError::OtherLooks, Refusal::Blocks),
        (ArrayError::BlocksAndNeighbours, Refusal::Neighbours),
        (ArrayError::NeighboursAndDeadTime, Refusal::Neighbours),
        // No configuration leads to it.
        (ArrayError::OtherRoom, Refusal::Unknown),
    ];
    for (error, refusal) in of_arrays {
        assert_eq!(Refusal::from(error), refusal);
    }
    let of_gates = [
        (GateError::PastLastBin, Refusal::GatePastLastBin),
        (GateError::TooNarrow, Refusal::GateTooNarrow),
    ];
    for (error, refusal) in of_gates {
        assert_eq!(Refusal::from(error), refusal);
    }
    for error in [RangeScaleError::ZeroBinWidth, RangeScaleError::OutOfRange] {
        assert_eq!(Refusal::from(error), Refusal::Range);
    }
    assert_eq!(Refusal::from(WindowWidthError), Refusal::WindowWidth);
    assert_eq!(Refusal::from(ZeroThresholdError), Refusal::ZeroThreshold);
}
