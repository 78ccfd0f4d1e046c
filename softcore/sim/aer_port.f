// The AER port alone, with a receiver.
-Wall --cc --exe --build --prefix Vaer_port --top-module aer_port
--x-assign 0 --x-initial unique
-CFLAGS -std=c++17
$SOFTCORE/rtl/aer_port.v
$SOFTCORE/sim/aer_port.cpp
-o sim
