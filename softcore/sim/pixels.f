// The pixel processor alone. PIXELS_LOG2 is given beside this.
-Wall --cc --exe --build --prefix Vpixels --top-module pixel_processor
-O3 --x-assign fast --x-initial unique --noassert
--timescale 1ns/1ps
-MAKEFLAGS OPT_FAST=-O2 -CFLAGS -std=c++17
-y $SOFTCORE/rtl/pixels
$SOFTCORE/rtl/pixels/pixel_processor.v
$SOFTCORE/sim/pixels.cpp
-o sim
