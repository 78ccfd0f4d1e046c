//! How much memory may be asked for at once.

#![allow(unsafe_code, reason = "what an allocator is made of")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::io::{self, Write};

/// Bytes of an allocation.
const MOST: usize = 512 << 20;

/// The allocator of the system. It ends the program if more is asked for, also if that would never be touched.
struct Limited;

#[global_allocator]
static MEMORY: Limited = Limited;

fn check(bytes: usize) {
    if bytes > MOST {
        // Past the test harness, which hides what a test prints.
        let _ = writeln!(io::stderr(), "ERROR: an allocation of {bytes} bytes");
        std::process::abort();
    }
}

// SAFETY: the system does it all.
unsafe impl GlobalAlloc for Limited {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        check(layout.size());
        // SAFETY: the caller promises the same.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        check(layout.size());
        // SAFETY: the caller promises the same.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, bytes: usize) -> *mut u8 {
        check(bytes);
        // SAFETY: the caller promises the same.
        unsafe { System.realloc(memory, layout, bytes) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: the caller promises the same.
        unsafe { System.dealloc(memory, layout) }
    }
}
