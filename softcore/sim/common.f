// Flags and files common to all processors. SOFTCORE is the absolute path of
// softcore/, DATA that of the data of the processor's Python package.
-Wall --cc --exe --build --prefix Vsoc --top-module soc
-O3 --x-assign 0 --x-initial unique --noassert
--timescale 1ns/1ps
-MAKEFLAGS OPT_FAST=-O2 -CFLAGS -std=c++17
$SOFTCORE/sim/lint.vlt
$SOFTCORE/rtl/photon_fifo.v
$SOFTCORE/rtl/soc.v
$SOFTCORE/sim/main.cpp
-o sim
