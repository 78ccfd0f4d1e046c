//! The operations of `operations.h` in Rust, to compare with those in C.

#![cfg_attr(target_os = "none", no_std)]
#![allow(unsafe_code, reason = "C calls these functions")]
#![allow(clippy::cast_possible_truncation, reason = "small numbers from C")]

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{
    AerEncoder, AnyRule, Array, ArrayConfig, AverageRule, CentredWindow, Count, DepthEstimator,
    PaperRule, PixelArray, PixelConfig, PixelPlace, WindowRule,
};

const PIXELS: usize = 16;
const PHOTONS: usize = 256;

/// As in `operations.h`.
#[repr(C)]
pub struct Settings {
    rule: u32,
    window: u32,
    estimator: u32,
    alpha_q8: u32,
    z_q12: u32,
    minimum_count: u32,
    x: u32,
    l1: u32,
    l2: u32,
}

unsafe extern "C" {
    static codes: [u16; PHOTONS];
    static mut packed: [u8; 32];
}

struct State {
    array: PixelArray<'static, 128, AnyRule>,
    config: Option<ArrayConfig<128, AnyRule>>,
    encoder: AerEncoder,
}

struct Shared<T>(UnsafeCell<MaybeUninit<T>>);

// SAFETY: there is one thread, and no interrupt.
unsafe impl<T> Sync for Shared<T> {}

static PLACES: Shared<[PixelPlace<128>; PIXELS]> = Shared(UnsafeCell::new(MaybeUninit::uninit()));
static STATE: Shared<State> = Shared(UnsafeCell::new(MaybeUninit::uninit()));

fn state() -> &'static mut State {
    // SAFETY: there is one thread, and no operation calls another while it uses the state.
    // `configure` has written it before.
    unsafe { (*STATE.0.get()).assume_init_mut() }
}

fn photons_of() -> &'static [u16; PHOTONS] {
    // SAFETY: count.c writes it between operations only.
    unsafe { &codes }
}

fn config_of(settings: &Settings) -> Option<ArrayConfig<128, AnyRule>> {
    let count = Count::new(settings.minimum_count)?;
    let alpha = U8F8::from_bits(settings.alpha_q8 as u16);
    let z = U4F12::from_bits(settings.z_q12 as u16);
    let rule: AnyRule = match settings.rule {
        0 => PaperRule::new(alpha, count).into(),
        1 => WindowRule::new(settings.window as u8, z, count)
            .ok()?
            .into(),
        2 => AverageRule::new(alpha, count).into(),
        _ => return None,
    };
    let estimator = match settings.estimator {
        0 => DepthEstimator::Centroid3,
        1 => DepthEstimator::CentredWindow(CentredWindow::new(const { U8F8::lit("2.5") })?),
        _ => return None,
    };
    let config = PixelConfig::with_rule(rule).estimator(estimator);
    let [x, l1, l2] = [settings.x, settings.l1, settings.l2].map(|cycles| cycles as u16);
    let config = config.x(x).l1(l1).l2(l2).build().ok()?;
    Some(ArrayConfig::new(Array::new(PIXELS as u32, 1)?, config))
}

#[unsafe(no_mangle)]
extern "C" fn pixel_bytes() -> u32 {
    size_of::<PixelPlace<128>>() as u32
}

/// Must be called first.
///
/// # Safety
/// `settings` is null or points to settings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn configure(settings: *const Settings) -> u32 {
    // SAFETY: the caller's promise.
    let config = unsafe { settings.as_ref() }.and_then(config_of);
    // SAFETY: there is one thread, and the array of an earlier call is gone.
    let places = unsafe { &mut *PLACES.0.get() };
    let places = places.write(core::array::from_fn(|_| PixelPlace::new()));
    // SAFETY: there is one thread.
    let state = unsafe { &mut *STATE.0.get() };
    state.write(State {
        array: PixelArray::new(places, &mut []),
        config,
        encoder: AerEncoder::new(),
    });
    begin(0)
}

#[unsafe(no_mangle)]
extern "C" fn begin(_: u32) -> u32 {
    let state = state();
    state.encoder = AerEncoder::new();
    let config = state.config.as_ref();
    let configured = config.map(|config| state.array.configure(config));
    (configured != Some(Ok(()))).into()
}

#[unsafe(no_mangle)]
extern "C" fn photon(code: u32) -> u32 {
    state().array.photon(0, code as u16);
    0
}

#[unsafe(no_mangle)]
extern "C" fn photons(number: u32) -> u32 {
    state()
        .array
        .photons(number as usize % PIXELS, photons_of());
    0
}

#[unsafe(no_mangle)]
extern "C" fn end(_: u32) -> u32 {
    state().array.end_laser_cycle();
    0
}

#[unsafe(no_mangle)]
extern "C" fn take(_: u32) -> u32 {
    let mut events = 0;
    while state().array.next_event().is_some() {
        events += 1;
    }
    events
}

#[unsafe(no_mangle)]
extern "C" fn pack(_: u32) -> u32 {
    let state = state();
    let Some(event) = state.array.next_event() else {
        return 0;
    };
    let (time, word) = state.encoder.encode(&event);
    let room = &raw mut packed;
    // SAFETY: count.c reads it between operations only.
    let (places, _) = unsafe { &mut *room }.as_chunks_mut();
    let mut length = 0;
    for (place, word) in places.iter_mut().zip(time.into_iter().chain([word])) {
        *place = word.to_le_bytes();
        length += 16;
    }
    length
}

#[unsafe(no_mangle)]
extern "C" fn exposure(number: u32) -> u32 {
    let mut photons = photons_of().chunks(6);
    for cycle in 0..44 {
        let arrived = photons.next().unwrap_or_default();
        for pixel in 0..PIXELS {
            state().array.photons(pixel, arrived);
        }
        end(cycle);
    }
    pack(number)
}

#[cfg(target_os = "none")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        core::hint::spin_loop();
    }
}
