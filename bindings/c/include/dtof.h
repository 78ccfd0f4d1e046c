// dtof: depth events from single photons, for firmware in C. README.md has the steps.
//
// Made by cbindgen of bindings/c/src; do not edit.
//
// Memory: nothing is allocated. Every object lies in your memory, such as
// `static dtof_pixel_t pixels[64];`. Do not read or write what is `opaque`.
//
// Pointers: null, misalignment and objects that were never initialised are answered by an error.
// What else a pointer leads to is up to you: memory of its type, as long as said. Two pointers of
// one call lead to different objects unless both are `const`.
//
// Errors: nearly every function returns a dtof_status_t. All but DTOF_OK mean that nothing was
// done. dtof_status_text says what they mean.
//
// Threads: there are no locks and no globals. An object belongs to one thread or interrupt at a
// time; different objects are independent. Objects that a function takes as `const` may be
// shared while nobody changes them.
//
// Laser: it is off unless a host that is alive has configured the device. The library does not
// know your laser, so your firmware keeps this rule:
// 1. It is off after every start, and in handlers of faults, before anything else.
// 2. It goes on only when a configuration that takes photons from the sensor was accepted.
// 3. It goes off when another configuration is accepted, when dtof_link_receive gives
//    DTOF_SESSION_BEGAN or DTOF_SESSION_ENDED, when dtof_link_silent_ms gives the configuration's
//    host_timeout_ms or more, and when USB says that no program has the port open. It stays off
//    until rule 2.
// 4. A refused configuration changes nothing: a laser that is on stays on, one that is off, off.
// 5. Each time it goes off, dtof_link_set_stop_reason and dtof_report_t tell the host why.
//
// Units: a name that ends in _q8, _q12 or _q16 is in 1/256, 1/4096 or 1/65536 of its unit.

#ifndef DTOF_H
#define DTOF_H

#include <stddef.h>
#include <stdint.h>

// Bins of every histogram: what the library was built for, a power of two from 8 to 256. CMake's
// DTOF_BINS sets both.
#ifndef DTOF_BINS
#define DTOF_BINS 128
#endif

// The paper's rule: the highest bin against the background and its square root.
#define DTOF_RULE_PAPER 0

// A window around the peak against all other photons: a CFAR test.
#define DTOF_RULE_WINDOW 1

// The paper's threshold over the average of all bins.
#define DTOF_RULE_AVERAGE 2

// The paper's depth: the centroid of three bins.
#define DTOF_ESTIMATOR_CENTROID 0

// The centroid of a window that lies about the pulse.
#define DTOF_ESTIMATOR_CENTRED_WINDOW 1

// Bytes of a dtof_checked_config_t.
#define DTOF_CHECKED_CONFIG_SIZE 136

// The same in words of 64 bits.
#define DTOF_CHECKED_CONFIG_WORDS (DTOF_CHECKED_CONFIG_SIZE / 8)

// Its alignment.
#define DTOF_CHECKED_CONFIG_ALIGN 8

// The peak's counter is full: the peak may lie in another full bin.
#define DTOF_FLAG_SATURATED 1

// The depth window reaches past the range gate or into bins that are left out.
#define DTOF_FLAG_CLIPPED 2

// A decision was put off while the slot was full.
#define DTOF_FLAG_DEFERRED 4

// The TDC takes one hit a laser cycle, and took one in more than half of them.
#define DTOF_FLAG_PILE_UP 8

// The peak lies on the tail of an echo that was reported before.
#define DTOF_FLAG_TAIL 16

// Bytes of a dtof_statistics_t.
#define DTOF_STATISTICS_SIZE 72

// The same in words of 64 bits.
#define DTOF_STATISTICS_WORDS (DTOF_STATISTICS_SIZE / 8)

// Its alignment.
#define DTOF_STATISTICS_ALIGN 8

// Bytes of a dtof_scale_t.
#define DTOF_SCALE_SIZE 8

// The same in words of 32 bits.
#define DTOF_SCALE_WORDS (DTOF_SCALE_SIZE / 4)

// Its alignment.
#define DTOF_SCALE_ALIGN 4

// Bytes of a dtof_pixel_t.
#define DTOF_PIXEL_SIZE (72 + (2 * DTOF_BINS))

// The same in words of 64 bits.
#define DTOF_PIXEL_WORDS (DTOF_PIXEL_SIZE / 8)

// Its alignment.
#define DTOF_PIXEL_ALIGN 8

// Bytes of a dtof_histogram_t.
#define DTOF_HISTOGRAM_SIZE (16 + (4 * DTOF_BINS))

// The same in words of 32 bits.
#define DTOF_HISTOGRAM_WORDS (DTOF_HISTOGRAM_SIZE / 4)

// Its alignment.
#define DTOF_HISTOGRAM_ALIGN 4

// Echoes of one histogram or exposure, at most.
#define DTOF_ECHOES 4

// The version of the words, which file headers announce.
#define DTOF_AER_VERSION 4

// Bytes of a word.
#define DTOF_WORD_BYTES 16

// Bytes of an event at most: a time word, and its own.
#define DTOF_EVENT_BYTES 32

// Bytes of a dtof_aer_encoder_t, and of a dtof_aer_decoder_t.
#define DTOF_AER_SIZE 24

// The same in words of 64 bits.
#define DTOF_AER_WORDS (DTOF_AER_SIZE / 8)

