//! Pointers of C's, checked.
//!
//! A type of the header whose fields are nobody's business holds one of Rust's. [`holds`] says
//! which, and does not compile if that does not fit. Its words are [`MaybeUninit`]: some bytes are
//! padding of what it holds, and were never written.
//!
//! [`MaybeUninit`]: core::mem::MaybeUninit

use core::{hint, slice};

use crate::status::dtof_status_t;
use crate::status::dtof_status_t::{
    DTOF_ERROR_ALIGNMENT, DTOF_ERROR_LENGTH, DTOF_ERROR_NOT_INITIALISED, DTOF_ERROR_NULL,
    DTOF_ERROR_SIZE, DTOF_OK,
};

/// A type of the header, and what lies in its memory.
pub(crate) trait Holds: Sized {
    type Inside;
}

/// Says what a type of the header holds. Checked when compiled: it is as large and as aligned,
/// and wastes less than `waste` bytes.
macro_rules! holds {
    ($outside:ty, $inside:ty, size $size:expr, align $align:expr, waste $waste:expr) => {
        impl $crate::memory::Holds for $outside {
            type Inside = $inside;
        }
        const _: () = {
            let (outside, inside) = (size_of::<$outside>(), size_of::<$inside>());
            assert!(outside == $size && inside <= outside && outside - inside < $waste);
            assert!(align_of::<$inside>() <= align_of::<$outside>());
            assert!(align_of::<$outside>() <= $align);
        };
    };
}

pub(crate) use holds;

/// A value that is only valid if it was written as a whole: its memory may hold anything before.
/// Each type of the header has a `KIND` of its own, so that none is taken for another.
#[repr(C)]
pub(crate) struct Tagged<T, const KIND: u8> {
    tag: u32,
    value: T,
}

impl<T, const KIND: u8> Tagged<T, KIND> {
    /// Stands in memory that was initialised. Zeroed or erased memory does not have it. Four equal
    /// bytes are one instruction.
    const TAG: u32 = {
        assert!(KIND != 0 && KIND != u8::MAX);
        u32::from_ne_bytes([KIND; 4])
    };

    pub(crate) const fn new(value: T) -> Self {
        Self {
            tag: Self::TAG,
            value,
        }
    }
}

/// An error, by a way that costs the usual one nothing: the compiler puts it elsewhere.
#[cold]
#[inline(never)]
fn refused(error: dtof_status_t) -> dtof_status_t {
    hint::black_box(error)
}

/// Whether a value may lie there.
#[inline(always)]
pub(crate) fn check<T>(pointer: *const T) -> Result<(), dtof_status_t> {
    if pointer.is_null() {
        return Err(refused(DTOF_ERROR_NULL));
    }
    if !pointer.is_aligned() {
        return Err(refused(DTOF_ERROR_ALIGNMENT));
    }
    Ok(())
}

/// What `pointer` leads to, to read. For types that any bytes are a value of.
///
/// # Safety
/// `pointer` is null, misaligned, or leads to readable memory of its type.
#[inline(always)]
pub(crate) unsafe fn shared<'a, C: Holds>(
    pointer: *const C,
) -> Result<&'a C::Inside, dtof_status_t> {
    let inside = pointer.cast::<C::Inside>();
    check(inside)?;
    // SAFETY: neither null nor misaligned, and so memory of that type, by the promise.
    Ok(unsafe { &*inside })
}

/// The same, to write.
///
/// # Safety
/// As [`shared`]'s, and nobody else reads or writes it meanwhile.
#[inline(always)]
pub(crate) unsafe fn exclusive<'a, C: Holds>(
    pointer: *mut C,
) -> Result<&'a mut C::Inside, dtof_status_t> {
    let inside = pointer.cast::<C::Inside>();
    check(inside)?;
    // SAFETY: neither null nor misaligned, and so memory of that type, by the promise.
    Ok(unsafe { &mut *inside })
}

/// The same for several in a row.
///
/// # Safety
/// As [`exclusive`]'s, for `number` of them.
#[inline(always)]
pub(crate) unsafe fn all_exclusive<'a, C: Holds>(
    pointer: *mut C,
    number: usize,
) -> Result<&'a mut [C::Inside], dtof_status_t> {
    const { assert!(size_of::<C>() == size_of::<C::Inside>()) };
    let inside = pointer.cast::<C::Inside>();
    check_number::<C>(number)?;
    if number == 0 {
        return Ok(&mut []);
    }
    check(inside)?;
    // SAFETY: as above, and not longer than memory is.
    Ok(unsafe { slice::from_raw_parts_mut(inside, number) })
}

