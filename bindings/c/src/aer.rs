//! Events as words of 16 bytes.

use core::mem::MaybeUninit;

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use dtof_core::{AER_VERSION, AerDecoder, AerEncoder, AerRecord, AerWord};

use crate::event::{depth_event, dtof_event_t};
use crate::memory::{
    array_mut, check, data_ref, data_slice, initialise, object, object_mut, put, status,
};
use crate::status::dtof_status_t;
use crate::status::dtof_status_t::DTOF_ERROR_AER_KIND;

/// The version of the word format, which a file header contains.
pub const DTOF_AER_VERSION: u16 = 5;
const _: () = assert!(DTOF_AER_VERSION == AER_VERSION);

/// Bytes of a word.
pub const DTOF_WORD_BYTES: usize = 16;
/// The most bytes of an event: a time word and its own word.
pub const DTOF_EVENT_BYTES: usize = 32;
const _: () = assert!(DTOF_WORD_BYTES == AerWord::BYTES);

/// Bytes of a dtof_aer_encoder_t, and of a dtof_aer_decoder_t.
pub const DTOF_AER_SIZE: usize = 24;
/// The same in words of 64 bits.
pub const DTOF_AER_WORDS: usize = DTOF_AER_SIZE / 8;
/// Their alignment.
pub const DTOF_AER_ALIGN: usize = 8;

/// Packs the events of one stream. One thread or interrupt at a time may use it.
#[repr(C)]
pub struct dtof_aer_encoder_t {
    opaque: [MaybeUninit<u64>; DTOF_AER_WORDS],
}

object!(dtof_aer_encoder_t, AerEncoder, tag 0xd4,
    size DTOF_AER_SIZE, align DTOF_AER_ALIGN, unused_below 8);

/// Reads the words of one stream. One thread or interrupt at a time may use it.
#[repr(C)]
pub struct dtof_aer_decoder_t {
    opaque: [MaybeUninit<u64>; DTOF_AER_WORDS],
}

object!(dtof_aer_decoder_t, AerDecoder, tag 0xd5,
    size DTOF_AER_SIZE, align DTOF_AER_ALIGN, unused_below 8);

/// A depth event.
pub const DTOF_RECORD_EVENT: u8 = 1;
/// A change of depth.
pub const DTOF_RECORD_DYNAMIC_DEPTH: u8 = 2;
/// A time word: the laser cycle from which later events count.
pub const DTOF_RECORD_TIME: u8 = 3;
/// The end of a recording.
pub const DTOF_RECORD_END: u8 = 4;

/// A decoded word. Fields that its kind does not have are 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct dtof_record_t {
    /// The event. A change of depth has `pixel`, `level`, `cycle`, `position_q8` and `flags`; a
    /// time word has `cycle`.
    pub event: dtof_event_t,
    /// At the end: the number of events in the recording.
    pub events: u64,
    /// At the end: the CRC-32 of all bytes before.
    pub checksum: u32,
    /// The change of depth in 1/256 bin, positive if farther.
    pub change_q8: i32,
    /// DTOF_RECORD_...
    pub kind: u8,
}

/// Initialises an encoder at the beginning of a stream.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// Threads: no other thread uses `encoder` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_aer_encoder_init(encoder: *mut dtof_aer_encoder_t) -> dtof_status_t {
    // SAFETY: the caller's promise, see the crate.
    status(|| unsafe { initialise(encoder, DTOF_AER_SIZE, AerEncoder::new()) })
}

/// Packs an event into `bytes`, which has room for DTOF_EVENT_BYTES. `length` gets the number of
/// bytes: 16, or 32 if a time word comes before the event.
///
/// Errors: DTOF_ERROR_EVENT if a field is out of its range, DTOF_ERROR_NULL,
/// DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `encoder` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_aer_encode(
    encoder: *mut dtof_aer_encoder_t,
    event: *const dtof_event_t,
    bytes: *mut u8,
    length: *mut usize,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (encoder, event) = unsafe { (object_mut(encoder)?, depth_event(data_ref(event)?)?) };
        // SAFETY: the same promise.
        let bytes = unsafe { array_mut::<_, DTOF_EVENT_BYTES>(bytes)? };
        // Checked before the encoder counts the event as sent.
        check(length)?;
        let (time, word) = encoder.encode(&event);
        let (words, _) = bytes.as_chunks_mut();
        let mut number = 0;
        for (place, word) in words.iter_mut().zip(time.into_iter().chain([word])) {
            *place = word.to_le_bytes();
            number += DTOF_WORD_BYTES;
        }
        // SAFETY: the same promise.
        unsafe { put(length, number) }
    })
}