// Their alignment.
#define DTOF_AER_ALIGN 8

// A depth event.
#define DTOF_RECORD_EVENT 1

// A change of depth.
#define DTOF_RECORD_DYNAMIC_DEPTH 2

// The laser cycle from which on the events that follow lie.
#define DTOF_RECORD_TIME 3

// The end of a recording.
#define DTOF_RECORD_END 4

// Bytes of a frame on the wire, at most.
#define DTOF_WIRE_BYTES 256

// Bytes of a message, at most: 15 words of events.
#define DTOF_BODY_BYTES 244

// From the host: a configuration, for dtof_device_config_read. Answer it with CONFIGURED or
// REFUSED.
#define DTOF_MESSAGE_CONFIGURE 1

// From the host: photons. A device with a sensor has no use for them.
#define DTOF_MESSAGE_PHOTONS 2

// From the host: answer it with SYNCHRONISED and the same body, after all events before it.
#define DTOF_MESSAGE_SYNCHRONISE 3

// From the host: answer it with STATISTICS and what dtof_report_write gives.
#define DTOF_MESSAGE_STATISTICS_REQUEST 4

// From the host: answer it with SENSOR and what dtof_sensor_write gives.
#define DTOF_MESSAGE_SENSOR_REQUEST 5

// From the host: the address of a pixel, 2 bytes, the lower first. Answer it with HISTOGRAM.
#define DTOF_MESSAGE_HISTOGRAM_REQUEST 6

// To the host: the configuration is in force. No body.
#define DTOF_MESSAGE_CONFIGURED 129

// To the host: it is not. One byte, from dtof_refusal_of.
#define DTOF_MESSAGE_REFUSED 130

// To the host: words of 16 bytes, up to 15 of them, as dtof_aer_encode gives them.
#define DTOF_MESSAGE_EVENTS 131

// To the host: all before is done.
#define DTOF_MESSAGE_SYNCHRONISED 132

// To the host: statistics.
#define DTOF_MESSAGE_STATISTICS 133

// To the host: what the sensor is.
#define DTOF_MESSAGE_SENSOR 134

// To the host: what dtof_pixel_histogram_write, dtof_counts_write or dtof_no_histogram_write
// gives.
#define DTOF_MESSAGE_HISTOGRAM 135

// No session has begun or ended.
#define DTOF_SESSION_UNCHANGED 0

// A host has begun a session.
#define DTOF_SESSION_BEGAN 1

// The host has ended its session.
#define DTOF_SESSION_ENDED 2

// The sensor has not stopped since the device was switched on.
#define DTOF_STOP_NONE 0

// The sensor stopped for another configuration.
#define DTOF_STOP_CONFIGURATION 1

// For a new session.
#define DTOF_STOP_NEW_SESSION 2

// Because the host ended its session.
#define DTOF_STOP_END_OF_SESSION 3

// Because the host was silent.
#define DTOF_STOP_SILENCE 4

// Because no program has the USB port open, or the cable is unplugged.
#define DTOF_STOP_NOT_LISTENING 5

// Before this start the firmware gave up, as on a failed assertion.
#define DTOF_STOP_PANIC 6

// Before this start there was a hard fault, a stack overflow included.
#define DTOF_STOP_FAULT 7

// The watchdog reset the device.
#define DTOF_STOP_WATCHDOG 8

// The supply voltage was too low.
#define DTOF_STOP_BROWN_OUT 9

// The reset pin or a debugger reset the device.
#define DTOF_STOP_RESET 10

// Bytes of a dtof_link_t.
#define DTOF_LINK_SIZE 2528

// The same in words of 64 bits.
#define DTOF_LINK_WORDS (DTOF_LINK_SIZE / 8)

// Its alignment.
#define DTOF_LINK_ALIGN 8

// Bytes of the body of SENSOR.
#define DTOF_SENSOR_BYTES 24

// Bytes of the body of STATISTICS.
#define DTOF_REPORT_BYTES 210

// Photons come over the link.
#define DTOF_SOURCE_LINK 0

// Photons come from the sensor.
#define DTOF_SOURCE_SENSOR 1

// There is no histogram: no configuration is in force.
#define DTOF_NO_HISTOGRAM_CONFIGURATION 1

// There is none: the device has no such pixel.
#define DTOF_NO_HISTOGRAM_PIXEL 2

// There is none: another request came before the answer.
#define DTOF_NO_HISTOGRAM_GIVEN_UP 3

// There is none: the sensor failed.
#define DTOF_NO_HISTOGRAM_SENSOR 4