fn check_number<T>(number: usize) -> Result<(), dtof_status_t> {
    let bytes = number.checked_mul(size_of::<T>());
    if bytes.is_none_or(|bytes| isize::try_from(bytes).is_err()) {
        return Err(refused(DTOF_ERROR_LENGTH));
    }
    Ok(())
}

/// What lies in initialised memory, to read.
///
/// # Safety
/// As [`shared`]'s.
#[inline(always)]
pub(crate) unsafe fn tagged<'a, T: 'a, const KIND: u8, C: Holds<Inside = Tagged<T, KIND>>>(
    pointer: *const C,
) -> Result<&'a T, dtof_status_t> {
    let inside = pointer.cast::<Tagged<T, KIND>>();
    check(inside)?;
    // SAFETY: as in `shared`; only the tag is read, which any bytes are a value of.
    if unsafe { (&raw const (*inside).tag).read() } != Tagged::<T, KIND>::TAG {
        return Err(refused(DTOF_ERROR_NOT_INITIALISED));
    }
    // SAFETY: with its tag the whole value was written.
    Ok(unsafe { &(*inside).value })
}

/// The same, to write.
///
/// # Safety
/// As [`exclusive`]'s.
#[inline(always)]
pub(crate) unsafe fn tagged_mut<'a, T: 'a, const KIND: u8, C: Holds<Inside = Tagged<T, KIND>>>(
    pointer: *mut C,
) -> Result<&'a mut T, dtof_status_t> {
    // SAFETY: the same promise.
    unsafe { tagged(pointer)? };
    // SAFETY: checked in the line before; nobody else has it, by the promise.
    Ok(unsafe { &mut (*pointer.cast::<Tagged<T, KIND>>()).value })
}

/// Puts a value into memory that may hold anything.
///
/// # Safety
/// `pointer` is null, misaligned, or leads to writable memory of its type that nobody else
/// reads or writes meanwhile.
#[inline(always)]
pub(crate) unsafe fn put<T>(pointer: *mut T, value: T) -> Result<(), dtof_status_t> {
    check(pointer)?;
    // SAFETY: neither null nor misaligned, and so writable, by the promise.
    unsafe { pointer.write(value) };
    Ok(())
}

/// The same for a type of the header that holds another, unless `size`, which the header says,
/// is not its size here.
///
/// # Safety
/// As [`put`]'s.
#[inline(always)]
pub(crate) unsafe fn initialise<C: Holds>(
    pointer: *mut C,
    size: usize,
    value: C::Inside,
) -> Result<(), dtof_status_t> {
    if size != size_of::<C>() {
        return Err(DTOF_ERROR_SIZE);
    }
    // SAFETY: the same promise.
    unsafe { put(pointer.cast(), value) }
}

/// A plain value, to read.
///
/// # Safety
/// As [`shared`]'s, and any bytes are a value of the type.
#[inline(always)]
pub(crate) unsafe fn plain<'a, T>(pointer: *const T) -> Result<&'a T, dtof_status_t> {
    check(pointer)?;
    // SAFETY: neither null nor misaligned, and so memory of that type, by the promise.
    Ok(unsafe { &*pointer })
}

/// So many plain values, to read. None may have any pointer.
///
/// # Safety
/// As [`plain`]'s, for `number` of them.
#[inline(always)]
pub(crate) unsafe fn all_plain<'a, T>(
    pointer: *const T,
    number: usize,
) -> Result<&'a [T], dtof_status_t> {
    check_number::<T>(number)?;
    if number == 0 {
        return Ok(&[]);
    }
    check(pointer)?;
    // SAFETY: as above, and not longer than memory is.
    Ok(unsafe { slice::from_raw_parts(pointer, number) })
}

/// An array of a known number of plain values, to write.
///
/// # Safety
/// As [`exclusive`]'s, and any bytes are a value of the type.
#[inline(always)]
pub(crate) unsafe fn array_mut<'a, T, const N: usize>(
    pointer: *mut T,
) -> Result<&'a mut [T; N], dtof_status_t> {
    check(pointer)?;
    // SAFETY: neither null nor misaligned, and so memory of that length, by the promise.
    Ok(unsafe { &mut *pointer.cast() })
}

/// What a function returns.
#[inline(always)]
pub(crate) fn status(body: impl FnOnce() -> Result<(), dtof_status_t>) -> dtof_status_t {
    match body() {
        Ok(()) => DTOF_OK,
        Err(error) => error,
    }
}
