//! The platform of the examples: a line of output, and without an operating system an
//! entry and a panic handler.

/// Prints a line; does nothing without an operating system.
#[cfg(not(target_os = "none"))]
macro_rules! print_line {
    ($($text:tt)*) => { println!($($text)*) };
}

#[cfg(target_os = "none")]
macro_rules! print_line {
    ($($text:tt)*) => {{ core::hint::black_box(format_args!($($text)*)); }};
}

#[cfg(target_os = "none")]
#[allow(unsafe_code, reason = "the linker knows the start by this name")]
#[unsafe(no_mangle)]
extern "C" fn _start() -> ! {
    crate::main();
    loop {
        core::hint::spin_loop();
    }
}

#[cfg(target_os = "none")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {
        core::hint::spin_loop();
    }
}
