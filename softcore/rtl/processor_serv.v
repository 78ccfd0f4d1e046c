// SERV: bit-serial, RV32I. Two simple buses, of which one is in use at a time.
//
// RAM answers in the second cycle of an access. An addition takes 36 cycles with its
// fetch, a load or a store 70. It does not detect illegal instructions: those do
// something else. It has no bus errors: an access where nothing is mapped stops
// the run.
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
    wire fetch_cyc, data_cyc, data_we;
    wire [3:0] data_bytes;
    assign fetch_valid = fetch_cyc && !fetch_ready;
    assign data_valid = data_cyc && !data_ready;
    assign data_strobe = data_we ? data_bytes : 4'h0;

    serv_rf_top cpu (
        .clk(clk),
        .i_rst(reset),
        .i_timer_irq(1'b0),
        .o_ibus_adr(fetch_address),
        .o_ibus_cyc(fetch_cyc),
        .i_ibus_rdt(fetch_data),
        .i_ibus_ack(fetch_ready),
        .o_dbus_adr(data_address),
        .o_dbus_dat(data_write),
        .o_dbus_sel(data_bytes),
        .o_dbus_we(data_we),
        .o_dbus_cyc(data_cyc),
        .i_dbus_rdt(data_read),
        .i_dbus_ack(data_ready),
        .o_ext_rs1(),
        .o_ext_rs2(),
        .o_ext_funct3(),
        .i_ext_rd(32'h0),
        .i_ext_ready(1'b0),
        .o_mdu_valid()
    );

    // It fetches nothing that it does not execute.
    assign retired = fetch_ready;
    assign fetch_filled = 1'b0;
    assign data_filled = 1'b0;
    assign stopped = 1'b0;
    assign unmapped = fetch_error || data_error;
endmodule
