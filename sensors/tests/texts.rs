//! What is wrong with settings, in words.

use std::collections::BTreeSet;

use dtof_core::PixelAddress;
use dtof_core::fixed::types::U8F24;
use dtof_sensors::dither::Dither;
use dtof_sensors::simulated::SimulatedPixel;
use dtof_sensors::{i2c, photon_timer, tdc7200, tmf882x, tmf8829};

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

#[test]
fn every_error_of_a_poll_says_what_happened() {
    use tmf882x::Error as Tmf882x;
    use tmf8829::Error as Tmf8829;

    type Bus = &'static str;
    let texts = [
        (
            tdc7200::Error::<Bus, Bus>::Pin("cut").to_string(),
            "TDC7200: pin: \"cut\"",
        ),
        (
            tdc7200::Error::<Bus, Bus>::NotWritten {
                register: 1,
                wrote: 0x42,
                read: 0x40,
            }
            .to_string(),
            "TDC7200: register 0x01 reads 0x40, not 0x42",
        ),
        (i2c::Error::Pin.to_string(), "a pin failed"),
        (
            Tmf882x::<Bus, Bus>::Bus("cut").to_string(),
            "TMF882x: bus: \"cut\"",
        ),
        (
            Tmf882x::<Bus, Bus>::Device(tmf882x::DeviceError::WrongMode { mode: 8 }).to_string(),
            "TMF882x: is in the wrong mode, 0x08",
        ),
        (
            Tmf8829::<Bus, Bus>::Nack("cut").to_string(),
            "TMF8829: not acknowledged: \"cut\"",
        ),
        (
            Tmf8829::<Bus, Bus>::Device(tmf8829::DeviceError::Missed {
                expected: 3,
                found: 5,
            })
            .to_string(),
            "TMF8829: frame 5 came, not 3",
        ),
    ];
    for (display, text) in texts {
        assert_eq!(display, text);
    }
}

#[test]
fn every_error_of_settings_of_a_tmf8829_is_its_own_line() {
    use tmf8829::ConfigError as Of;

    let all = [
        Of::Address,
        Of::ZeroIterations,
        Of::Period,
        Of::Pixels,
        Of::Reference,
        Of::Timeout,
        Of::LongRange,
        Of::Peaks,
        Of::ResultSize,
    ];
    let texts: BTreeSet<&str> = all.iter().map(|error| error.text()).collect();
    assert_eq!(texts.len(), all.len());
    for error in all {
        assert!(error.text().len() > 20);
        assert_eq!(error.text(), error.to_string());
    }
}

#[test]
fn every_error_of_a_photon_timer_is_its_own_line() {
    use photon_timer::ConfigError as Of;

    let all = [
        (Of::TooFast, "at most 919117 a second"),
        (Of::TooSlow, "a laser cycle a second"),
        (Of::NoPulse, "is 0 ns"),
        (Of::LongPulse, "leaves no pause"),
        (Of::PulseBeyondLimit, "longer than 1000 ns"),
        (Of::DutyBeyondLimit, "more than 2 % of the time"),
    ];
    for (error, part) in all {
        assert!(error.text().contains(part), "{error}");
        assert_eq!(error.text(), error.to_string());
    }
}

#[test]
fn what_a_dither_and_a_simulated_pixel_cannot_be_is_said() {
    let error = Dither::new(3, 1).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the range of the dither must be an even number of bins, at most 254"
    );
    let more = U8F24::lit("2.5");
    let error = SimulatedPixel::new(PixelAddress::new(0), 0, more, more).unwrap_err();
    assert_eq!(
        error.to_string(),
        "more than 4 photons a laser cycle in a pixel"
    );
}