// What a function returns. All but DTOF_OK are errors: nothing was done.
enum dtof_status_t
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Done.
    DTOF_OK = 0,
    // A pointer is null.
    DTOF_ERROR_NULL = 1,
    // A pointer is not aligned as its type must be.
    DTOF_ERROR_ALIGNMENT = 2,
    // The memory was not initialised by the function for it.
    DTOF_ERROR_NOT_INITIALISED = 3,
    // The memory has another size than the library expects: it was built for another number
    // of bins than the header says.
    DTOF_ERROR_SIZE = 4,
    // A number of elements is greater than memory can hold.
    DTOF_ERROR_LENGTH = 5,
    // The rule is none of DTOF_RULE_...
    DTOF_ERROR_RULE = 10,
    // The estimator is none of DTOF_ESTIMATOR_...
    DTOF_ERROR_ESTIMATOR = 11,
    // X is 0.
    DTOF_ERROR_ZERO_X = 12,
    // X is greater than L1.
    DTOF_ERROR_X_ABOVE_L1 = 13,
    // L2 is not greater than L1.
    DTOF_ERROR_L2_NOT_ABOVE_L1 = 14,
    // No multiple of X lies strictly between L1 and L2.
    DTOF_ERROR_NO_LOOK = 15,
    // The range gate ends past the last bin.
    DTOF_ERROR_GATE_PAST_LAST_BIN = 16,
    // The range gate leaves fewer than 8 bins.
    DTOF_ERROR_GATE_TOO_NARROW = 17,
    // The minimum peak count is 0 or greater than 16,777,215.
    DTOF_ERROR_MINIMUM_COUNT = 18,
    // The window of the rule is not 1 to 7 bins wide.
    DTOF_ERROR_WINDOW_WIDTH = 19,
    // The centred window does not reach 1 to 4 bins to either side.
    DTOF_ERROR_HALF_WIDTH = 20,
    // Tracking needs the window rule.
    DTOF_ERROR_TRACKING = 21,
    // The number of echoes is not 1 to 4.
    DTOF_ERROR_ECHOES = 22,
    // The bin width is 0, or so small that a bin rounds to 0 mm.
    DTOF_ERROR_ZERO_BIN_WIDTH = 30,
    // 1024 bins of this width and the offset reach beyond 8388 m.
    DTOF_ERROR_RANGE = 31,
    // The position is farther than 2 bins before bin 0, or past bin 1025.
    DTOF_ERROR_POSITION = 32,
    // No event waits.
    DTOF_ERROR_NO_EVENT = 40,
    // A field of the event is out of its range.
    DTOF_ERROR_EVENT = 41,
    // The word is of an unknown kind.
    DTOF_ERROR_AER_KIND = 50,
    // The control code of the word is unknown.
    DTOF_ERROR_AER_CONTROL = 51,
    // Bits of the word that are reserved are set.
    DTOF_ERROR_AER_RESERVED = 52,
    // A field of the word holds what cannot be.
    DTOF_ERROR_AER_OUT_OF_RANGE = 53,
    // An event before any time word.
    DTOF_ERROR_AER_MISSING_TIME = 54,
    // As many messages are under way as may be: offer it again later.
    DTOF_ERROR_FULL = 60,
    // No message has come.
    DTOF_ERROR_NO_MESSAGE = 61,
    // A message holds 244 bytes at most.
    DTOF_ERROR_MESSAGE_LENGTH = 62,
    // The kind of a message to the host is 128 to 239.
    DTOF_ERROR_MESSAGE_KIND = 63,
    // The reason is none of DTOF_NO_HISTOGRAM_..., or none of DTOF_STOP_...
    DTOF_ERROR_REASON = 64,
    // The configuration of the host is not one this library knows.
    DTOF_ERROR_CONFIGURATION = 70,
    // The device does not have that many pixels.
    DTOF_ERROR_PIXELS = 71,
    // The device has no sensor.
    DTOF_ERROR_NO_SENSOR = 72,
    // The bins of the sensor are not as wide as that.
    DTOF_ERROR_BIN_WIDTH = 73,
    // The threshold of dynamic depth is less than half of 1/256 bin.
    DTOF_ERROR_ZERO_THRESHOLD = 74,
    // The patience of adaptive binning is 0.
    DTOF_ERROR_PATIENCE = 75,
    // There is no room for blocks of pixels. This library has none.
    DTOF_ERROR_BLOCKS = 76,
    // The host timeout is not 200 to 60,000 ms.
    DTOF_ERROR_HOST_TIMEOUT = 77,
    // A field of the configuration that has no meaning yet is not 0.
    DTOF_ERROR_RESERVED_FIELD = 78,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum dtof_status_t dtof_status_t;
#else
typedef uint8_t dtof_status_t;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What the end of laser cycles brought.
enum dtof_look_t
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Fewer than X laser cycles since the last look: none was taken.
    DTOF_LOOK_NOT_DUE = 0,
    // The exposure has not exceeded L1.
    DTOF_LOOK_TOO_EARLY = 1,
    // The peak does not stand clear; the exposure goes on.
    DTOF_LOOK_NO_PEAK = 2,
    // The slot still holds an event: the decision is put off by X laser cycles.
    DTOF_LOOK_DEFERRED = 3,
    // An event is in the slot.
    DTOF_LOOK_EVENT = 4,
    // The exposure reached L2 without an event: a new one begins.
    DTOF_LOOK_EXPIRED = 5,
    // The pixel has waited for another echo long enough: a new exposure begins.
    DTOF_LOOK_ENDED = 6,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum dtof_look_t dtof_look_t;
