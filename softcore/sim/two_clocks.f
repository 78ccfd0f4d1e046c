// Photons from one clock to a pixel processor of another. DATA is the folder of the wiring.
-Wall --cc --exe --build --prefix Vtwo_clocks --top-module two_clocks
-Wno-PINCONNECTEMPTY
-O3 --x-assign fast --x-initial unique --noassert
--timescale 1ns/1ps
-MAKEFLAGS OPT_FAST=-O2 -CFLAGS -std=c++17
-I$DATA
-y $SOFTCORE/rtl
-y $SOFTCORE/rtl/pixels
$SOFTCORE/sim/two_clocks.v
$SOFTCORE/sim/two_clocks.cpp
-o sim
