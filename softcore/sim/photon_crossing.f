// The photons' queue between two clocks.
-Wall --cc --exe --build --prefix Vphoton_crossing --top-module photon_crossing
--x-assign 0 --x-initial unique
-CFLAGS -std=c++17
$SOFTCORE/rtl/synchronizer.v
$SOFTCORE/rtl/crossing_counter.v
$SOFTCORE/rtl/photon_crossing.v
$SOFTCORE/sim/photon_crossing.cpp
-o sim
