// The wiring of docs/softcore.md, which is included: photons through photon_crossing to a pixel
// processor. Beside it a processor that has the clock of the photons, for comparison.
module two_clocks (
    input             tdc_clk,
    input             tdc_valid,
    input      [7:0]  tdc_pixel,
    input      [15:0] tdc_code,
    input             tdc_cycle_end,

    input             clk,
    input             reset,
    output     [15:0] lost,
    output            end_lost,
    output            word_valid,
    output     [127:0] word,

    // Accesses go to both.
    input             wb_cyc, wb_we,
    input      [7:0]  wb_adr,
    input      [31:0] wb_dat_i,
    output     [31:0] wb_dat_o,
    output            wb_ack,

    input             other_reset,
    output            other_word_valid,
    output     [127:0] other_word,
    output     [31:0] other_dat_o,
    output            other_ack
);
    wire photon_valid, cycle_end;
    wire [7:0] photon_pixel;
    wire [15:0] photon_code;
`include "wiring.v"

    pixel_processor processor (
        .clk(clk), .reset(reset),
        .photon_valid(photon_valid), .photon_pixel(photon_pixel), .photon_code(photon_code), .cycle_end(cycle_end),
        .word_valid(word_valid), .word(word), .word_taken(word_valid),
        .look_begins(), .event_leaves(), .event_pixel(),
        .wb_cyc(wb_cyc), .wb_stb(wb_cyc), .wb_we(wb_we), .wb_adr(wb_adr), .wb_dat_i(wb_dat_i),
        .wb_dat_o(wb_dat_o), .wb_ack(wb_ack)
    );
    pixel_processor other (
        .clk(tdc_clk), .reset(other_reset),
        .photon_valid(tdc_valid), .photon_pixel(tdc_pixel), .photon_code(tdc_code), .cycle_end(tdc_cycle_end),
        .word_valid(other_word_valid), .word(other_word), .word_taken(other_word_valid),
        .look_begins(), .event_leaves(), .event_pixel(),
        .wb_cyc(wb_cyc), .wb_stb(wb_cyc), .wb_we(wb_we), .wb_adr(wb_adr), .wb_dat_i(wb_dat_i),
        .wb_dat_o(other_dat_o), .wb_ack(other_ack)
    );
endmodule
