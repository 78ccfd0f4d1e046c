//! Every error of the library.

use core::ffi::{CStr, c_char};

use dtof_core::{
    AerError, ArrayError, GateError, PixelConfigError, RangeScaleError, WindowWidthError,
};
use dtof_link::Refusal;

/// The result of a function. All but DTOF_OK are errors: nothing was done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum dtof_status_t {
    /// Done.
    DTOF_OK = 0,
    /// A pointer is null.
    DTOF_ERROR_NULL = 1,
    /// A pointer is not aligned for its type.
    DTOF_ERROR_ALIGNMENT = 2,
    /// An object was not initialised, or is of another type.
    DTOF_ERROR_NOT_INITIALISED = 3,
    /// An object has another size than the library expects: the header and the library have
    /// different numbers of bins.
    DTOF_ERROR_SIZE = 4,
    /// An array is longer than memory can hold.
    DTOF_ERROR_LENGTH = 5,

    /// The rule is not one of DTOF_RULE_...
    DTOF_ERROR_RULE = 10,
    /// The estimator is not one of DTOF_ESTIMATOR_...
    DTOF_ERROR_ESTIMATOR = 11,
    /// X is 0.
    DTOF_ERROR_ZERO_X = 12,
    /// X is greater than L1.
    DTOF_ERROR_X_ABOVE_L1 = 13,
    /// L2 is not greater than L1.
    DTOF_ERROR_L2_NOT_ABOVE_L1 = 14,
    /// No multiple of X lies strictly between L1 and L2.
    DTOF_ERROR_NO_LOOK = 15,
    /// The range gate ends past the last bin.
    DTOF_ERROR_GATE_PAST_LAST_BIN = 16,
    /// The range gate leaves fewer than 8 bins.
    DTOF_ERROR_GATE_TOO_NARROW = 17,
    /// The minimum peak count is 0 or greater than 16,777,215.
    DTOF_ERROR_MINIMUM_COUNT = 18,
    /// The window of the rule is not 1 to 7 bins wide.
    DTOF_ERROR_WINDOW_WIDTH = 19,
    /// The centred window does not reach 1 to 4 bins to either side.
    DTOF_ERROR_HALF_WIDTH = 20,
    /// Tracking needs the window rule.
    DTOF_ERROR_TRACKING = 21,
    /// The number of echoes is not 1 to 4.
    DTOF_ERROR_ECHOES = 22,
    /// A dead time of 1 to DTOF_BINS - 1 needs the window rule, and no blocks of pixels.
    DTOF_ERROR_DEAD_TIME = 23,

    /// The bin width is 0, or so small that a bin rounds to 0 mm.
    DTOF_ERROR_ZERO_BIN_WIDTH = 30,
    /// 1024 bins of this width and the offset reach beyond 8388 m.
    DTOF_ERROR_RANGE = 31,
    /// The position is farther than 2 bins before bin 0, or past bin 1025.
    DTOF_ERROR_POSITION = 32,

    /// The slot has no event.
    DTOF_ERROR_NO_EVENT = 40,
    /// A field of the event is out of its range.
    DTOF_ERROR_EVENT = 41,

    /// The word is of an unknown kind.
    DTOF_ERROR_AER_KIND = 50,
    /// The control code of the word is unknown.
    DTOF_ERROR_AER_CONTROL = 51,
    /// Bits of the word that are reserved are set.
    DTOF_ERROR_AER_RESERVED = 52,
    /// A field of the word is out of range.
    DTOF_ERROR_AER_OUT_OF_RANGE = 53,
    /// An event before any time word.
    DTOF_ERROR_AER_MISSING_TIME = 54,

    /// The send queue is full: offer the message again later.
    DTOF_ERROR_FULL = 60,
    /// No message has arrived.
    DTOF_ERROR_NO_MESSAGE = 61,
    /// A message holds 244 bytes at most.
    DTOF_ERROR_MESSAGE_LENGTH = 62,
    /// The kind of a message to the host is 128 to 239.
    DTOF_ERROR_MESSAGE_KIND = 63,
    /// The reason is not one of DTOF_NO_HISTOGRAM_... or DTOF_STOP_...
    DTOF_ERROR_REASON = 64,

    /// The library does not know the configuration of the host.
    DTOF_ERROR_CONFIGURATION = 70,
    /// The device does not have that many pixels.
    DTOF_ERROR_PIXELS = 71,
    /// The device has no sensor.
    DTOF_ERROR_NO_SENSOR = 72,
    /// The bins of the sensor have another width.
    DTOF_ERROR_BIN_WIDTH = 73,
    /// The threshold of dynamic depth is less than half of 1/256 bin.
    DTOF_ERROR_ZERO_THRESHOLD = 74,
    /// The patience of adaptive binning is 0.
    DTOF_ERROR_PATIENCE = 75,
    /// There is no room for blocks of pixels, their levels are not 1 to 3, or there are no columns.
    DTOF_ERROR_BLOCKS = 76,
    /// The host timeout is not 200 to 60,000 ms.
    DTOF_ERROR_HOST_TIMEOUT = 77,
    /// A reserved field of the configuration is not 0.
    DTOF_ERROR_RESERVED_FIELD = 78,
    /// Photons cannot count once per bin, as the sensor gives histograms.
    DTOF_ERROR_ONCE_PER_BIN = 79,
    /// The laser cannot be dithered by so many bins.
    DTOF_ERROR_DITHER = 80,
    /// Neighbours are not 4 or 8, or confirm nothing here: they need columns, the window rule and photons,
    /// without blocks and without a dead time.
    DTOF_ERROR_NEIGHBOURS = 81,
}

