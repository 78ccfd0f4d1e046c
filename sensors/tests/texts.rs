//! What is wrong with settings, in words.

use dtof_sensors::{tdc7200, tmf882x};

#[test]
fn every_error_of_settings_names_what_is_wrong() {
    use tdc7200::ConfigError as Tdc;
    use tmf882x::ConfigError as Tmf;

    let texts = [
        (
            Tdc::Clock.text(),
            Tdc::Clock.to_string(),
            "within 1 and 16 MHz",
        ),
        (
            Tdc::ZeroBinWidth.text(),
            Tdc::ZeroBinWidth.to_string(),
            "bin width is zero",
        ),
        (
            Tdc::Overflow.text(),
            Tdc::Overflow.to_string(),
            "overflows before a stop",
        ),
        (
            Tmf::Address.text(),
            Tmf::Address.to_string(),
            "within 0x08 and 0x77",
        ),
        (
            Tmf::ZeroIterations.text(),
            Tmf::ZeroIterations.to_string(),
            "at least 1,024 pulses",
        ),
        (
            Tmf::Pixels.text(),
            Tmf::Pixels.to_string(),
            "pixels of all zones do not fit",
        ),
        (
            Tmf::Timeout.text(),
            Tmf::Timeout.to_string(),
            "time out within one period",
        ),
    ];
    for (text, display, part) in texts {
        assert!(text.contains(part), "{text}");
        assert_eq!(text, display);
    }
}
