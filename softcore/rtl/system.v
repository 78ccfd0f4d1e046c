// Everything on one FPGA: VexRiscv with its RAM (computer.v), the pixel processor on its
// data bus at 0xE000_0000 (pixels/), and the AER port (aer_port.v).
//
// Words of the pixel processor and of the program leave by the same port, one whole word
// after another. A stream has one sender: a program that sends events takes them from the
// pixel processor, which then packs none.
//
// The photon pins belong to `clk`, one photon a clock: `photon_cycle_end` is high in the
// clock in which a laser cycle ends, and a photon of that clock still belongs to it.
module system #(
    parameter PIXELS_LOG2 = 2,      // log2 of the macropixels, 1 to 6
    parameter RAM_BITS = 14,        // log2 of the words of RAM
    parameter RAM_FILE = ""
) (
    // Pins.
    input         clk,
    input         reset,            // at any time
    input         photon_valid,
    input  [5:0]  photon_pixel,
    input  [6:0]  photon_code,
    input         photon_cycle_end,
    output        aer_req,
    output [15:0] aer_data,
    output        aer_first,
    input         aer_ack,          // at any time

    // For simulation, see pixel_processor.v and computer.v.
    output        look_begins,
    output        event_leaves,
    output [5:0]  event_pixel,
    output        print_valid,
    output        mark_valid,
    output        exit_valid,
    output [31:0] written,
    output        retired,
    output        fetch_filled,
    output        data_filled,
    output        unmapped
);
    // It is on when the FPGA has been configured.
    (* async_reg = "true", shreg_extract = "no" *)
    reg [2:0] resets = 3'b111;
    wire in_reset = resets[2];
    always @(posedge clk) resets <= {resets[1:0], reset};

    reg        valid, cycle_end;
    reg  [5:0] pixel;
    reg  [6:0] code;
    always @(posedge clk) begin
        valid <= photon_valid;
        pixel <= photon_pixel;
        code <= photon_code;
        cycle_end <= photon_cycle_end;
    end

    wire wb_cyc, wb_stb, wb_we, wb_ack;
    wire [7:0] wb_adr;
    wire [31:0] wb_written, wb_read;
    wire event_valid, word_valid, port_taken;
    wire [127:0] event_word, word;

    computer #(.RAM_BITS(RAM_BITS), .RAM_FILE(RAM_FILE)) computer (
        .clk(clk),
        .reset(in_reset),
        .wb_cyc(wb_cyc),
        .wb_stb(wb_stb),
        .wb_we(wb_we),
        .wb_adr(wb_adr),
        .wb_dat_o(wb_written),
        .wb_dat_i(wb_read),
        .wb_ack(wb_ack),
        .event_valid(event_valid),
        .event_word(event_word),
        .event_taken(port_taken && event_valid),
        .print_valid(print_valid),
        .mark_valid(mark_valid),
        .exit_valid(exit_valid),
        .written(written),
        .retired(retired),
        .fetch_filled(fetch_filled),
        .data_filled(data_filled),
        .unmapped(unmapped)
    );

    pixel_processor #(.PIXELS_LOG2(PIXELS_LOG2)) pixels (
        .clk(clk),
        .reset(in_reset),
        .photon_valid(valid),
        .photon_pixel({2'd0, pixel}),
        .photon_code({9'd0, code}),
        .cycle_end(cycle_end),
        .word_valid(word_valid),
        .word(word),
        .word_taken(port_taken && !event_valid),
        .look_begins(look_begins),
        .event_leaves(event_leaves),
        .event_pixel(event_pixel),
        .wb_cyc(wb_cyc),
        .wb_stb(wb_stb),
        .wb_we(wb_we),
        .wb_adr(wb_adr),
        .wb_dat_i(wb_written),
        .wb_dat_o(wb_read),
        .wb_ack(wb_ack)
    );

    aer_port port (
        .clk(clk),
        .reset(in_reset),
        .word_valid(event_valid || word_valid),
        .word(event_valid ? event_word : word),
        .word_taken(port_taken),
        .aer_req(aer_req),
        .aer_data(aer_data),
        .aer_first(aer_first),
        .aer_ack(aer_ack)
    );
endmodule