use dtof_status_t::*;

impl From<PixelConfigError> for dtof_status_t {
    fn from(error: PixelConfigError) -> Self {
        match error {
            PixelConfigError::ZeroX => DTOF_ERROR_ZERO_X,
            PixelConfigError::XAboveL1 => DTOF_ERROR_X_ABOVE_L1,
            PixelConfigError::L2NotAboveL1 => DTOF_ERROR_L2_NOT_ABOVE_L1,
            PixelConfigError::NoLook => DTOF_ERROR_NO_LOOK,
            _ => DTOF_ERROR_CONFIGURATION,
        }
    }
}

impl From<GateError> for dtof_status_t {
    fn from(error: GateError) -> Self {
        match error {
            GateError::PastLastBin => DTOF_ERROR_GATE_PAST_LAST_BIN,
            GateError::TooNarrow => DTOF_ERROR_GATE_TOO_NARROW,
            _ => DTOF_ERROR_CONFIGURATION,
        }
    }
}

impl From<WindowWidthError> for dtof_status_t {
    fn from(_: WindowWidthError) -> Self {
        DTOF_ERROR_WINDOW_WIDTH
    }
}

impl From<ArrayError> for dtof_status_t {
    fn from(error: ArrayError) -> Self {
        match error {
            ArrayError::Pixels | ArrayError::Layout => DTOF_ERROR_PIXELS,
            ArrayError::Blocks | ArrayError::NoLevel => DTOF_ERROR_BLOCKS,
            ArrayError::BlocksAndNeighbours | ArrayError::NeighboursAndDeadTime => {
                DTOF_ERROR_NEIGHBOURS
            }
            _ => DTOF_ERROR_CONFIGURATION,
        }
    }
}

impl From<RangeScaleError> for dtof_status_t {
    fn from(error: RangeScaleError) -> Self {
        match error {
            RangeScaleError::ZeroBinWidth => DTOF_ERROR_ZERO_BIN_WIDTH,
            RangeScaleError::OutOfRange => DTOF_ERROR_RANGE,
            _ => DTOF_ERROR_CONFIGURATION,
        }
    }
}

impl From<AerError> for dtof_status_t {
    fn from(error: AerError) -> Self {
        match error {
            AerError::UnknownControl => DTOF_ERROR_AER_CONTROL,
            AerError::ReservedBits => DTOF_ERROR_AER_RESERVED,
            AerError::OutOfRange => DTOF_ERROR_AER_OUT_OF_RANGE,
            AerError::MissingTime => DTOF_ERROR_AER_MISSING_TIME,
            // `UnknownKind`, and what this header has no name for.
            _ => DTOF_ERROR_AER_KIND,
        }
    }
}

