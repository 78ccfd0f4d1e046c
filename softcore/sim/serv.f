-f $SOFTCORE/sim/common.f
$DATA/rtl/serv_aligner.v
$DATA/rtl/serv_alu.v
$DATA/rtl/serv_bufreg.v
$DATA/rtl/serv_bufreg2.v
$DATA/rtl/serv_compdec.v
$DATA/rtl/serv_csr.v
$DATA/rtl/serv_ctrl.v
$DATA/rtl/serv_decode.v
$DATA/rtl/serv_immdec.v
$DATA/rtl/serv_mem_if.v
$DATA/rtl/serv_rf_if.v
$DATA/rtl/serv_rf_ram.v
$DATA/rtl/serv_rf_ram_if.v
$DATA/rtl/serv_rf_top.v
$DATA/rtl/serv_state.v
$DATA/rtl/serv_top.v
$SOFTCORE/rtl/processor_serv.v
