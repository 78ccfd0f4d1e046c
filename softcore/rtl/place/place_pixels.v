// The pixel processor for place and route, with a register at every port, so that all
// paths are timed.
module place_pixels #(
    parameter PIXELS_LOG2 = 2
) (
    input             clk,
    input             reset,
    input             photon_valid,
    input      [7:0]  photon_pixel,
    input      [15:0] photon_code,
    input             cycle_end,
    output reg        word_valid,
    output reg [127:0] word,
    input             word_taken,
    input             wb_cyc,
    input             wb_stb,
    input             wb_we,
    input      [7:0]  wb_adr,
    input      [31:0] wb_dat_i,
    output reg [31:0] wb_dat_o,
    output reg        wb_ack
);
    reg in_reset, valid, ends, taken, cyc, stb, we;
    reg [7:0] pixel, adr;
    reg [15:0] code;
    reg [31:0] written;
    wire waits, ack;
    wire [127:0] event_word;
    wire [31:0] read;

    always @(posedge clk) begin
        in_reset <= reset;
        valid <= photon_valid;
        pixel <= photon_pixel;
        code <= photon_code;
        ends <= cycle_end;
        taken <= word_taken;
        cyc <= wb_cyc;
        stb <= wb_stb;
        we <= wb_we;
        adr <= wb_adr;
        written <= wb_dat_i;
        word_valid <= waits;
        word <= event_word;
        wb_dat_o <= read;
        wb_ack <= ack;
    end

    pixel_processor #(.PIXELS_LOG2(PIXELS_LOG2)) pixels (
        .clk(clk),
        .reset(in_reset),
        .photon_valid(valid),
        .photon_pixel(pixel),
        .photon_code(code),
        .cycle_end(ends),
        .word_valid(waits),
        .word(event_word),
        .word_taken(taken),
        .wb_cyc(cyc),
        .wb_stb(stb),
        .wb_we(we),
        .wb_adr(adr),
        .wb_dat_i(written),
        .wb_dat_o(read),
        .wb_ack(ack)
    );
endmodule