#else
typedef uint8_t dtof_look_t;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// How pixels operate, as a program writes it down. Fill it in with dtof_config_paper, change
// what you want, and check it with dtof_config_check. Fields of another rule or estimator are
// not looked at.
typedef struct dtof_config_t {
    // The fewest photons in a reported peak, with the window rule in the window: 1 to
    // 16,777,215. The counters of pixels hold 1023.
    uint32_t minimum_count;
    // Standard deviations above the background, in 1/256. Of the rules paper and average.
    uint16_t alpha_q8;
    // Standard deviations above the background, in 1/4096. Of the window rule.
    uint16_t z_q12;
    // Laser cycles between looks: at least 1.
    uint16_t x;
    // The exposure that a decision must exceed, in laser cycles: at least X.
    uint16_t l1;
    // The exposure at which a pixel starts over, in laser cycles: above L1, and a multiple of X
    // lies strictly between the two.
    uint16_t l2;
    // The first bin that may hold the peak.
    uint16_t gate_first;
    // The last bin that may hold the peak: at least 7 more, below DTOF_BINS.
    uint16_t gate_last;
    // How far the centred window reaches before its place, in 1/256 bin: 256 to 1024.
    uint16_t before_q8;
    // How far it reaches after its place, in 1/256 bin: 256 to 1024.
    uint16_t after_q8;
    // DTOF_RULE_...
    uint8_t rule;
    // The window of the window rule, in bins: 1 to 7.
    uint8_t window;
    // DTOF_ESTIMATOR_...
    uint8_t estimator;
    // Not 0: the TDC takes one photon a laser cycle, and events say when it piles up.
    uint8_t one_hit_tdc;
    // Not 0: pixels expect their next event where the last was. With the window rule.
    uint8_t tracking;
    // The last echo that a pixel reports in an exposure: 1 to 4.
    uint8_t echoes;
    // Bins to either side of an echo's peak that are left out once it is reported: any.
    uint8_t peel_reach;
    // An exposure ends once it is so many times as long as it was at its last echo; with 255
    // at L2.
    uint8_t echo_wait;
} dtof_config_t;

// A configuration that was checked: dtof_config_check makes it. It is read only from then on,
// so that any number of threads may use it at once. It may be copied.
typedef struct dtof_checked_config_t {
    uint64_t opaque[DTOF_CHECKED_CONFIG_WORDS];
} dtof_checked_config_t;

// What pixels have done. All zero it is of nothing done yet: `dtof_statistics_t done = {0};`.
// One serves any number of pixels; pixels of two threads need one each.
typedef struct dtof_statistics_t {
    uint64_t opaque[DTOF_STATISTICS_WORDS];
} dtof_statistics_t;

// The same as numbers. Photons offered are the first five together.
typedef struct dtof_counts_t {
    // Photons counted in a bin, of exposures that have ended.
    uint64_t counted;
    // Photons in bins around an echo that was reported.
    uint64_t held;
    // Photons that met a full counter.
    uint64_t saturated;
    // Photons with a TDC code past the last bin.
    uint64_t rejected;
    // Photons outside the range gate.
    uint64_t gated_out;
    // Events.
    uint64_t events;
    // Decisions put off because the slot was full.
    uint64_t deferred;
    // Exposures that reached L2 without an event.
    uint64_t expired;
    // Of these, exposures with a decision put off.
    uint64_t expired_deferred;
} dtof_counts_t;

// Bin width and range offset: dtof_scale_init makes it. It is read only from then on, and may
// be copied.
typedef struct dtof_scale_t {
    uint32_t opaque[DTOF_SCALE_WORDS];
} dtof_scale_t;

// A macropixel: a histogram of DTOF_BINS counters of 10 bits, its exposure, and a slot for one
// event. dtof_pixel_init makes it.
//
// One thread or interrupt at a time may use a pixel. Different pixels are independent.
typedef struct dtof_pixel_t {
    uint64_t opaque[DTOF_PIXEL_WORDS];
} dtof_pixel_t;

// A peak stood clear of the background.
typedef struct dtof_event_t {
    // The laser cycle whose end brought the decision.
    uint64_t cycle;
    // Photons in the highest bin, background included: up to 16,777,215.
    uint32_t peak_count;
    // The background a bin, in photons: up to 16,777,215.
    uint32_t background;
    // Where the pulse lies from the start of bin 0, in 1/256 bin: -512 to 262,399.
    // dtof_range makes it millimetres. Not looked at when an event is encoded.
    int32_t position_q8;
    // Which pixel.
    uint16_t pixel;
    // Laser cycles in the histogram it was decided from.
    uint16_t exposure;
    // The highest bin: up to 1023.
    uint16_t peak_bin;
    // Where the pulse lies from the start of the peak bin, in 1/256 bin: -512 to 511.
    int16_t offset_q8;
    // 0: of one pixel; 1 to 3: of a block of 2, 4 or 8 pixels a side.
    uint8_t level;
    // Which echo of the exposure: 1 to 4.
    uint8_t echo;
    // DTOF_FLAG_..., added up: below 32.
    uint8_t flags;
} dtof_event_t;

// Room for one histogram of DTOF_BINS counters of 24 bits. dtof_histogram_fill makes it, again
// and again. One thread or interrupt at a time may use it.
typedef struct dtof_histogram_t {
    uint32_t opaque[DTOF_HISTOGRAM_WORDS];
} dtof_histogram_t;

// Packs the events of one stream. One thread or interrupt at a time may use it.
typedef struct dtof_aer_encoder_t {
    uint64_t opaque[DTOF_AER_WORDS];
} dtof_aer_encoder_t;

// Reads the words of one stream. One thread or interrupt at a time may use it.
typedef struct dtof_aer_decoder_t {
    uint64_t opaque[DTOF_AER_WORDS];
} dtof_aer_decoder_t;

