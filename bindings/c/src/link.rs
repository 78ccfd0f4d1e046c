//! The device's end of the link: messages arrive whole, once and in order.

use core::mem::MaybeUninit;

use dtof_link::endpoint::{BODY_BYTES, Endpoint, LinkCounters};
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::{StopReason, message};

use crate::memory::{
    array_mut, check, data_slice, initialise, object, object_mut, object_ref, put, status,
};
use crate::status::dtof_status_t;
use crate::status::dtof_status_t::{
    DTOF_ERROR_FULL, DTOF_ERROR_MESSAGE_KIND, DTOF_ERROR_MESSAGE_LENGTH, DTOF_ERROR_NO_MESSAGE,
    DTOF_ERROR_REASON,
};
use crate::version::dtof_bins;

/// The most bytes of a frame on the wire.
pub const DTOF_WIRE_BYTES: usize = 256;
const _: () = assert!(DTOF_WIRE_BYTES == WIRE_BYTES);
/// The most bytes of the body of a message.
pub const DTOF_BODY_BYTES: usize = 244;
const _: () = assert!(DTOF_BODY_BYTES == BODY_BYTES);

/// From the host: a configuration, for dtof_device_config_read. Answer it with CONFIGURED or
/// REFUSED.
pub const DTOF_MESSAGE_CONFIGURE: u8 = 0x01;
/// From the host: photons. A device with a sensor ignores them.
pub const DTOF_MESSAGE_PHOTONS: u8 = 0x02;
/// From the host: answer it with SYNCHRONISED and the same body, after all events before it.
pub const DTOF_MESSAGE_SYNCHRONISE: u8 = 0x03;
/// From the host: answer it with STATISTICS and a body of dtof_report_write.
pub const DTOF_MESSAGE_STATISTICS_REQUEST: u8 = 0x04;
/// From the host: answer it with SENSOR and a body of dtof_sensor_write.
pub const DTOF_MESSAGE_SENSOR_REQUEST: u8 = 0x05;
/// From the host: the address of a pixel, 2 bytes, little-endian. Answer it with HISTOGRAM.
pub const DTOF_MESSAGE_HISTOGRAM_REQUEST: u8 = 0x06;
/// To the host: the configuration is in force. No body.
pub const DTOF_MESSAGE_CONFIGURED: u8 = 0x81;
/// To the host: the configuration is refused. One byte, from dtof_refusal_of.
pub const DTOF_MESSAGE_REFUSED: u8 = 0x82;
/// To the host: words of 16 bytes, up to 15 of them, as dtof_aer_encode gives them.
pub const DTOF_MESSAGE_EVENTS: u8 = 0x83;
/// To the host: all events before SYNCHRONISE have been sent.
pub const DTOF_MESSAGE_SYNCHRONISED: u8 = 0x84;
/// To the host: statistics.
pub const DTOF_MESSAGE_STATISTICS: u8 = 0x85;
/// To the host: a description of the sensor.
pub const DTOF_MESSAGE_SENSOR: u8 = 0x86;
/// To the host: a body of dtof_pixel_histogram_write, dtof_counts_write or
/// dtof_no_histogram_write.
pub const DTOF_MESSAGE_HISTOGRAM: u8 = 0x87;
const _: () = assert!(
    DTOF_MESSAGE_CONFIGURE == message::CONFIGURE
        && DTOF_MESSAGE_PHOTONS == message::PHOTONS
        && DTOF_MESSAGE_SYNCHRONISE == message::SYNCHRONISE
        && DTOF_MESSAGE_STATISTICS_REQUEST == message::STATISTICS_REQUEST
        && DTOF_MESSAGE_SENSOR_REQUEST == message::SENSOR_REQUEST
        && DTOF_MESSAGE_HISTOGRAM_REQUEST == message::HISTOGRAM_REQUEST
        && DTOF_MESSAGE_CONFIGURED == message::CONFIGURED
        && DTOF_MESSAGE_REFUSED == message::REFUSED
        && DTOF_MESSAGE_EVENTS == message::EVENTS
        && DTOF_MESSAGE_SYNCHRONISED == message::SYNCHRONISED
        && DTOF_MESSAGE_STATISTICS == message::STATISTICS
        && DTOF_MESSAGE_SENSOR == message::SENSOR
        && DTOF_MESSAGE_HISTOGRAM == message::HISTOGRAM
);