/// Each refusal of the link with its errors.
const REFUSALS: [(Refusal, dtof_status_t); 25] = [
    (Refusal::Unknown, DTOF_ERROR_CONFIGURATION),
    (Refusal::ZeroX, DTOF_ERROR_ZERO_X),
    (Refusal::XAboveL1, DTOF_ERROR_X_ABOVE_L1),
    (Refusal::L2NotAboveL1, DTOF_ERROR_L2_NOT_ABOVE_L1),
    (Refusal::NoLook, DTOF_ERROR_NO_LOOK),
    (Refusal::GatePastLastBin, DTOF_ERROR_GATE_PAST_LAST_BIN),
    (Refusal::GateTooNarrow, DTOF_ERROR_GATE_TOO_NARROW),
    (Refusal::Range, DTOF_ERROR_RANGE),
    (Refusal::Range, DTOF_ERROR_ZERO_BIN_WIDTH),
    (Refusal::Pixels, DTOF_ERROR_PIXELS),
    (Refusal::MinimumCount, DTOF_ERROR_MINIMUM_COUNT),
    (Refusal::NoSensor, DTOF_ERROR_NO_SENSOR),
    (Refusal::BinWidth, DTOF_ERROR_BIN_WIDTH),
    (Refusal::WindowWidth, DTOF_ERROR_WINDOW_WIDTH),
    (Refusal::HalfWidth, DTOF_ERROR_HALF_WIDTH),
    (Refusal::ZeroThreshold, DTOF_ERROR_ZERO_THRESHOLD),
    (Refusal::Patience, DTOF_ERROR_PATIENCE),
    (Refusal::Blocks, DTOF_ERROR_BLOCKS),
    (Refusal::Tracking, DTOF_ERROR_TRACKING),
    (Refusal::HostTimeout, DTOF_ERROR_HOST_TIMEOUT),
    (Refusal::Reserved, DTOF_ERROR_RESERVED_FIELD),
    (Refusal::DeadTime, DTOF_ERROR_DEAD_TIME),
    (Refusal::OncePerBin, DTOF_ERROR_ONCE_PER_BIN),
    (Refusal::Dither, DTOF_ERROR_DITHER),
    (Refusal::Neighbours, DTOF_ERROR_NEIGHBOURS),
];

impl From<Refusal> for dtof_status_t {
    fn from(refusal: Refusal) -> Self {
        let mut pairs = REFUSALS.iter();
        let pair = pairs.find(|(of, _)| *of == refusal);
        pair.map_or(DTOF_ERROR_CONFIGURATION, |(_, status)| *status)
    }
}

/// The body of DTOF_MESSAGE_REFUSED for a configuration that was refused with the error `status`:
/// 1 to 24. Errors without a number of their own give 1, "not known".
///
/// Threads: any.
#[unsafe(no_mangle)]
pub extern "C" fn dtof_refusal_of(status: u8) -> u8 {
    let mut pairs = REFUSALS.iter();
    let pair = pairs.find(|(_, of)| *of as u8 == status);
    pair.map_or(Refusal::Unknown, |(refusal, _)| *refusal) as u8
}

/// The meaning of `status` in a few words of ASCII, "unknown status" if the number is no status.
///
/// Threads: any.
#[unsafe(no_mangle)]
pub extern "C" fn dtof_status_text(status: u8) -> *const c_char {
    let mut texts = TEXTS.iter();
    let text = texts.find(|(of, _)| *of as u8 == status);
    text.map_or(c"unknown status", |(_, text)| *text).as_ptr()
}

