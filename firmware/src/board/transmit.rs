//! Sending, as the interrupt handlers of all boards do it.
//!
//! No byte is left in the queue without an interrupt to come: either the transmitter interrupts
//! once it has room, or the queue was empty, and the code that fills it calls
//! [`Board::start_sending`](super::Board::start_sending) afterwards. `tests/wake_ups.rs` tries
//! every order of events.

use crate::serial::SerialInterrupt;

/// The sending half of a serial port.
pub trait Transmitter {
    /// Clears its interrupt, if that stays until it is cleared. Room that comes from now on
    /// interrupts again.
    fn acknowledge(&mut self);
    /// Whether it takes a byte now.
    fn has_room(&mut self) -> bool;
    /// Takes a byte, for which there is room.
    fn send(&mut self, byte: u8);
    /// It has no room: it is to interrupt once it has.
    fn wake(&mut self);
    /// There is nothing to send: it need not interrupt.
    fn rest(&mut self);
}

/// Hands over what there is to send and what the transmitter takes. For the interrupt handler.
#[inline]
pub fn transmit(port: &mut SerialInterrupt<'_>, transmitter: &mut impl Transmitter) {
    // First: room that comes while this goes on is not to be overlooked.
    transmitter.acknowledge();
    while port.has_to_send() {
        if !transmitter.has_room() {
            return transmitter.wake();
        }
        if let Some(byte) = port.next_to_send() {
            transmitter.send(byte);
        }
    }
    transmitter.rest();
}
