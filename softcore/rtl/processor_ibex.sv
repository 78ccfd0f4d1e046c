// Ibex: two-stage pipeline, RV32IMC, its configuration "small" (multiplication
// in three cycles, no instruction cache) with the register file for FPGAs.
//
// A load or a store takes 2 cycles: RAM answers one cycle after the request.
// Instructions are fetched ahead, one word a cycle, so an addition takes 1.
//
// It starts at 0x80, an offset from its boot address that is fixed.
module processor (
    input         clk,
    input         reset,
    output        fetch_valid,
    output [31:0] fetch_address,
    input         fetch_ready,
    input         fetch_error,
    input  [31:0] fetch_data,
    output        data_valid,
    output [31:0] data_address,
    output [31:0] data_write,
    output [3:0]  data_strobe,
    input         data_ready,
    input         data_error,
    input  [31:0] data_read,
    output        retired,
    output        fetch_filled,
    output        data_filled,
    output        stopped,
    output        unmapped
);
    wire data_we;
    wire [3:0] data_bytes;
    assign data_strobe = data_we ? data_bytes : 4'h0;

    ibex_top #(
        .RegFile(ibex_pkg::RegFileFPGA)
    ) cpu (
        .clk_i(clk),
        .rst_ni(!reset),
        .test_en_i(1'b0),
        .ram_cfg_i('0),
        .hart_id_i(32'h0),
        .boot_addr_i(32'h0),
        .instr_req_o(fetch_valid),
        .instr_gnt_i(fetch_valid),
        .instr_rvalid_i(fetch_ready),
        .instr_addr_o(fetch_address),
        .instr_rdata_i(fetch_data),
        .instr_rdata_intg_i(7'h0),
        .instr_err_i(fetch_error),
        .data_req_o(data_valid),
        .data_gnt_i(data_valid),
        .data_rvalid_i(data_ready),
        .data_we_o(data_we),
        .data_be_o(data_bytes),
        .data_addr_o(data_address),
        .data_wdata_o(data_write),
        .data_wdata_intg_o(),
        .data_rdata_i(data_read),
        .data_rdata_intg_i(7'h0),
        .data_err_i(data_error),
        .irq_software_i(1'b0),
        .irq_timer_i(1'b0),
        .irq_external_i(1'b0),
        .irq_fast_i(15'h0),
        .irq_nm_i(1'b0),
        .scramble_key_valid_i(1'b0),
        .scramble_key_i('0),
        .scramble_nonce_i('0),
        .scramble_req_o(),
        .debug_req_i(1'b0),
        .crash_dump_o(),
        .double_fault_seen_o(),
        .fetch_enable_i(ibex_pkg::IbexMuBiOn),
        .alert_minor_o(),
        .alert_major_internal_o(),
        .alert_major_bus_o(),
        .core_sleep_o(),
        .scan_rst_ni(1'b1)
    );

    assign retired = cpu.u_ibex_core.perf_instr_ret_wb;
    assign fetch_filled = 1'b0;
    assign data_filled = 1'b0;
    assign stopped = 1'b0;
    assign unmapped = 1'b0;
endmodule