// What a word means. Fields that its kind does not have are 0.
typedef struct dtof_record_t {
    // The event. Of a change of depth `pixel`, `level`, `cycle`, `position_q8` and `flags`; of
    // a time word `cycle`.
    struct dtof_event_t event;
    // Of the end: events in the recording.
    uint64_t events;
    // Of the end: the CRC-32 of all bytes before.
    uint32_t checksum;
    // Of a change of depth: by how much, in 1/256 bin, positive if farther.
    int32_t change_q8;
    // DTOF_RECORD_...
    uint8_t kind;
} dtof_record_t;

// The device's end of a link to a host such as `dtof monitor`. dtof_link_init makes it. It must
// not be copied while it is in use. One thread or interrupt at a time may use it.
typedef struct dtof_link_t {
    uint64_t opaque[DTOF_LINK_WORDS];
} dtof_link_t;

// A message of the host.
typedef struct dtof_message_t {
    // DTOF_MESSAGE_...
    uint8_t kind;
    // Bytes of the body.
    uint8_t length;
    // The body; 0 after its end.
    uint8_t body[DTOF_BODY_BYTES];
} dtof_message_t;

// How a link is. The counters are since it was made.
typedef struct dtof_link_state_t {
    // Frames received whole.
    uint32_t frames;
    // Frames that were damaged.
    uint32_t corrupt;
    // Frames longer than a frame can be.
    uint32_t oversized;
    // Frames of another session.
    uint32_t foreign;
    // Messages dropped because one before them is missing; they come again.
    uint32_t out_of_order;
    // Messages that had arrived before.
    uint32_t duplicate;
    // Messages sent again.
    uint32_t retransmitted;
    // 1 if there is a session.
    uint8_t is_open;
    // 1 if dtof_link_offer has room.
    uint8_t has_room;
    // 1 if the host has everything that was offered.
    uint8_t is_settled;
} dtof_link_state_t;

// What the host wants. Check `pixel` with dtof_config_check, and the rest against what your
// device has.
typedef struct dtof_device_config_t {
    // How pixels are to operate.
    struct dtof_config_t pixel;
    // The width of a bin, in 1/65536 ps, for dtof_scale_init.
    uint32_t bin_width_ps_q16;
    // Millimetres added to every range, in 1/256 mm.
    int32_t offset_mm_q8;
    // Pixels, with addresses from 0.
    uint16_t pixels;
    // The laser goes off once the host has been silent for so many milliseconds: 200 to 60,000.
    // 0 means never. Refuse that with DTOF_ERROR_HOST_TIMEOUT, unless your laser may run
    // without a host.
    uint16_t host_timeout_ms;
    // DTOF_SOURCE_...
    uint8_t source;
} dtof_device_config_t;

// What a device counts beside its pixels.
typedef struct dtof_report_t {
    // Laser cycles that have ended since the configuration.
    uint64_t cycles;
    // Photons of pixels that the device does not have.
    uint64_t unaddressed;
    // Bytes that were lost before dtof_link_receive got them.
    uint32_t overrun;
    // Messages that were not understood.
    uint32_t unknown;
    // Errors of the sensor.
    uint32_t sensor_errors;
    // How often the sensor, and with it the laser, was started since the device was switched on.
    uint32_t sensor_starts;
    // How often it was stopped.
    uint32_t sensor_stops;
    // The last of its errors, as docs/link-format.md numbers them: 0 if there was none.
    uint8_t last_sensor_error;
    // Why it stopped last: DTOF_STOP_...
    uint8_t stop_reason;
} dtof_report_t;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The version of the library: major, minor and patch, with a dot between them.
//
// Threads: any.
const char *dtof_version(void);

// Bins that the library was built for. They must be those of this header, DTOF_BINS.
//
// Threads: any.
uint16_t dtof_bins(void);

// What goes into a message DTOF_MESSAGE_REFUSED when a configuration is refused for the error
// `status`: 1 to 20. For errors that the link has no number for it is 1, "not known".
//
// Threads: any.
uint8_t dtof_refusal_of(uint8_t status);

// What `status` means, in a few words of ASCII. Of a number that is no status "unknown status".
//
// Threads: any.
const char *dtof_status_text(uint8_t status);

// Fills in the paper's settings: its rule with an alpha of 4 and at least 5 photons, its depth,
// X = 4, L1 = 40, L2 = 2000, all bins, one echo. Those of the other rules are z = 4.47 and a
// window of 3 bins; of the centred window 2.5 bins to either side.
//
// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
// Threads: nobody else uses `config` meanwhile.
dtof_status_t dtof_config_paper(struct dtof_config_t *config);

// Sets the window rule's width and the centred window to a pulse whose standard deviation is
// `sigma_q8`, in 1/256 bin. It suits pulses of 0.4 to 1.75 bins. It does not choose the rule or
// the estimator.
//
// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
// Threads: nobody else uses `config` meanwhile.
dtof_status_t dtof_config_for_pulse(struct dtof_config_t *config, uint16_t sigma_q8);

// Sets the window rule's z so that one in `one_in` exposures without a target brings a false
// alarm: 100 for 1 %. It goes by the gate, X, L1 and L2 of `config`, so set these before. z gets
// 2.15 to 6.44.
//
// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_ZERO_X,
// DTOF_ERROR_GATE_PAST_LAST_BIN, DTOF_ERROR_GATE_TOO_NARROW.
// Threads: nobody else uses `config` meanwhile.
dtof_status_t dtof_config_false_alarms(struct dtof_config_t *config,
                                       uint32_t one_in);

