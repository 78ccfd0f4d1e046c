//! Programs that end at once: their sessions end, and with them the lasers.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError, Weak, mpsc};
use std::thread;
use std::time::{Duration, Instant};

use dtof_link::endpoint::Endpoint;
use dtof_link::frame::{Deframer, WIRE_BYTES};

use crate::device::Port;

/// A device that has not heard of the end of its session by then is left to its host timeout.
pub(super) const MOST: Duration = Duration::from_millis(300);
/// The end is sent a second time, after so long: a line may lose the first.
const AGAIN: Duration = Duration::from_millis(20);

/// A port that another thread may end the session on.
pub(super) type Shared = Arc<Mutex<Box<dyn Port>>>;

/// The sessions of this program.
static SESSIONS: Mutex<Vec<Session>> = Mutex::new(Vec::new());

struct Session {
    number: u16,
    port: Weak<Mutex<Box<dyn Port>>>,
}

/// What a panic leaves is whole.
pub(super) fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A session begins, which ends with its port at the latest.
pub(super) fn begin(number: u16, port: &Shared) {
    let mut sessions = lock(&SESSIONS);
    sessions.retain(|session| session.port.strong_count() > 0);
    let port = Arc::downgrade(port);
    sessions.push(Session { number, port });
}

/// Ends all sessions of this program, whatever its other threads do. They send nothing more: the
/// program is to exit next. Takes at most 300 ms, also if a port takes nothing.
pub fn end_sessions() {
    let (done, is_done) = mpsc::channel();
    thread::spawn(move || {
        let until = Instant::now() + MOST;
        for Session { number, port } in std::mem::take(&mut *lock(&SESSIONS)) {
            let Some(port) = port.upgrade() else { continue };
            let Some(mut port) = lock_until(&port, until) else {
                continue;
            };
            let end = end_of(number);
            let sent = port.send(&end);
            thread::sleep(AGAIN);
            // A port that fails is gone, and so is its session.
            let _ = sent.and_then(|()| port.send(&end));
            // It stays locked: no other frame comes after this one.
            std::mem::forget(port);
        }
        let _ = done.send(());
    });
    let _ = is_done.recv_timeout(MOST);
}

fn lock_until<T: ?Sized>(mutex: &Mutex<T>, until: Instant) -> Option<MutexGuard<'_, T>> {
    loop {
        match mutex.try_lock() {
            Ok(guard) => return Some(guard),
            Err(TryLockError::Poisoned(poisoned)) => return Some(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) if Instant::now() < until => {
                thread::sleep(Duration::from_micros(100));
            }
            Err(TryLockError::WouldBlock) => return None,
        }
    }
}

/// The frame that ends a session, which has no number in the sequence: that of a host which has
/// begun the session with a device of its own.
fn end_of(session: u16) -> Vec<u8> {
    let mut host = Endpoint::host(session, [0; _], 0);
    let mut device = Endpoint::device([0; _]);
    carry(&mut host, &mut device);
    carry(&mut device, &mut host);
    host.end(0);
    let mut wire = [0; WIRE_BYTES];
    let length = host.transmit(0, &mut wire);
    wire[..length].to_vec()
}

/// A frame from one end to the other.
fn carry(from: &mut Endpoint, to: &mut Endpoint) {
    let (mut wire, mut deframer) = ([0; WIRE_BYTES], Deframer::new());
    let length = from.transmit(0, &mut wire);
    for &byte in &wire[..length] {
        if let Some(frame) = deframer.push(byte) {
            to.receive(frame, 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_of_its_own_ends_a_session_in_the_middle() {
        let (mut host, mut device) = (Endpoint::host(7, [0; _], 0), Endpoint::device([0; _]));
        carry(&mut host, &mut device);
        carry(&mut device, &mut host);
        for number in 0..9 {
            host.offer(number, &[1, 2]).unwrap();
            carry(&mut host, &mut device);
            assert_eq!(device.take().unwrap().kind, number);
            carry(&mut device, &mut host);
        }
        let mut deframer = Deframer::new();
        for other in [8, 7] {
            assert!(!device.take_ended());
            for byte in end_of(other) {
                if let Some(frame) = deframer.push(byte) {
                    device.receive(frame, 0);
                }
            }
        }
        assert!(device.take_ended() && !device.is_open());
    }
}
