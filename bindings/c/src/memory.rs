//! Checks pointers that come from C.
//!
//! Each opaque type of the header holds a tag and a Rust value. [`object`] names the value and
//! checks at compile time that it fits. The opaque words are `MaybeUninit`, because a value may
//! contain padding.

use core::{hint, slice};

use crate::status::dtof_status_t;
use crate::status::dtof_status_t::{
    DTOF_ERROR_ALIGNMENT, DTOF_ERROR_LENGTH, DTOF_ERROR_NOT_INITIALISED, DTOF_ERROR_NULL,
    DTOF_ERROR_SIZE, DTOF_OK,
};

/// An opaque type of the header.
pub(crate) trait Object: Sized {
    type Value;
    /// Its initialiser writes the tag. Each type has another one, and neither zeroed nor erased
    /// memory has one. Four equal bytes are one instruction.
    const TAG: u32;
}

/// What lies in an [`Object`]'s memory once it is initialised.
#[repr(C)]
pub(crate) struct Tagged<T> {
    tag: u32,
    pub(crate) value: T,
}

/// Implements [`Object`], and checks size and alignment at compile time: fewer than `unused_below`
/// bytes of the object are unused.
macro_rules! object {
    ($object:ty, $value:ty, tag $tag:expr, size $size:expr, align $align:expr, unused_below $unused_below:expr) => {
        impl $crate::memory::Object for $object {
            type Value = $value;
            const TAG: u32 = u32::from_ne_bytes([$tag; 4]);
        }
        const _: () = {
            type Tagged = $crate::memory::Tagged<$value>;
            assert!($tag != 0 && $tag != u8::MAX);
            assert!(size_of::<$object>() == $size);
            assert!(size_of::<Tagged>() <= $size && $size - size_of::<Tagged>() < $unused_below);
            assert!(align_of::<Tagged>() <= align_of::<$object>());
            assert!(align_of::<$object>() <= $align);
        };
    };
}

pub(crate) use object;

/// Keeps errors out of the usual path: the compiler moves a cold call elsewhere.
#[cold]
#[inline(never)]
fn refused(error: dtof_status_t) -> dtof_status_t {
    hint::black_box(error)
}

/// Fails if the pointer is null or misaligned.
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

/// Fails if an array is longer than memory can hold, or its pointer is null or misaligned. That of an empty array may be
/// anything.
#[inline(always)]
pub(crate) fn check_array<T>(pointer: *const T, number: usize) -> Result<(), dtof_status_t> {
    let bytes = number.checked_mul(size_of::<T>());
    if bytes.is_none_or(|bytes| isize::try_from(bytes).is_err()) {
        return Err(refused(DTOF_ERROR_LENGTH));
    }
    if number == 0 { Ok(()) } else { check(pointer) }
}

/// The value of an initialised object, to read.
///
/// # Safety
/// `pointer` is null, misaligned, or leads to readable memory of its type. Its first four bytes are
/// initialised, with any value: zeroed, erased, or part of another type. If they are the type's tag,
/// [`initialise`] wrote the object.
#[inline(always)]
pub(crate) unsafe fn object_ref<'a, C: Object>(
    pointer: *const C,
) -> Result<&'a C::Value, dtof_status_t> {
    let object = pointer.cast::<Tagged<C::Value>>();
    check(object)?;
    // SAFETY: neither null nor misaligned, and so memory of that type, by the promise. Only the
    // tag is read, and its bytes are initialised.
    if unsafe { (&raw const (*object).tag).read() } != C::TAG {
        return Err(refused(DTOF_ERROR_NOT_INITIALISED));
    }
    // SAFETY: the tag shows that the whole value was written, by the promise.
    Ok(unsafe { &(*object).value })
}

/// The value of an initialised object, to write.
///
/// # Safety
/// As [`object_ref`]'s, and no other thread reads or writes it during the call.
#[inline(always)]
pub(crate) unsafe fn object_mut<'a, C: Object + 'a>(
    pointer: *mut C,
) -> Result<&'a mut C::Value, dtof_status_t> {
    // SAFETY: the same promise.
    unsafe { object_ref(pointer)? };
    // SAFETY: checked in the line before; no other thread has it, by the promise.
    Ok(unsafe { &mut (*pointer.cast::<Tagged<C::Value>>()).value })
}

