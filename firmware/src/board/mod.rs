//! Boards, and the trait that the main loop needs.
//!
//! Each board has a file in this folder. It starts the clock, a timer of one
//! millisecond and a serial port, passes received bytes to
//! [`SerialInterrupt`](crate::serial::SerialInterrupt), fetches the bytes to send
//! from there, and implements [`Board`]. An image is one build with the feature
//! of its board and one file in `src/bin`; its memory is in the linker script
//! `build.rs` chooses.
//!
//! The file also implements `LaserOff`: what [`fault`] does first and last on a panic or a hard fault.

pub mod fault;
#[cfg(all(target_os = "none", feature = "mps2-an386"))]
pub mod mps2_an386;
#[cfg(all(target_os = "none", feature = "pico-boards"))]
pub mod pico;
#[cfg(all(target_os = "none", feature = "handlers", feature = "defmt"))]
mod report;
pub mod reset_reason;
#[cfg(all(target_os = "none", feature = "stm32f405"))]
pub mod stm32f405;
pub mod systick;
mod transmit;

// Each board defines the interrupt handlers of the image.
#[cfg(any(
    all(feature = "mps2-an386", feature = "pico-boards"),
    all(feature = "mps2-an386", feature = "stm32f405"),
    all(feature = "pico-boards", feature = "stm32f405"),
    all(feature = "pico", feature = "pico2")
))]
compile_error!("an image is for one board: choose one of mps2-an386, pico, pico2 and stm32f405");
#[cfg(all(feature = "pico-boards", not(any(feature = "pico", feature = "pico2"))))]
compile_error!("choose pico or pico2");

#[cfg(any(
    all(feature = "sensor-tdc7200", feature = "sensor-tmf8829"),
    all(feature = "sensor-tdc7200", feature = "sensor-tmf882x"),
    all(feature = "sensor-tmf8829", feature = "sensor-tmf882x")
))]
compile_error!("an image is for one sensor: choose one of the features sensor-*");

#[cfg(all(target_os = "none", feature = "handlers"))]
pub use self::fault::{LaserOff, on_panic};
pub use self::transmit::{Transmitter, transmit};

use dtof_sensors::Sensor;
use heapless::VecView;

use self::reset_reason::ResetReason;
use crate::serial::Serial;
use crate::sidecar::{Block, Pixel, Sidecar};

/// Whether the image drives a real sensor, and with it a laser. The watchdog then runs on while a
/// debugger halts the processor: otherwise the laser would stay on.
#[cfg(all(
    target_os = "none",
    any(feature = "pico-boards", feature = "stm32f405")
))]
const DRIVES_SENSOR: bool = cfg!(any(
    feature = "sensor-photon-timer",
    feature = "sensor-tdc7200",
    feature = "sensor-tmf8829",
    feature = "sensor-tmf882x",
));

/// The parts of a board that the main loop needs.
pub trait Board {
    /// Milliseconds since the start; after 2³² (49 days) from 0 again.
    fn now_ms(&self) -> u32;

    /// Keeps the watchdog from resetting the board, if it has one: see [`LastFed`].
    fn feed_watchdog(&mut self) {}

    /// Makes the interrupt handler of the serial port run soon, so that it
    /// fetches what there is to send. Never waits; harmless if there is nothing.
    fn start_sending();

    /// Does `work` with interrupts masked.
    fn hold_interrupts(&mut self, work: impl FnOnce(&mut Self));

    /// Sleeps until an interrupt is pending, even a masked one; the timer's comes within a
    /// millisecond. It may return sooner.
    fn sleep(&mut self);
}

/// When a watchdog was fed last. It is fed only while the milliseconds go on: otherwise a host would never time out.
#[derive(Debug, Default)]
pub struct LastFed(u32);

impl LastFed {
    /// Calls `feed` if a millisecond has ended since the last time.
    pub fn at(&mut self, now_ms: u32, feed: impl FnOnce()) {
        if now_ms != self.0 {
            self.0 = now_ms;
            feed();
        }
    }
}

