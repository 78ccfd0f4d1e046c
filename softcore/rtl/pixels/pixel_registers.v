// The registers of the pixel processor: Wishbone, whole words, an answer in the next clock.
//
// Addresses in words
//   0x00 CONTROL    bit 0 run: 0 empties everything but COUNTS; bit 1: events leave packed
//                   (else the program takes them); bit 2, read: photons count
//   0x01 LOOK       L1 in 31..16, X in 15..0
//   0x02 END        bit 16: the TDC takes one hit a laser cycle; L2 in 15..0
//   0x03 RULE       fewest photons of a peak in 25..16, alpha in 1/256 in 15..0
//   0x04 GATE       first bins of the four quadrants of the gate, the first in 7..0
//   0x05 GATE_END   one past the last bin of the gate
//   0x06 SIZE       read: macropixels
//   0x08 WAITING    read: bit 0, an event waits; write: takes it
//   0x09 EVENT      read: the AER word of the event that waits, in four words, offset 0;
//                   then right neighbour in 25..16, left one in 9..0; laser cycle 47..16 and
//                   63..48
//   0x30 HISTOGRAM  write: macropixel in 9..4, part of eight bins in 3..0, to be read;
//                   read: bit 0 it is not there yet
//   0x31 BINS       read: four words of two bins each, the lower in 15..0
//   0x40 COUNTS     read: two words each, the low one first, which holds the high one:
//                   photons in the gate; of these, of exposures that ended, those that met a
//                   full counter; photons past the last bin; outside the gate; of macropixels
//                   that there are not; events; decisions put off; exposures without an
//                   event; of these, those with a decision put off; looks; laser cycles at
//                   whose end a look was due but one was under way; laser cycles
// While `run` is 1, settings are not written, nor bit 1 of CONTROL. COUNTS restart when it
// rises, and have 48 bits, laser cycles 64. Of an exposure 2^24 - 1 photons in full counters
// count.
module pixel_registers #(
    parameter PIXELS_LOG2 = 2
) (
    input              clk,
    input              reset,
    input              wb_cyc, wb_stb, wb_we,
    input      [7:0]   wb_adr,
    input      [31:0]  wb_dat_i,
    output reg [31:0]  wb_dat_o,
    output reg         wb_ack,

    input              running,
    output reg         run, packs, is_one_hit,
    output             begins,         // `run` has risen
    output reg [15:0]  x, l1, l2, alpha,
    output reg [9:0]   minimum,
    output reg [7:0]   gate_first, gate_second, gate_middle, gate_fourth, gate_end,

    input              event_waiting,
    output             event_take,
    input      [127:0] event_word,
    input      [9:0]   event_left, event_right,
    input      [47:0]  event_cycle_high,

    // What happens in a clock, the order of COUNTS but for full counters.
    input      [9:0]   happens,
    input      [23:0]  full_ended,
    input      [63:0]  cycle,

    output reg         host_asks,
    output reg [PIXELS_LOG2+3:0] host_address,
    input              host_taken,
    input      [79:0]  host_word
);
    localparam KINDS = 10, BITS = 48;

    wire access = wb_cyc && wb_stb && !wb_ack;
    wire write = access && wb_we;
    wire read = access && !wb_we;

    // A counter each. They restart when `run` rises.
    reg was_running;
    assign begins = reset || run && !was_running;
    wire [KINDS*BITS-1:0] counts;
    reg [BITS-1:0] full;
    genvar kind;
    generate
        for (kind = 0; kind < KINDS; kind = kind + 1) begin : happened
            reg [BITS-1:0] count;
            always @(posedge clk)
                if (begins) count <= 0;
                else if (happens[kind]) count <= count + 1'b1;
            assign counts[BITS*kind +: BITS] = count;
        end
    endgenerate
    always @(posedge clk) begin
        was_running <= run;
        if (begins) full <= 0;
        else full <= full + {{BITS-24{1'b0}}, full_ended};
    end

    // What is read of the counts, a clock before it is needed. Reading the low word holds
    // the high one.
    reg [63:0] chosen;
    reg [31:0] high;
    integer place;
    always @* begin
        chosen = cycle;
        if (wb_adr[4:1] == 4'd0) chosen = {16'd0, counts[BITS-1:0]};
        if (wb_adr[4:1] == 4'd1) chosen = {16'd0, full};
        for (place = 1; place < KINDS; place = place + 1)
            if ({28'd0, wb_adr[4:1]} == place + 1) chosen = {16'd0, counts[BITS*place +: BITS]};
    end

    reg [1:0] host_on_way;
    reg host_comes, host_waits;
    reg [79:0] eight;

    assign event_take = write && wb_adr == 8'h08 && event_waiting && !packs;

    always @(posedge clk) begin
        wb_ack <= access && !reset;
        if (write && wb_adr == 8'h00) run <= wb_dat_i[0];
        if (write && !run)
            case (wb_adr)
                8'h00: packs <= wb_dat_i[1];
                8'h01: {l1, x} <= wb_dat_i;
                8'h02: {is_one_hit, l2} <= wb_dat_i[16:0];
                8'h03: {minimum, alpha} <= wb_dat_i[25:0];
                8'h04: {gate_fourth, gate_middle, gate_second, gate_first} <= wb_dat_i;
                8'h05: gate_end <= wb_dat_i[7:0];
                default: ;
            endcase

        host_on_way <= {host_on_way[0], host_taken};
        host_comes <= host_on_way[1];
        if (host_taken) host_asks <= 0;
        if (host_comes) begin
            eight <= host_word;
            host_waits <= 0;
        end
        if (write && wb_adr == 8'h30) begin
            host_address <= wb_dat_i[PIXELS_LOG2+3:0];
            host_asks <= 1;
            host_waits <= 1;
            // Earlier requests are dropped.
            host_on_way <= 0;
            host_comes <= 0;
        end

        if (read && wb_adr[7:5] == 3'd2 && !wb_adr[0]) high <= chosen[63:32];
        casez (wb_adr)
            8'h00: wb_dat_o <= {29'd0, running, packs, run};
            8'h01: wb_dat_o <= {l1, x};
            8'h02: wb_dat_o <= {15'd0, is_one_hit, l2};
            8'h03: wb_dat_o <= {6'd0, minimum, alpha};
            8'h04: wb_dat_o <= {gate_fourth, gate_middle, gate_second, gate_first};
            8'h05: wb_dat_o <= {24'd0, gate_end};
            8'h06: wb_dat_o <= 32'd1 << PIXELS_LOG2;
            8'h08: wb_dat_o <= {31'd0, event_waiting && !packs};
            8'h09: wb_dat_o <= event_word[31:0];
            8'h0a: wb_dat_o <= event_word[63:32];
            8'h0b: wb_dat_o <= event_word[95:64];
            8'h0c: wb_dat_o <= event_word[127:96];
            8'h0d: wb_dat_o <= {6'd0, event_right, 6'd0, event_left};
            8'h0e: wb_dat_o <= event_cycle_high[31:0];
            8'h0f: wb_dat_o <= {16'd0, event_cycle_high[47:32]};
            8'h30: wb_dat_o <= {31'd0, host_waits};
            8'h31: wb_dat_o <= {6'd0, eight[19:10], 6'd0, eight[9:0]};
            8'h32: wb_dat_o <= {6'd0, eight[39:30], 6'd0, eight[29:20]};
            8'h33: wb_dat_o <= {6'd0, eight[59:50], 6'd0, eight[49:40]};
            8'h34: wb_dat_o <= {6'd0, eight[79:70], 6'd0, eight[69:60]};
            8'b010?_???0: wb_dat_o <= chosen[31:0];
            8'b010?_???1: wb_dat_o <= high;
            default: wb_dat_o <= 0;
        endcase
        if (reset) begin
            {packs, run, is_one_hit} <= 0;
            {x, l1, l2, alpha, minimum} <= 0;
            {gate_first, gate_second, gate_middle, gate_fourth, gate_end} <= 0;
            host_asks <= 0;
            host_on_way <= 0;
            host_comes <= 0;
            host_waits <= 0;
        end
    end
endmodule