/// Writes a value to memory that need not be initialised.
///
/// # Safety
/// `pointer` is null, misaligned, or leads to writable memory of its type that no other
/// thread reads or writes during the call.
#[inline(always)]
pub(crate) unsafe fn put<T>(pointer: *mut T, value: T) -> Result<(), dtof_status_t> {
    check(pointer)?;
    // SAFETY: neither null nor misaligned, and so writable, by the promise.
    unsafe { pointer.write(value) };
    Ok(())
}

/// Initialises an object. `size` is what the header says: [`DTOF_ERROR_SIZE`] if the type has
/// another size here.
///
/// # Safety
/// As [`put`]'s.
#[inline(always)]
pub(crate) unsafe fn initialise<C: Object>(
    pointer: *mut C,
    size: usize,
    value: C::Value,
) -> Result<(), dtof_status_t> {
    if size != size_of::<C>() {
        return Err(DTOF_ERROR_SIZE);
    }
    let tag = C::TAG;
    // SAFETY: the same promise.
    unsafe { put(pointer.cast(), Tagged { tag, value }) }
}

/// A value without a tag, such as a number or a `repr(C)` record, to read.
///
/// # Safety
/// `pointer` is null, misaligned, or leads to readable, initialised memory of its type, and any bytes
/// are a value of the type.
#[inline(always)]
pub(crate) unsafe fn data_ref<'a, T>(pointer: *const T) -> Result<&'a T, dtof_status_t> {
    check(pointer)?;
    // SAFETY: neither null nor misaligned, and so memory of that type, by the promise.
    Ok(unsafe { &*pointer })
}

/// An array of values without tags, to read. The pointer of an empty array may be anything.
///
/// # Safety
/// As [`data_ref`]'s, for `number` of them.
#[inline(always)]
pub(crate) unsafe fn data_slice<'a, T>(
    pointer: *const T,
    number: usize,
) -> Result<&'a [T], dtof_status_t> {
    check_array(pointer, number)?;
    if number == 0 {
        return Ok(&[]);
    }
    // SAFETY: as above, and not longer than memory is.
    Ok(unsafe { slice::from_raw_parts(pointer, number) })
}

/// An array of `N` values without tags, which the caller only writes: it need not be initialised.
///
/// # Safety
/// As [`put`]'s, for `N` of them, and any bytes are a value of the type.
#[inline(always)]
pub(crate) unsafe fn array_mut<'a, T, const N: usize>(
    pointer: *mut T,
) -> Result<&'a mut [T; N], dtof_status_t> {
    check(pointer)?;
    // SAFETY: neither null nor misaligned, and so memory of that length, by the promise.
    Ok(unsafe { &mut *pointer.cast() })
}

/// Room for `number` values, each of which is written. The room of none may be anything.
///
/// # Safety
/// As [`put`]'s, for `number` of them, and what is returned is alone in using them.
pub(crate) unsafe fn room<T>(
    pointer: *mut T,
    number: usize,
    value: impl Fn() -> T,
) -> Result<&'static mut [T], dtof_status_t> {
    check_array(pointer, number)?;
    if number == 0 {
        return Ok(&mut []);
    }
    for place in 0..number {
        // SAFETY: neither null nor misaligned, and so writable memory of that length, by the promise.
        unsafe { pointer.add(place).write(value()) };
    }
    // SAFETY: all were written; not longer than memory is; no one else uses them, by the promise.
    Ok(unsafe { slice::from_raw_parts_mut(pointer, number) })
}

/// Turns a result into the status that C gets.
#[inline(always)]
pub(crate) fn status(body: impl FnOnce() -> Result<(), dtof_status_t>) -> dtof_status_t {
    match body() {
        Ok(()) => DTOF_OK,
        Err(error) => error,
    }
}
