-f $SOFTCORE/sim/common.f
$DATA/VexRiscv.v
$SOFTCORE/rtl/processor_vexriscv.v
