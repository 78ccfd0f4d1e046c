// VexRiscv with its RAM for place and route, with a register at every port, so that all
// paths are timed.
module place_processor #(
    parameter RAM_BITS = 14,
    parameter RAM_FILE = ""
) (
    input              clk,
    input              reset,
    output reg         wb_cyc,
    output reg         wb_we,
    output reg  [7:0]  wb_adr,
    output reg  [31:0] wb_dat_o,
    input       [31:0] wb_dat_i,
    input              wb_ack,
    output reg         event_valid,
    output reg [127:0] event_word,
    input              event_taken
);
    reg in_reset, ack, taken;
    reg [31:0] read;
    wire cyc, we, event_out;
    wire [7:0] adr;
    wire [31:0] written;
    wire [127:0] word;

    always @(posedge clk) begin
        in_reset <= reset;
        read <= wb_dat_i;
        ack <= wb_ack;
        taken <= event_taken;
        wb_cyc <= cyc;
        wb_we <= we;
        wb_adr <= adr;
        wb_dat_o <= written;
        event_valid <= event_out;
        event_word <= word;
    end

    computer #(.RAM_BITS(RAM_BITS), .RAM_FILE(RAM_FILE)) computer (
        .clk(clk),
        .reset(in_reset),
        .wb_cyc(cyc),
        .wb_stb(),
        .wb_we(we),
        .wb_adr(adr),
        .wb_dat_o(written),
        .wb_dat_i(read),
        .wb_ack(ack),
        .event_valid(event_out),
        .event_word(word),
        .event_taken(taken),
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