/// The text of every status. A test compares it with the enum.
const TEXTS: [(dtof_status_t, &CStr); 47] = [
    (DTOF_OK, c"done"),
    (DTOF_ERROR_NULL, c"a pointer is null"),
    (DTOF_ERROR_ALIGNMENT, c"a pointer is not aligned"),
    (DTOF_ERROR_NOT_INITIALISED, c"an object was not initialised"),
    (
        DTOF_ERROR_SIZE,
        c"the library was built for another number of bins",
    ),
    (
        DTOF_ERROR_LENGTH,
        c"an array is longer than memory can hold",
    ),
    (DTOF_ERROR_RULE, c"unknown rule"),
    (DTOF_ERROR_ESTIMATOR, c"unknown estimator"),
    (DTOF_ERROR_ZERO_X, c"X must be at least 1"),
    (DTOF_ERROR_X_ABOVE_L1, c"X must not be greater than L1"),
    (DTOF_ERROR_L2_NOT_ABOVE_L1, c"L2 must be greater than L1"),
    (
        DTOF_ERROR_NO_LOOK,
        c"no multiple of X lies strictly between L1 and L2",
    ),
    (
        DTOF_ERROR_GATE_PAST_LAST_BIN,
        c"the range gate ends past the last bin",
    ),
    (
        DTOF_ERROR_GATE_TOO_NARROW,
        c"the range gate leaves fewer than 8 bins",
    ),
    (
        DTOF_ERROR_MINIMUM_COUNT,
        c"the minimum peak count is out of range",
    ),
    (
        DTOF_ERROR_WINDOW_WIDTH,
        c"the window must be 1 to 7 bins wide",
    ),
    (
        DTOF_ERROR_HALF_WIDTH,
        c"the centred window must reach 1 to 4 bins to either side",
    ),
    (DTOF_ERROR_TRACKING, c"tracking needs the window rule"),
    (DTOF_ERROR_ECHOES, c"the echoes must be 1 to 4"),
    (
        DTOF_ERROR_DEAD_TIME,
        c"the dead time needs the window rule, without blocks",
    ),
    (DTOF_ERROR_ZERO_BIN_WIDTH, c"the bin width is zero"),
    (DTOF_ERROR_RANGE, c"ranges would lie beyond 8388 m"),
    (DTOF_ERROR_POSITION, c"the position is out of range"),
    (DTOF_ERROR_NO_EVENT, c"the slot has no event"),
    (
        DTOF_ERROR_EVENT,
        c"a field of the event is out of its range",
    ),
    (DTOF_ERROR_AER_KIND, c"unknown kind of word"),
    (DTOF_ERROR_AER_CONTROL, c"unknown control word"),
    (DTOF_ERROR_AER_RESERVED, c"reserved bits are set"),
    (DTOF_ERROR_AER_OUT_OF_RANGE, c"a field is out of range"),
    (
        DTOF_ERROR_AER_MISSING_TIME,
        c"an event before any time word",
    ),
    (DTOF_ERROR_FULL, c"the send queue is full"),
    (DTOF_ERROR_NO_MESSAGE, c"no message has arrived"),
    (
        DTOF_ERROR_MESSAGE_LENGTH,
        c"a message holds 244 bytes at most",
    ),
    (
        DTOF_ERROR_MESSAGE_KIND,
        c"the kind of a message to the host is 128 to 239",
    ),
    (DTOF_ERROR_REASON, c"unknown reason"),
    (
        DTOF_ERROR_CONFIGURATION,
        c"the library does not know the configuration",
    ),
    (
        DTOF_ERROR_PIXELS,
        c"the device does not have that many pixels",
    ),
    (DTOF_ERROR_NO_SENSOR, c"the device has no sensor"),
    (
        DTOF_ERROR_BIN_WIDTH,
        c"the bins of the sensor have another width",
    ),
    (
        DTOF_ERROR_ZERO_THRESHOLD,
        c"the threshold of dynamic depth is too small",
    ),
    (
        DTOF_ERROR_PATIENCE,
        c"the patience of adaptive binning must be at least 1",
    ),
    (DTOF_ERROR_BLOCKS, c"there is no room for blocks of pixels"),
    (
        DTOF_ERROR_HOST_TIMEOUT,
        c"the host timeout must be 200 to 60000 ms",
    ),
    (DTOF_ERROR_RESERVED_FIELD, c"a reserved field is not 0"),
    (
        DTOF_ERROR_ONCE_PER_BIN,
        c"the sensor gives histograms, where photons cannot count once per bin",
    ),
    (
        DTOF_ERROR_DITHER,
        c"the sensor cannot dither its laser by so many bins",
    ),
    (
        DTOF_ERROR_NEIGHBOURS,
        c"neighbours need the window rule and photons, without blocks and without a dead time",
    ),
];