// Checks settings and makes the configuration of them.
//
// Errors: each of DTOF_ERROR_RULE to DTOF_ERROR_ECHOES, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
// `checked` stays as it was.
// Threads: nobody else uses `checked` meanwhile.
dtof_status_t dtof_config_check(const struct dtof_config_t *config,
                                struct dtof_checked_config_t *checked);

// Reads statistics.
//
// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
// Threads: not while another changes `statistics`.
dtof_status_t dtof_statistics_read(const struct dtof_statistics_t *statistics,
                                   struct dtof_counts_t *counts);

// From the width of a bin in 1/65536 ps, and the millimetres that are added to every range in
// 1/256 mm. The millimetres a bin are rounded to the nearest 1/65536 mm.
//
// Errors: DTOF_ERROR_ZERO_BIN_WIDTH, DTOF_ERROR_RANGE, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
// Threads: nobody else uses `scale` meanwhile.
dtof_status_t dtof_scale_init(struct dtof_scale_t *scale,
                              uint32_t bin_width_ps_q16,
                              int32_t offset_mm_q8);

// The range of an event's `position_q8` (1/256 bin) in 1/256 mm, within 0.01 mm of the
// real-valued formula.
//
// Errors: DTOF_ERROR_POSITION, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
// Threads: any number may use one scale.
dtof_status_t dtof_range(const struct dtof_scale_t *scale,
                         int32_t position_q8,
                         int32_t *range_mm_q8);

// Makes an empty pixel at the beginning of its first exposure. `size` is `sizeof *pixel`.
//
// Errors: DTOF_ERROR_SIZE if the library was built for another number of bins,
// DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
// Threads: nobody else uses `pixel` meanwhile.
dtof_status_t dtof_pixel_init(struct dtof_pixel_t *pixel, size_t size, uint16_t address);

// Counts one photon of the present laser cycle. `code` is its bin, as the TDC gives it. One of
// DTOF_BINS or more is counted as rejected, one outside the gate as gated out, one that meets a
// full counter as saturated.
//
// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED (of `config`).
// Threads: nobody else uses `pixel` meanwhile.
dtof_status_t dtof_pixel_count(struct dtof_pixel_t *pixel,
                               const struct dtof_checked_config_t *config,
                               uint16_t code);

// Counts `number` photons as dtof_pixel_count does, in a third of the time.
//
// Errors: DTOF_ERROR_LENGTH, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT,
// DTOF_ERROR_NOT_INITIALISED (of `config`). `codes` may be null if `number` is 0.
// Threads: nobody else uses `pixel` meanwhile.
dtof_status_t dtof_pixel_count_batch(struct dtof_pixel_t *pixel,
                                     const struct dtof_checked_config_t *config,
                                     const uint16_t *codes,
                                     size_t number);

// Counts a histogram over one or more laser cycles: `counts` are DTOF_BINS numbers of photons.
// End as many laser cycles after it.
//
// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED (of `config`).
// Threads: nobody else uses `pixel` meanwhile.
dtof_status_t dtof_pixel_count_frame(struct dtof_pixel_t *pixel,
                                     const struct dtof_checked_config_t *config,
                                     const uint16_t *counts);

// Ends `cycles` laser cycles of a pixel, the last of which is number `last`, and looks at its
// histogram if X or more have passed since the last look. `look` gets what that brought; it may
// be null.
//
// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED (of `config`).
// Threads: nobody else uses `pixel` or `statistics` meanwhile.
dtof_status_t dtof_pixel_end_laser_cycles(struct dtof_pixel_t *pixel,
                                          const struct dtof_checked_config_t *config,
                                          uint64_t last,
                                          struct dtof_statistics_t *statistics,
                                          uint16_t cycles,
                                          dtof_look_t *look);

// The same for `number` pixels in a row: checks once for all of them. `fired` gets how many
// have a new event in their slot; it may be null.
//
// Errors: DTOF_ERROR_LENGTH, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT,
// DTOF_ERROR_NOT_INITIALISED (of `config`).
// Threads: nobody else uses the pixels or `statistics` meanwhile.
dtof_status_t dtof_pixels_end_laser_cycles(struct dtof_pixel_t *pixels,
                                           size_t number,
                                           uint64_t last,
                                           const struct dtof_checked_config_t *config,
                                           struct dtof_statistics_t *statistics,
                                           uint16_t cycles,
                                           size_t *fired);

// Takes the event that waits in the slot, so that the pixel may fire again. Until then the
// pixel counts on and puts its decisions off.
//
// Errors: DTOF_ERROR_NO_EVENT, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
// Threads: nobody else uses `pixel` meanwhile.
dtof_status_t dtof_pixel_take_event(struct dtof_pixel_t *pixel, struct dtof_event_t *event);

// Adds the photons of the present exposure to `statistics`: those of exposures that have ended
// are there already. Do that in a copy, or once at the very end.
//
// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
// Threads: nobody else uses `pixel` or `statistics` meanwhile.
dtof_status_t dtof_pixel_add_photons(const struct dtof_pixel_t *pixel,
                                     struct dtof_statistics_t *statistics);

