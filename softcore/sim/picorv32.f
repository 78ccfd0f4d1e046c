-f $SOFTCORE/sim/common.f
$DATA/picorv32.v
$SOFTCORE/rtl/processor_picorv32.v
