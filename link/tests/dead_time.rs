//! The dead time that a device applies: the table of `docs/link-format.md`.

use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{AnyRule, AverageRule, BlockLevel, Count, PaperRule, WindowRule};
use dtof_link::{AdaptiveBinning, Configuration, Refusal, Source};

const BINS: u16 = 128;

fn configuration(rule: AnyRule) -> Configuration {
    Configuration {
        rule,
        pixels: 64,
        columns: 8,
        ..Configuration::DEFAULT
    }
}

/// The configurations that weigh bins by any dead time, and those that do not.
fn configurations() -> ([Configuration; 1], [Configuration; 3]) {
    let count = Count::saturating(5);
    let alpha = U8F8::lit("4");
    let window = WindowRule::new(3, U4F12::lit("4.5"), count).unwrap();
    let binning = Some(AdaptiveBinning {
        levels: BlockLevel::saturating(1),
        patience: 64,
    });
    let window = configuration(window.into());
    (
        [window],
        [
            Configuration { binning, ..window },
            configuration(PaperRule::new(alpha, count).into()),
            configuration(AverageRule::new(alpha, count).into()),
        ],
    )
}

#[test]
fn the_configuration_has_the_say_whatever_the_sensor_says() {
    let (weighs, flags) = configurations();
    for source in [Source::Link, Source::Sensor] {
        for of_sensor in [0, 20, 127, 128, u16::MAX] {
            let given = |configuration: &Configuration, dead_time| {
                let dead_time = Some(dead_time);
                let given = Configuration {
                    dead_time,
                    source,
                    ..*configuration
                };
                given.dead_time_in_force(of_sensor, BINS)
            };
            for dead_time in [0, 1, 127, 128, u16::MAX] {
                for configuration in &weighs {
                    assert_eq!(given(configuration, dead_time), Ok(dead_time));
                }
                for configuration in &flags {
                    let is_refused = (1..BINS).contains(&dead_time);
                    let expected = [Ok(dead_time), Err(Refusal::DeadTime)];
                    let expected = expected[usize::from(is_refused)];
                    assert_eq!(given(configuration, dead_time), expected);
                }
            }
        }
    }
}

#[test]
fn else_it_is_the_sensors_if_photons_come_from_there_and_it_has_an_effect() {
    let (weighs, flags) = configurations();
    for of_sensor in [0, 1, 127, 128, u16::MAX] {
        let short = (1..BINS).contains(&of_sensor);
        let of_flags = if short { 0 } else { of_sensor };
        for (configurations, expected) in [(&weighs[..], of_sensor), (&flags[..], of_flags)] {
            for configuration in configurations {
                let found = configuration.dead_time_in_force(of_sensor, BINS);
                assert_eq!(found, Ok(expected));
                let source = Source::Link;
                let of_link = Configuration {
                    source,
                    ..*configuration
                };
                assert_eq!(of_link.dead_time_in_force(of_sensor, BINS), Ok(0));
            }
        }
    }
    // Of a device with more bins.
    let [configuration] = weighs;
    assert_eq!(configuration.dead_time_in_force(128, 256), Ok(128));
    let [configuration, ..] = flags;
    assert_eq!(configuration.dead_time_in_force(128, 256), Ok(0));
}