// Takes `counts`, DTOF_BINS numbers of photons, as far as they are in the gate. Adds the
// photons to `statistics`, those outside the gate as gated out, those above 16,777,215 a bin as
// saturated. `size` is `sizeof *histogram`.
//
// Errors: DTOF_ERROR_SIZE if the library was built for another number of bins,
// DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED (of `config`).
// Threads: nobody else uses `histogram` or `statistics` meanwhile.
dtof_status_t dtof_histogram_fill(struct dtof_histogram_t *histogram,
                                  size_t size,
                                  const struct dtof_checked_config_t *config,
                                  struct dtof_statistics_t *statistics,
                                  const uint32_t *counts);

// Decides on a filled histogram, once, whatever X, L1 and L2 are. `events` has room for
// DTOF_ECHOES of them; `found` gets how many there are, up to the echoes of `config`. `pixel`,
// `cycle` and `exposure` (laser cycles) are those of the events. With several echoes the bins
// around all but the last are emptied, so fill it again before the next decision.
//
// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED (of `config`).
// Threads: nobody else uses `histogram` or `statistics` meanwhile.
dtof_status_t dtof_histogram_detect(struct dtof_histogram_t *histogram,
                                    const struct dtof_checked_config_t *config,
                                    uint64_t cycle,
                                    struct dtof_statistics_t *statistics,
                                    uint16_t pixel,
                                    uint16_t exposure,
                                    struct dtof_event_t *events,
                                    size_t *found);

// Begins a stream.
//
// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
// Threads: nobody else uses `encoder` meanwhile.
dtof_status_t dtof_aer_encoder_init(struct dtof_aer_encoder_t *encoder);

// Packs an event: `bytes` has room for DTOF_EVENT_BYTES and gets 16, or 32 if a time word is
// due before it; `length` gets how many.
//
// Errors: DTOF_ERROR_EVENT if a field is out of its range, DTOF_ERROR_NULL,
// DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
// Threads: nobody else uses `encoder` meanwhile.
dtof_status_t dtof_aer_encode(struct dtof_aer_encoder_t *encoder,
                              const struct dtof_event_t *event,
                              uint8_t *bytes,
                              size_t *length);

// The last word of a file: how many events it holds, and the CRC-32 of all bytes before.
// `bytes` has room for DTOF_WORD_BYTES.
//
// Errors: DTOF_ERROR_NULL.
// Threads: any.
dtof_status_t dtof_aer_end(uint64_t events, uint32_t checksum, uint8_t *bytes);

// The CRC-32 of a file, piece by piece. `checksum` is that of the bytes before, 0 at the
// beginning, and gets that of these `length` bytes as well.
//
// Errors: DTOF_ERROR_LENGTH, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
// Threads: nobody else uses `checksum` meanwhile.
dtof_status_t dtof_crc32(uint32_t *checksum, const uint8_t *bytes, size_t length);

// Begins to read a stream.
//
// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
// Threads: nobody else uses `decoder` meanwhile.
dtof_status_t dtof_aer_decoder_init(struct dtof_aer_decoder_t *decoder);

// What the next word of a stream means. `bytes` are DTOF_WORD_BYTES.
//
// Errors: each of DTOF_ERROR_AER_..., after which the next word may be read; DTOF_ERROR_NULL,
// DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
// Threads: nobody else uses `decoder` meanwhile.
dtof_status_t dtof_aer_decode(struct dtof_aer_decoder_t *decoder,
                              const uint8_t *bytes,
                              struct dtof_record_t *record);

// Waits for a host. `pixels` is how many this device has room for. `size` is `sizeof *link`.
//
// Errors: DTOF_ERROR_SIZE, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
// Threads: nobody else uses `link` meanwhile.
dtof_status_t dtof_link_init(struct dtof_link_t *link, size_t size, uint16_t pixels);

// Takes `length` bytes that have come over the wire. `now_ms` is a clock of milliseconds that
// may wrap. `session` gets one of DTOF_SESSION_...: after DTOF_SESSION_BEGAN and
// DTOF_SESSION_ENDED switch the laser off, and forget configuration, events and statistics of
// the session before.
//
// Errors: DTOF_ERROR_LENGTH, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
// Threads: nobody else uses `link` meanwhile.
dtof_status_t dtof_link_receive(struct dtof_link_t *link,
                                const uint8_t *bytes,
                                size_t length,
                                uint32_t now_ms,
                                uint8_t *session);

// The next bytes to put on the wire: `wire` has room for DTOF_WIRE_BYTES, `length` gets how
// many there are, 0 if none are due. Call it until then, and again at least every 10 ms.
//
// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
// Threads: nobody else uses `link` meanwhile.
dtof_status_t dtof_link_transmit(struct dtof_link_t *link,
                                 uint32_t now_ms,
                                 uint8_t *wire,
                                 size_t *length);

// The kind of the host's next message, which stays where it is.
//
// Errors: DTOF_ERROR_NO_MESSAGE, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT,
// DTOF_ERROR_NOT_INITIALISED.
// Threads: nobody else uses `link` meanwhile.
dtof_status_t dtof_link_peek(const struct dtof_link_t *link, uint8_t *kind);

// Takes the host's next message. The host sends no more than four that are not taken.
//
// Errors: DTOF_ERROR_NO_MESSAGE, DTOF_ERROR_NULL, DTOF_ERROR_NOT_INITIALISED,
// DTOF_ERROR_ALIGNMENT.
// Threads: nobody else uses `link` meanwhile.
dtof_status_t dtof_link_take(struct dtof_link_t *link, struct dtof_message_t *message);

