//! Work of minutes, on all processors.

use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

/// Does `job` with each of `numbers`, in any order.
pub fn for_each(numbers: u64, job: impl Fn(u64) + Sync) {
    let next = AtomicU64::new(0);
    let work = || {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= numbers {
                break;
            }
            job(number);
        }
    };
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(work);
        }
    });
}