/// The kinds of messages to the host. Lower kinds come from the host; higher ones are reserved.
const OF_DEVICE: core::ops::Range<u8> = 0x80..0xf0;

/// No session has begun or ended.
pub const DTOF_SESSION_UNCHANGED: u8 = 0;
/// A host has begun a session.
pub const DTOF_SESSION_BEGAN: u8 = 1;
/// The host has ended its session.
pub const DTOF_SESSION_ENDED: u8 = 2;

/// The sensor has not stopped since power-on.
pub const DTOF_STOP_NONE: u8 = 0;
/// The sensor stopped for another configuration.
pub const DTOF_STOP_CONFIGURATION: u8 = 1;
/// For a new session.
pub const DTOF_STOP_NEW_SESSION: u8 = 2;
/// Because the host ended its session.
pub const DTOF_STOP_END_OF_SESSION: u8 = 3;
/// Because the host was silent.
pub const DTOF_STOP_SILENCE: u8 = 4;
/// Because no program has the USB port open, or the cable is unplugged.
pub const DTOF_STOP_NOT_LISTENING: u8 = 5;
/// Before this start the firmware panicked, for instance on a failed assertion.
pub const DTOF_STOP_PANIC: u8 = 6;
/// Before this start there was a hard fault, a stack overflow included.
pub const DTOF_STOP_FAULT: u8 = 7;
/// The watchdog reset the device.
pub const DTOF_STOP_WATCHDOG: u8 = 8;
/// The supply voltage was too low.
pub const DTOF_STOP_BROWN_OUT: u8 = 9;
/// The reset pin or a debugger reset the device.
pub const DTOF_STOP_RESET: u8 = 10;
/// The device's port to the host failed.
pub const DTOF_STOP_PORT_FAILED: u8 = 11;
const _: () = assert!(
    DTOF_STOP_CONFIGURATION == StopReason::Configuration as u8
        && DTOF_STOP_NEW_SESSION == StopReason::NewSession as u8
        && DTOF_STOP_END_OF_SESSION == StopReason::EndOfSession as u8
        && DTOF_STOP_SILENCE == StopReason::Silence as u8
        && DTOF_STOP_NOT_LISTENING == StopReason::NotListening as u8
        && DTOF_STOP_PANIC == StopReason::Panic as u8
        && DTOF_STOP_FAULT == StopReason::Fault as u8
        && DTOF_STOP_WATCHDOG == StopReason::Watchdog as u8
        && DTOF_STOP_BROWN_OUT == StopReason::BrownOut as u8
        && DTOF_STOP_RESET == StopReason::Reset as u8
        && DTOF_STOP_PORT_FAILED == StopReason::PortFailed as u8
        && StopReason::from_number(DTOF_STOP_PORT_FAILED + 1).is_none()
);

/// Bytes of a dtof_link_t.
pub const DTOF_LINK_SIZE: usize = 2528;
/// The same in words of 64 bits.
pub const DTOF_LINK_WORDS: usize = DTOF_LINK_SIZE / 8;
/// Its alignment.
pub const DTOF_LINK_ALIGN: usize = 8;

/// The device's end of a link to a host such as `dtof monitor`. dtof_link_init makes it. It must
/// not be copied while it is in use. One thread or interrupt at a time may use it.
#[repr(C)]
pub struct dtof_link_t {
    opaque: [MaybeUninit<u64>; DTOF_LINK_WORDS],
}

/// The value of a dtof_link_t.
pub(crate) struct Link {
    pub(crate) endpoint: Endpoint,
    deframer: Deframer,
}

// On 32 bits it is smaller.
object!(dtof_link_t, Link, tag 0xd7, size DTOF_LINK_SIZE, align DTOF_LINK_ALIGN, unused_below 160);