/// Writes the last word of a file: its number of events, and the CRC-32 of all bytes before.
/// `bytes` has room for DTOF_WORD_BYTES.
///
/// Errors: DTOF_ERROR_NULL.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_aer_end(events: u64, checksum: u32, bytes: *mut u8) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let bytes = unsafe { array_mut(bytes)? };
        *bytes = AerWord::end(events, checksum).to_le_bytes();
        Ok(())
    })
}

/// Updates the CRC-32 of a file with the next `length` bytes. `checksum` is 0 before the first
/// call.
///
/// Errors: DTOF_ERROR_LENGTH, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// Threads: no other thread uses `checksum` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_crc32(
    checksum: *mut u32,
    bytes: *const u8,
    length: usize,
) -> dtof_status_t {
    const CRC_32: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (before, bytes) = unsafe { (*data_ref(checksum)?, data_slice(bytes, length)?) };
        // The register behind that checksum: CRC-32 inverts and reflects its result.
        let mut digest = CRC_32.digest_with_initial((!before).reverse_bits());
        digest.update(bytes);
        // SAFETY: the same promise.
        unsafe { put(checksum, digest.finalize()) }
    })
}

/// Initialises a decoder at the beginning of a stream.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// Threads: no other thread uses `decoder` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_aer_decoder_init(decoder: *mut dtof_aer_decoder_t) -> dtof_status_t {
    // SAFETY: the caller's promise, see the crate.
    status(|| unsafe { initialise(decoder, DTOF_AER_SIZE, AerDecoder::new()) })
}

/// Decodes the next word of a stream. `bytes` are DTOF_WORD_BYTES.
///
/// Errors: each of DTOF_ERROR_AER_..., after which the next word may be read; DTOF_ERROR_NULL,
/// DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `decoder` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_aer_decode(
    decoder: *mut dtof_aer_decoder_t,
    bytes: *const u8,
    record: *mut dtof_record_t,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (decoder, bytes) =
            unsafe { (object_mut(decoder)?, data_slice(bytes, DTOF_WORD_BYTES)?) };
        // Checked before the decoder counts the word as read.
        check(record)?;
        let bytes = bytes.as_array().ok_or(DTOF_ERROR_AER_KIND)?;
        let read = record_of(&decoder.decode(AerWord::from_le_bytes(*bytes))?)?;
        // SAFETY: the same promise.
        unsafe { put(record, read) }
    })
}

fn record_of(record: &AerRecord) -> Result<dtof_record_t, dtof_status_t> {
    let none = dtof_record_t::default();
    Ok(match record {
        AerRecord::Event(event) => dtof_record_t {
            event: event.into(),
            kind: DTOF_RECORD_EVENT,
            ..none
        },
        AerRecord::DynamicDepth(change) => dtof_record_t {
            event: dtof_event_t {
                cycle: change.cycle.raw(),
                pixel: change.pixel.raw(),
                level: change.level.raw(),
                position_q8: change.position.raw(),
                flags: change.flags.bits(),
                ..none.event
            },
            change_q8: change.change(),
            kind: DTOF_RECORD_DYNAMIC_DEPTH,
            ..none
        },
        AerRecord::Time(cycle) => dtof_record_t {
            event: dtof_event_t {
                cycle: cycle.raw(),
                ..none.event
            },
            kind: DTOF_RECORD_TIME,
            ..none
        },
        AerRecord::End { events, checksum } => dtof_record_t {
            events: *events,
            checksum: *checksum,
            kind: DTOF_RECORD_END,
            ..none
        },
        // A kind of record that dtof.h does not have.
        _ => return Err(DTOF_ERROR_AER_KIND),
    })
}
