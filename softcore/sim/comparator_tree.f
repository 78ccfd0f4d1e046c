// The comparator tree with its block RAM.
-Wall --cc --exe --build --prefix Vplace_tree --top-module place_tree
--x-assign 0 --x-initial unique
-CFLAGS -std=c++17
$SOFTCORE/rtl/comparator_tree.v
$SOFTCORE/rtl/place/place_tree.v
$SOFTCORE/sim/comparator_tree.cpp
-o sim
