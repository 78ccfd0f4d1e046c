-f $SOFTCORE/sim/common.f
+incdir+$DATA/vendor/lowrisc_ip/ip/prim/rtl
+incdir+$DATA/vendor/lowrisc_ip/dv/sv/dv_utils
+define+SYNTHESIS
$DATA/dv/uvm/core_ibex/common/prim/prim_pkg.sv
$DATA/vendor/lowrisc_ip/ip/prim/rtl/prim_ram_1p_pkg.sv
$DATA/vendor/lowrisc_ip/ip/prim/rtl/prim_secded_pkg.sv
$DATA/rtl/ibex_pkg.sv
$DATA/vendor/lowrisc_ip/ip/prim/rtl/prim_count_pkg.sv
$DATA/vendor/lowrisc_ip/ip/prim/rtl/prim_util_pkg.sv
$DATA/vendor/lowrisc_ip/ip/prim/rtl/prim_cipher_pkg.sv
$DATA/vendor/lowrisc_ip/ip/prim/rtl/prim_mubi_pkg.sv
-y $DATA/dv/uvm/core_ibex/common/prim
-y $DATA/vendor/lowrisc_ip/ip/prim/rtl
-y $DATA/vendor/lowrisc_ip/ip/prim_generic/rtl
-y $DATA/rtl
$DATA/rtl/ibex_top.sv
$SOFTCORE/rtl/processor_ibex.sv