// Sends a message, sooner or later, whole, once and in order. `kind` is one of those
// DTOF_MESSAGE_... that go to the host, `body` has `length` bytes, up to DTOF_BODY_BYTES.
//
// Errors: DTOF_ERROR_FULL if four are under way: offer it again later. DTOF_ERROR_MESSAGE_KIND,
// DTOF_ERROR_MESSAGE_LENGTH, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
// Threads: nobody else uses `link` meanwhile.
dtof_status_t dtof_link_offer(struct dtof_link_t *link,
                              uint8_t kind,
                              const uint8_t *body,
                              size_t length);

// How the link is.
//
// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
// Threads: nobody else uses `link` meanwhile.
dtof_status_t dtof_link_state(const struct dtof_link_t *link, struct dtof_link_state_t *state);

// How long the host of the session has not been heard, in milliseconds: no whole frame of it has
// come. `now_ms` is the clock of dtof_link_receive, and not before its last time. Without a
// session it is 4,294,967,295.
//
// While the sensor runs, call it at least every 10 ms. Switch the laser off once it gives
// `host_timeout_ms` of the configuration or more.
//
// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
// Threads: nobody else changes `link` meanwhile.
dtof_status_t dtof_link_silent_ms(const struct dtof_link_t *link,
                                  uint32_t now_ms,
                                  uint32_t *silent_ms);

// Why the sensor stopped last: one of DTOF_STOP_..., but not DTOF_STOP_NONE. A host whose session
// the device has forgotten is told it. Call it when the sensor stops, and after a reset with
// the cause of that.
//
// Errors: DTOF_ERROR_REASON, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
// Threads: nobody else uses `link` meanwhile.
dtof_status_t dtof_link_set_stop_reason(struct dtof_link_t *link,
                                        uint8_t reason);

// Reads the body of CONFIGURE. What this library does not have is refused: blocks of pixels
// and dynamic depth.
//
// Errors: DTOF_ERROR_CONFIGURATION if it is not one this library knows, DTOF_ERROR_BLOCKS,
// DTOF_ERROR_MINIMUM_COUNT, DTOF_ERROR_WINDOW_WIDTH, DTOF_ERROR_HALF_WIDTH,
// DTOF_ERROR_PATIENCE, DTOF_ERROR_HOST_TIMEOUT, DTOF_ERROR_RESERVED_FIELD, DTOF_ERROR_LENGTH,
// DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT. dtof_refusal_of makes each the answer to the host.
// Threads: nobody else uses `config` meanwhile.
dtof_status_t dtof_device_config_read(const uint8_t *body,
                                      size_t length,
                                      struct dtof_device_config_t *config);

// Writes the body of SENSOR, DTOF_SENSOR_BYTES: the pixels of the sensor, 0 if there is none; how
// many bins it measures, up to DTOF_BINS; the width of its bins in 1/65536 ps, 0 if as wide as the
// host says; laser cycles a second in thousandths, 0 if not known; the range of the start of bin 0
// in 1/256 mm.
//
// Errors: DTOF_ERROR_NULL.
// Threads: any.
dtof_status_t dtof_sensor_write(uint16_t pixels,
                                uint16_t bins,
                                uint32_t bin_width_ps_q16,
                                uint64_t laser_millihertz,
                                int32_t offset_mm_q8,
                                uint8_t *body);

// Writes the body of STATISTICS, DTOF_REPORT_BYTES. Of `statistics` the events must be those
// that were sent before, so send all that wait first. Add the photons of present exposures with
// dtof_pixel_add_photons to a copy.
//
// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED (of `link`).
// Threads: nobody else uses `link` or `statistics` meanwhile.
dtof_status_t dtof_report_write(const struct dtof_report_t *report,
                                const struct dtof_statistics_t *statistics,
                                const struct dtof_link_t *link,
                                uint8_t *body);

// Writes a body of HISTOGRAM: the exposure that a pixel is in, so far. `cycles` is how many
// laser cycles have ended, `part` counts from 0. `body` has room for DTOF_BODY_BYTES; `length`
// gets how many there are, 0 after the last part. No photon may come between two parts.
//
// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
// Threads: nobody else changes `pixel` meanwhile.
dtof_status_t dtof_pixel_histogram_write(const struct dtof_pixel_t *pixel,
                                         size_t part,
                                         uint64_t cycles,
                                         uint8_t *body,
                                         size_t *length);

// The same of a histogram that came whole from the sensor, which integrated `exposure` laser
// cycles for it: `counts` are DTOF_BINS numbers of photons. A count above 16,777,215 is written
// as that.
//
// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
// Threads: any.
dtof_status_t dtof_counts_write(const uint32_t *counts,
                                size_t part,
                                uint64_t cycles,
                                uint32_t exposure,
                                uint16_t pixel,
                                uint8_t *body,
                                size_t *length);

// Writes a body of HISTOGRAM that says why there is none: `reason` is one of
// DTOF_NO_HISTOGRAM_... `body` has room for DTOF_BODY_BYTES; `length` gets how many there are.
//
// Errors: DTOF_ERROR_REASON, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
// Threads: any.
dtof_status_t dtof_no_histogram_write(uint16_t pixel,
                                      uint8_t reason,
                                      uint8_t *body,
                                      size_t *length);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* DTOF_H */