/// A message from the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct dtof_message_t {
    /// DTOF_MESSAGE_...
    pub kind: u8,
    /// Bytes of the body.
    pub length: u8,
    /// The body, filled up with 0.
    pub body: [u8; DTOF_BODY_BYTES],
}

/// The state of a link. The counters start at its initialisation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct dtof_link_state_t {
    /// Frames received whole.
    pub frames: u32,
    /// Frames that were damaged.
    pub corrupt: u32,
    /// Frames longer than a frame can be.
    pub oversized: u32,
    /// Frames of another session.
    pub foreign: u32,
    /// Messages dropped because an earlier one is missing; the host sends them again.
    pub out_of_order: u32,
    /// Messages that had arrived before.
    pub duplicate: u32,
    /// Messages sent again.
    pub retransmitted: u32,
    /// 1 if there is a session.
    pub is_open: u8,
    /// 1 if dtof_link_offer has room.
    pub has_room: u8,
    /// 1 if the host has received all that was offered.
    pub is_settled: u8,
}

/// Initialises a link that waits for a host. `pixels` is the number of pixels of this device.
/// `size` is `sizeof *link`.
///
/// Errors: DTOF_ERROR_SIZE, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// Threads: no other thread uses `link` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_link_init(
    link: *mut dtof_link_t,
    size: usize,
    pixels: u16,
) -> dtof_status_t {
    status(|| {
        let made = Link {
            endpoint: Endpoint::device(message::greeting(dtof_bins(), pixels)),
            deframer: Deframer::new(),
        };
        // SAFETY: the caller's promise, see the crate.
        unsafe { initialise(link, size, made) }
    })
}

/// Takes `length` received bytes. `now_ms` is a clock of milliseconds that may wrap. `session` gets
/// one of DTOF_SESSION_...: after DTOF_SESSION_BEGAN and DTOF_SESSION_ENDED switch the laser off,
/// and discard the configuration, events and statistics of the session before, with
/// dtof_array_clear.
///
/// Errors: DTOF_ERROR_LENGTH, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `link` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_link_receive(
    link: *mut dtof_link_t,
    bytes: *const u8,
    length: usize,
    now_ms: u32,
    session: *mut u8,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (link, bytes) = unsafe { (object_mut(link)?, data_slice(bytes, length)?) };
        // Before the first byte is consumed.
        check(session)?;
        for &byte in bytes {
            if let Some(frame) = link.deframer.push(byte) {
                link.endpoint.receive(frame, now_ms);
            }
        }
        // The later of the two: the link keeps one.
        let change = if link.endpoint.take_began() {
            DTOF_SESSION_BEGAN
        } else if link.endpoint.take_ended() {
            DTOF_SESSION_ENDED
        } else {
            DTOF_SESSION_UNCHANGED
        };
        // SAFETY: the same promise.
        unsafe { put(session, change) }
    })
}

/// Gets the next bytes to send. `wire` has room for DTOF_WIRE_BYTES; `length` gets the number of
/// bytes, 0 if none are due. Repeat the call until it gives 0, and at least every 10 ms.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `link` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_link_transmit(
    link: *mut dtof_link_t,
    now_ms: u32,
    wire: *mut u8,
    length: *mut usize,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (link, wire) = unsafe { (object_mut(link)?, array_mut(wire)?) };
        // Before a frame counts as sent.
        check(length)?;
        let number = link.endpoint.transmit(now_ms, wire);
        // SAFETY: the same promise.
        unsafe { put(length, number) }
    })
}

/// Gets the kind of the host's next message without taking it.
///
/// Errors: DTOF_ERROR_NO_MESSAGE, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT,
/// DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `link` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_link_peek(link: *const dtof_link_t, kind: *mut u8) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let next = unsafe { object_ref(link)? }.endpoint.peek();
        // SAFETY: the same promise.
        unsafe { put(kind, next.ok_or(DTOF_ERROR_NO_MESSAGE)?.kind) }
    })
}

