// VexRiscv, its RAM, the pixel processor and the AER port: softcore/rtl/system.v.
-Wall --cc --exe --build --prefix Vsystem --top-module system
-O3 --x-assign fast --x-initial unique --noassert
--timescale 1ns/1ps
-MAKEFLAGS OPT_FAST=-O2 -CFLAGS -std=c++17
$SOFTCORE/sim/lint.vlt
-y $SOFTCORE/rtl
-y $SOFTCORE/rtl/pixels
$DATA/VexRiscv.v
$SOFTCORE/rtl/processor_vexriscv.v
$SOFTCORE/rtl/system.v
$SOFTCORE/sim/system.cpp
-o sim
