# cmake -S bindings/c -B build --toolchain bindings/c/examples/cortex-m4/arm-none-eabi.cmake
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
# There is no library to link a trial program with.
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(DTOF_RUST_TARGET thumbv7em-none-eabihf CACHE STRING "Target of Rust's")
