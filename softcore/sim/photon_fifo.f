// The photon FIFO alone, of 8 places, against a model.
-Wall --cc --exe --build --prefix Vphoton_fifo --top-module photon_fifo
-GDEPTH_LOG2=3
--x-assign 0 --x-initial unique
-CFLAGS -std=c++17
$SOFTCORE/rtl/photon_fifo.v
$SOFTCORE/sim/photon_fifo.cpp
-o sim