/// One turn of the main loop: `work` gets the port and the time, does what
/// can be done without waiting, and returns whether there is more to do at once. The next turn comes then, or
/// when more has been received, after a millisecond at the latest.
pub fn turn<B: Board>(
    board: &mut B,
    serial: &mut Serial<'_>,
    work: impl FnOnce(&mut Serial<'_>, u32) -> bool,
) {
    let has_more = work(serial, board.now_ms());
    board.feed_watchdog();
    // No byte can come between the check and the sleep.
    board.hold_interrupts(|board| {
        if !has_more && !serial.has_received() {
            board.sleep();
        }
    });
}

/// The work of a turn: the sidecar serves the host and polls the sensor. Returns whether the sensor has
/// more to do at once.
pub fn serve(
    sidecar: &mut Sidecar<'_>,
    sensor: &mut impl Sensor,
    serial: &mut Serial<'_>,
    now_ms: u32,
) -> bool {
    let lost = serial.lost();
    sidecar.set_listening(serial.listens());
    let Ok(()) = sidecar.poll_with(sensor, serial, lost, now_ms);
    sidecar.sensor_has_more()
}

/// Runs a sidecar with room for these pixels and blocks without end. Its report tells the host why
/// the board has started.
// Once in an image. Out of line LLVM calls a function through a register, which `xtask sizes` cannot
// follow.
#[inline(always)]
pub fn run<B: Board>(
    mut board: B,
    mut serial: Serial<'_>,
    reason: ResetReason,
    mut sensor: impl Sensor,
    pixels: &mut VecView<Pixel>,
    blocks: &mut VecView<Block>,
) -> ! {
    let mut sidecar = Sidecar::new(pixels, blocks, Some(sensor.info()));
    sidecar.set_stop_reason(reason.into());
    loop {
        turn(&mut board, &mut serial, |serial, now_ms| {
            serve(&mut sidecar, &mut sensor, serial, now_ms)
        });
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use embedded_io::Read;

    use super::*;
    use crate::serial::Buffers;

    /// Records its calls.
    #[derive(Default)]
    struct Mock {
        now_ms: u32,
        fed: u32,
        slept: Vec<u32>,
    }

    impl Board for Mock {
        fn now_ms(&self) -> u32 {
            self.now_ms
        }

        fn feed_watchdog(&mut self) {
            self.fed += 1;
        }

        fn start_sending() {}

        fn hold_interrupts(&mut self, work: impl FnOnce(&mut Self)) {
            work(self);
            self.now_ms += 1;
        }

        fn sleep(&mut self) {
            self.slept.push(self.now_ms);
        }
    }

    #[test]
    fn sleeps_only_when_everything_is_read_and_always_feeds() {
        let mut buffers = Buffers::<8, 8>::new();
        let (mut interrupt, mut serial) = buffers.split(Mock::start_sending);
        let mut board = Mock::default();
        for byte in 0..3 {
            interrupt.on_receive(byte);
        }
        let mut read = Vec::new();
        for _ in 0..4 {
            turn(&mut board, &mut serial, |serial, now_ms| {
                let mut byte = [0];
                if serial.has_received() {
                    serial.read_exact(&mut byte).unwrap();
                    read.push((now_ms, byte[0]));
                }
                false
            });
        }
        assert_eq!(read, [(0, 0), (1, 1), (2, 2)]);
        assert_eq!(board.slept, [2, 3]);
        assert_eq!(board.fed, 4);
    }

    #[test]
    fn stays_awake_and_feeds_while_there_is_more_to_do() {
        let mut buffers = Buffers::<8, 8>::new();
        let (_, mut serial) = buffers.split(Mock::start_sending);
        let mut board = Mock::default();
        for left in (0..4).rev() {
            turn(&mut board, &mut serial, |_, _| left > 0);
        }
        assert_eq!(board.slept, [3]);
        assert_eq!(board.fed, 4);
    }
}
