// The system for place and route: its pins alone. What is for simulation has no reader
// and vanishes.
module place_system #(
    parameter PIXELS_LOG2 = 2,
    parameter RAM_BITS = 14,
    parameter RAM_FILE = ""
) (
    input         clk,
    input         reset,
    input         photon_valid,
    input  [5:0]  photon_pixel,
    input  [6:0]  photon_code,
    input         photon_cycle_end,
    output        aer_req,
    output [15:0] aer_data,
    output        aer_first,
    input         aer_ack
);
    system #(.PIXELS_LOG2(PIXELS_LOG2), .RAM_BITS(RAM_BITS), .RAM_FILE(RAM_FILE)) system (
        .clk(clk),
        .reset(reset),
        .photon_valid(photon_valid),
        .photon_pixel(photon_pixel),
        .photon_code(photon_code),
        .photon_cycle_end(photon_cycle_end),
        .aer_req(aer_req),
        .aer_data(aer_data),
        .aer_first(aer_first),
        .aer_ack(aer_ack),
        .print_valid(),
        .mark_valid(),
        .exit_valid(),
        .written(),
        .retired(),
        .fetch_filled(),
        .data_filled(),
        .unmapped()
    );
endmodule
