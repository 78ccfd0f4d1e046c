// Each word of either sender leaves by the AER port once, whole and in order, whatever ACK does:
// REQ rises once for each half word, which is there from the clock before and stays until REQ
// has fallen. A receiver that keeps to the four phases takes each half word once. Photons reach
// the pixel processor as they were at the pins, all with the same delay.
//
// Any word at any time, one that is taken back as well; ACK may come and go in any clock, as a
// flip-flop that takes it over makes of any pulse a 0 or a 1.
module top (
    input        clk,
    input        reset,
    input        photon_valid,
    input  [5:0] photon_pixel,
    input  [6:0] photon_code,
    input        photon_cycle_end,
    input        aer_ack
);
    wire aer_req, aer_first;
    wire [15:0] aer_data;
    system #(.PIXELS_LOG2(1), .RAM_BITS(2)) dut (
        .clk(clk), .reset(reset),
        .photon_valid(photon_valid), .photon_pixel(photon_pixel), .photon_code(photon_code),
        .photon_cycle_end(photon_cycle_end),
        .aer_req(aer_req), .aer_data(aer_data), .aer_first(aer_first), .aer_ack(aer_ack)
    );
    wire in_reset;              // probe dut.in_reset
    wire event_valid;           // probe dut.computer.event_valid
    wire [127:0] event_word;    // probe dut.computer.event_word
    wire event_taken;           // probe dut.computer.event_taken
    wire word_valid;            // probe dut.pixels.word_valid
    wire [127:0] word;          // probe dut.pixels.word
    wire word_taken;            // probe dut.pixels.word_taken
    wire [3:0] left;            // probe dut.port.left
    wire [127:0] rest;          // probe dut.port.rest
    wire [1:0] acks;            // probe dut.port.acks

    reg is_first = 1;
    reg [2:0] resets = 0;
    always @(posedge clk) {is_first, resets} <= {1'b0, resets[1:0], reset};
    // It is on when the FPGA has been configured.
    always @* if (is_first) assume (in_reset);
    always @* if (resets[2]) assert (in_reset);

    // The word that leaves, how many of its half words have had their REQ, and how many the
    // receiver has.
    reg [127:0] sent;
    reg [3:0] risen = 8, received = 8;
    reg req_before = 0, ack_before = 0, follows = 0, first_before = 0;
    reg [15:0] data_before = 0;
    wire rises = aer_req && !req_before, falls = !aer_req && req_before;
    wire receives = aer_ack && !ack_before;
    wire [15:0] half = sent >> 16 * risen[2:0];
    wire [15:0] half_received = sent >> 16 * received[2:0];
    wire keeps = aer_ack == ack_before || aer_ack == aer_req;
    wire is_taken = event_taken || word_taken;
    always @(posedge clk) begin
        if (rises) risen <= risen + 1'b1;
        received <= follows ? received + receives : 4'd8;
        {req_before, ack_before, data_before, first_before} <= {aer_req, aer_ack, aer_data, aer_first};
        // From a clock on in which no word leaves, and ACK has been low for long enough.
        follows <= (follows || !aer_ack && acks == 0 && left == 0) && keeps;
        if (is_taken) begin
            sent <= event_taken ? event_word : word;
            {risen, received} <= 0;
        end
        if (in_reset) begin
            {risen, received} <= {4'd8, 4'd8};
            {req_before, follows} <= 0;
        end
    end

    always @* if (!is_first) begin
        assert (!(event_taken && word_taken));
        assert (!event_taken || event_valid);
        assert (!word_taken || word_valid);
        if (is_taken) assert (in_reset || risen == 8 && !aer_req);
        // What the proof knows of the inside.
        assert (acks[0] == ack_before);
        assert (left <= 8 && risen <= 8);
        assert (left == 4'd8 - risen + (aer_req && !rises));
        if (left != 0) assert (rest == sent >> 16 * (4'd8 - left));

        if (rises) assert (risen < 8 && aer_data == half && aer_data == data_before);
        if (rises) assert (aer_first == (risen == 0) && aer_first == first_before);
        if (aer_req && req_before) assert (aer_data == data_before && aer_first == first_before);
        if (follows && keeps) begin
            if (!aer_req) assert (acks[0] <= acks[1] && aer_ack <= acks[0]);
            else assert (acks[1] <= acks[0] && acks[0] <= ack_before);
            assert (received == risen - (aer_req && !rises && !ack_before));
            if (receives) assert (aer_req && received < 8 && aer_data == half_received);
        end
    end

    // Photons.
    wire [7:0] pixel;           // probe dut.pixels.photon_pixel
    wire [15:0] code;           // probe dut.pixels.photon_code
    wire valid;                 // probe dut.pixels.photon_valid
    wire ends;                  // probe dut.pixels.cycle_end
    wire processor_reset;       // probe dut.pixels.reset
    wire computer_reset;        // probe dut.computer.reset
    reg [14:0] photon;
    always @(posedge clk) photon <= {photon_valid, photon_cycle_end, photon_pixel, photon_code};
    always @* if (!is_first) begin
        assert ({valid, ends, pixel[5:0], code[6:0]} == photon);
        assert (pixel[7:6] == 0 && code[15:7] == 0);
        assert (processor_reset == in_reset && computer_reset == in_reset);
    end

    // The registers of the pixel processor, as the bus has them.
    wire [75:0] bus;            // probe dut.computer.bus
    wire [75:0] registers;      // probe dut.pixels.bus
    always @* assert (bus == registers);
endmodule

// Both senders may do anything.
module computer #(parameter RAM_BITS = 2, parameter RAM_FILE = "") (
    input          clk, reset,
    output         wb_cyc, wb_stb, wb_we,
    output [7:0]   wb_adr,
    output [31:0]  wb_dat_o,
    input  [31:0]  wb_dat_i,
    input          wb_ack,
    output         event_valid,
    output [127:0] event_word,
    input          event_taken,
    output         print_valid, mark_valid, exit_valid,
    output [31:0]  written,
    output         retired, fetch_filled, data_filled, unmapped
);
    (* anyseq *) wire [42:0] request;
    (* anyseq *) wire [128:0] event_;
    assign {wb_cyc, wb_stb, wb_we, wb_adr, wb_dat_o} = request;
    assign {event_valid, event_word} = event_;
    wire [75:0] bus = {request, wb_dat_i, wb_ack};
endmodule

module pixel_processor #(parameter PIXELS_LOG2 = 1) (
    input          clk, reset, photon_valid,
    input  [7:0]   photon_pixel,
    input  [15:0]  photon_code,
    input          cycle_end,
    output         word_valid,
    output [127:0] word,
    input          word_taken,
    output         look_begins, event_leaves,
    output [5:0]   event_pixel,
    input          wb_cyc, wb_stb, wb_we,
    input  [7:0]   wb_adr,
    input  [31:0]  wb_dat_i,
    output [31:0]  wb_dat_o,
    output         wb_ack
);
    (* anyseq *) wire [128:0] waiting;
    (* anyseq *) wire [32:0] answer;
    assign {word_valid, word} = waiting;
    assign {wb_dat_o, wb_ack} = answer;
    wire [75:0] bus = {wb_cyc, wb_stb, wb_we, wb_adr, wb_dat_i, answer};
endmodule