/// Takes the host's next message. The host sends at most four that are not taken.
///
/// Errors: DTOF_ERROR_NO_MESSAGE, DTOF_ERROR_NULL, DTOF_ERROR_NOT_INITIALISED,
/// DTOF_ERROR_ALIGNMENT.
/// Threads: no other thread uses `link` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_link_take(
    link: *mut dtof_link_t,
    message: *mut dtof_message_t,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let link = unsafe { object_mut(link)? };
        let next = link.endpoint.peek().ok_or(DTOF_ERROR_NO_MESSAGE)?;
        let mut taken = dtof_message_t {
            kind: next.kind,
            length: u8::try_from(next.body.len()).unwrap_or(u8::MAX),
            body: [0; DTOF_BODY_BYTES],
        };
        for (place, &byte) in taken.body.iter_mut().zip(&next.body) {
            *place = byte;
        }
        // SAFETY: the same promise. Before the message is gone.
        unsafe { put(message, taken)? };
        let _ = link.endpoint.take();
        Ok(())
    })
}

/// Queues a message, which arrives whole, once and in order. `kind` is one of the DTOF_MESSAGE_...
/// to the host; `body` has `length` bytes, up to DTOF_BODY_BYTES.
///
/// Errors: DTOF_ERROR_FULL if four are queued: offer it again later. DTOF_ERROR_MESSAGE_KIND,
/// DTOF_ERROR_MESSAGE_LENGTH, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `link` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_link_offer(
    link: *mut dtof_link_t,
    kind: u8,
    body: *const u8,
    length: usize,
) -> dtof_status_t {
    status(|| {
        if !OF_DEVICE.contains(&kind) {
            return Err(DTOF_ERROR_MESSAGE_KIND);
        }
        if length > DTOF_BODY_BYTES {
            return Err(DTOF_ERROR_MESSAGE_LENGTH);
        }
        // SAFETY: the caller's promise, see the crate.
        let (link, body) = unsafe { (object_mut(link)?, data_slice(body, length)?) };
        link.endpoint.offer(kind, body).map_err(|_| DTOF_ERROR_FULL)
    })
}

/// Gets the state of the link.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `link` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_link_state(
    link: *const dtof_link_t,
    state: *mut dtof_link_state_t,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let endpoint = &unsafe { object_ref(link)? }.endpoint;
        let LinkCounters {
            frames,
            corrupt,
            oversized,
            foreign,
            out_of_order,
            duplicate,
            retransmitted,
        } = *endpoint.counters();
        let now = dtof_link_state_t {
            frames,
            corrupt,
            oversized,
            foreign,
            out_of_order,
            duplicate,
            retransmitted,
            is_open: endpoint.is_open().into(),
            has_room: endpoint.has_room().into(),
            is_settled: endpoint.is_settled().into(),
        };
        // SAFETY: the same promise.
        unsafe { put(state, now) }
    })
}

/// Gets the milliseconds since the last whole frame from the host of the session, or 4,294,967,295
/// without a session. `now_ms` is the clock of dtof_link_receive, not earlier than in its last
/// call.
///
/// While the sensor runs, call it at least every 10 ms. Switch the laser off once the time reaches
/// `host_timeout_ms` of the configuration.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread changes `link` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_link_silent_ms(
    link: *const dtof_link_t,
    now_ms: u32,
    silent_ms: *mut u32,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let endpoint = &unsafe { object_ref(link)? }.endpoint;
        let silent = if endpoint.is_open() {
            endpoint.silent_ms(now_ms)
        } else {
            u32::MAX
        };
        // SAFETY: the same promise.
        unsafe { put(silent_ms, silent) }
    })
}

/// Sets the reason of the last stop of the sensor: one of DTOF_STOP_..., but not DTOF_STOP_NONE. A
/// host whose session has ended gets it. Call it when the sensor stops, and after a reset with the
/// cause of the reset.
///
/// Errors: DTOF_ERROR_REASON, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `link` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_link_set_stop_reason(
    link: *mut dtof_link_t,
    reason: u8,
) -> dtof_status_t {
    status(|| {
        let reason = StopReason::from_number(reason).ok_or(DTOF_ERROR_REASON)?;
        // SAFETY: the caller's promise, see the crate.
        unsafe { object_mut(link)? }
            .endpoint
            .set_stop_reason(reason);
        Ok(())
    })
}
