// Each photon that comes while the processor runs is counted once in COUNTS: in the gate, outside,
// past the last bin, or of a macropixel that there is not. Those of the first two kinds, and no
// other, reach `bin_counter` two clocks later, unless it has been stopped. The end of a laser
// cycle counts once; if a look is due there, it begins or is late, and passes with the photon of
// that clock. What comes while it stands still counts nowhere. It runs again after every
// macropixel has been emptied, and looks are due as from the beginning. Settings are what the bus wrote
// while it stood still, and every bit of what one module gives another arrives there.
//
// Any photon, end and access to the registers in any clock; stop, start and reset at any time.
// `look_scan` and `pixel_registers` are there; the other modules may do anything.
module top (
    input        clk,
    input        reset,
    input        photon_valid,
    input [7:0]  photon_pixel,
    input [15:0] photon_code,
    input        cycle_end,
    input        wb_cyc, wb_stb, wb_we,
    input [7:0]  wb_adr,
    input [31:0] wb_dat_i
);
    wire word_valid;
    wire [127:0] word;
    pixel_processor #(.PIXELS_LOG2(1)) dut (
        .clk(clk), .reset(reset),
        .photon_valid(photon_valid), .photon_pixel(photon_pixel), .photon_code(photon_code),
        .cycle_end(cycle_end), .word_valid(word_valid), .word(word), .word_taken(1'b0),
        .wb_cyc(wb_cyc), .wb_stb(wb_stb), .wb_we(wb_we), .wb_adr(wb_adr), .wb_dat_i(wb_dat_i)
    );
    wire wb_ack;                // probe dut.registers.wb_ack
    wire running;               // probe dut.running
    wire run;                   // probe dut.registers.run
    wire was_running;           // probe dut.registers.was_running
    wire [15:0] x;              // probe dut.registers.x
    wire [7:0] gate_first;      // probe dut.registers.gate_first
    wire [7:0] gate_second;     // probe dut.registers.gate_second
    wire [7:0] gate_middle;     // probe dut.registers.gate_middle
    wire [7:0] gate_fourth;     // probe dut.registers.gate_fourth
    wire [7:0] gate_end;        // probe dut.registers.gate_end
    wire [63:0] cycle;          // probe dut.registers.cycle
    wire [47:0] count0;         // probe dut.registers.happened[0].count
    wire [47:0] count1;         // probe dut.registers.happened[1].count
    wire [47:0] count2;         // probe dut.registers.happened[2].count
    wire [47:0] count3;         // probe dut.registers.happened[3].count
    wire [47:0] count8;         // probe dut.registers.happened[8].count
    wire [47:0] count9;         // probe dut.registers.happened[9].count
    wire a_valid;               // probe dut.counter.a_valid
    wire a_counts;              // probe dut.counter.a_counts
    wire a_look;                // probe dut.counter.a_look
    wire a_pixel;               // probe dut.counter.a_pixel
    wire [6:0] a_bin;           // probe dut.counter.a_bin
    wire [1:0] a_quadrant;      // probe dut.counter.a_quadrant
    wire empties;               // probe dut.counter.reset
    wire [1:0] emptied;         // probe dut.emptied
    wire [15:0] exposure0;      // probe dut.scanner.exposures[0]
    wire [15:0] exposure1;      // probe dut.scanner.exposures[1]
    wire [15:0] until_due;      // probe dut.scanner.until_due
    wire is_next;               // probe dut.scanner.is_next
    wire [1:0] live;            // probe dut.scanner.live
    wire [1:0] requesting;      // probe dut.scanner.requesting
    wire [1:0] is_deferred;     // probe dut.scanner.is_deferred
    wire busy;                  // probe dut.scanner.busy

    // What modules are given, and give.
    wire [6:0] counter_in;      // probe dut.counter.inputs
    wire [210:0] counter_out;   // probe dut.counter.outputs
    wire [37:0] keeper_in;      // probe dut.keeper.inputs
    wire [97:0] keeper_out;     // probe dut.keeper.outputs
    wire [90:0] decision_in;    // probe dut.decision.inputs
    wire [10:0] decision_out;   // probe dut.decision.outputs
    wire [246:0] reader_in;     // probe dut.reader.inputs
    wire [154:0] reader_out;    // probe dut.reader.outputs
    wire [132:0] queue_in;      // probe dut.queue.inputs
    wire [132:0] queue_out;     // probe dut.queue.outputs
    wire [197:0] packer_in;     // probe dut.packer.inputs
    wire [129:0] packer_out;    // probe dut.packer.outputs
    wire keeper_empties;        // probe dut.keeper.reset
    wire reader_empties;        // probe dut.reader.reset
    wire queue_empties;         // probe dut.queue.reset
    wire packer_empties;        // probe dut.packer.reset
    wire scanner_empties;       // probe dut.scanner.reset
    wire [15:0] scan_x;         // probe dut.scanner.x
    wire [15:0] scan_l1;        // probe dut.scanner.l1
    wire [15:0] scan_l2;        // probe dut.scanner.l2
    wire is_one_hit;            // probe dut.scanner.is_one_hit
    wire scan;                  // probe dut.scanner.scan
    wire [9:0] peak_count;      // probe dut.scanner.peak_count
    wire [6:0] peak_bin;        // probe dut.scanner.peak_bin
    wire [15:0] photons;        // probe dut.scanner.photons
    wire [23:0] full;           // probe dut.scanner.full
    wire [9:0] background;      // probe dut.scanner.background
    wire is_clear;              // probe dut.scanner.is_clear
    wire taken;                 // probe dut.scanner.taken
    wire taken_pixel;           // probe dut.scanner.taken_pixel
    wire reading;               // probe dut.scanner.reading
    wire [63:0] scan_cycle;     // probe dut.scanner.scan_cycle
    wire scan_pixel;            // probe dut.scanner.scan_pixel
    wire found;                 // probe dut.scanner.found
    wire found_pixel;           // probe dut.scanner.found_pixel
    wire [9:0] found_count;     // probe dut.scanner.found_count
    wire [6:0] found_bin;       // probe dut.scanner.found_bin
    wire [9:0] found_background;// probe dut.scanner.found_background
    wire [15:0] found_exposure; // probe dut.scanner.found_exposure
    wire found_deferred;        // probe dut.scanner.found_deferred
    wire found_piled_up;        // probe dut.scanner.found_piled_up
    wire [23:0] full_ended;     // probe dut.scanner.full_ended
    wire [63:0] scanned;        // probe dut.scanner.cycle
    wire expired;               // probe dut.scanner.expired
    wire expired_deferred;      // probe dut.scanner.expired_deferred
    wire deferred;              // probe dut.scanner.deferred
    wire [9:0] happens;         // probe dut.registers.happens
    wire event_waiting;         // probe dut.registers.event_waiting
    wire [127:0] event_word;    // probe dut.registers.event_word
    wire [9:0] event_left;      // probe dut.registers.event_left
    wire [9:0] event_right;     // probe dut.registers.event_right
    wire [47:0] event_cycle_high;// probe dut.registers.event_cycle_high
    wire [23:0] registers_full; // probe dut.registers.full_ended
    wire event_take;            // probe dut.registers.event_take
    wire host_asks;             // probe dut.registers.host_asks
    wire [4:0] host_address;    // probe dut.registers.host_address
    wire host_taken;            // probe dut.registers.host_taken
    wire [79:0] host_word;      // probe dut.registers.host_word
    wire packs;                 // probe dut.registers.packs

    // What comes.
    wire comes = photon_valid && running;
    wire [7:0] bin = photon_code[7:0];
    wire strays = photon_pixel >= 8'd2;
    wire is_rejected = photon_code >= 16'd128;
    wire is_gated = bin >= gate_first && bin < gate_end;
    wire [1:0] quadrant = bin < gate_second ? 2'd0 : bin < gate_middle ? 2'd1 : bin < gate_fourth ? 2'd2 : 2'd3;
    wire is_ordered = gate_second <= gate_middle && gate_middle <= gate_fourth;
    wire [3:0] kind = !comes ? 4'd0 : strays ? 4'd8 : is_rejected ? 4'd2 : is_gated ? 4'd1 : 4'd4;

    // A clock later, and two.
    reg is_first = 1, is_second = 0, ran = 0, was_reset = 0, ended = 0, looks = 0, is_late = 0, ended_before = 0;
    reg [3:0] kind1 = 0, kind2 = 0;
    reg [9:0] place1, place2;
    reg [15:0] since;
    reg [47:0] counts [0:3], looked, lates;
    reg [63:0] cycles;
    // COUNTS are of the run that began last, until a reset.
    reg counting = 0;
    wire begins = run && !was_running;
    wire is_due = ended && since + 17'd1 >= x;
    wire begins_look = running && is_due && !busy;
    integer i;
    always @(posedge clk) begin
        {is_first, is_second, was_reset, ran} <= {1'b0, is_first, reset, running && !is_first};
        kind1 <= is_first ? 4'd0 : kind;
        kind2 <= kind1;
        place1 <= {photon_pixel[0], bin[6:0], quadrant};
        place2 <= place1;
        ended <= cycle_end && running && !is_first;
        ended_before <= ended;
        if (ended) since <= begins_look ? 16'd0 : since + !(&since);
        if (!running) since <= 0;
        for (i = 0; i < 4; i = i + 1) counts[i] <= begins ? 48'd0 : counts[i] + kind2[i];
        looked <= begins ? 48'd0 : looked + looks;
        lates <= begins ? 48'd0 : lates + is_late;
        looks <= begins_look;
        is_late <= running && is_due && busy;
        cycles <= begins ? 64'd0 : cycles + ended;
        counting <= (counting || begins) && !reset;
    end

    // The settings that the bus wrote.
    reg [31:0] of_look, of_end, of_rule, of_gate, of_gate_end;
    always @(posedge clk) begin
        if (wb_cyc && wb_stb && wb_we && !wb_ack && !run)
            case (wb_adr)
                8'h01: of_look <= wb_dat_i;
                8'h02: of_end <= wb_dat_i;
                8'h03: of_rule <= wb_dat_i;
                8'h04: of_gate <= wb_dat_i;
                8'h05: of_gate_end <= wb_dat_i;
            endcase
        if (reset) {of_look, of_end, of_rule, of_gate, of_gate_end} <= 0;
    end
    always @* if (!is_first) begin
        assert ({scan_l1, scan_x, is_one_hit, scan_l2} == {of_look, of_end[16:0]});
        assert ({gate_fourth, gate_middle, gate_second, gate_first, gate_end} == {of_gate, of_gate_end[7:0]});
        assert (decision_in == {of_rule[15:0], of_rule[25:16], of_gate[23:16], keeper_out[96:40]});
    end

    // Every bit of what modules give each other.
    wire [130:0] head = queue_out[132:2];
    wire take = event_take || packer_out[129];
    always @* begin
        assert ({keeper_empties, scanner_empties, reader_empties, queue_empties, packer_empties} == {5{!running}});
        assert (counter_in == {live, reader_out[153:149]});
        assert (keeper_in == {live, counter_out[210:176], scan_pixel});
        assert ({scan, peak_count, peak_bin} == keeper_out[97:80] && {photons, full} == keeper_out[39:0]);
        assert ({background, is_clear} == decision_out && reading == reader_out[154]);
        assert ({taken, taken_pixel} == {take, head[0]});
        assert (reader_in == {live, gate_first, gate_end, found, found_pixel, found_bin, found_piled_up, found_deferred,
                              found_exposure, found_background, found_count, counter_out[175:0], host_asks, host_address});
        assert (queue_in == {reader_out[148], scan_cycle, reader_out[81], reader_out[91:82], reader_out[101:92],
                             reader_out[139:102], reader_out[146:140], reader_out[147], take});
        assert ({host_taken, host_word} == reader_out[80:0]);
        assert (packer_in == {packs, queue_out[1], event_word, event_left, event_right, event_cycle_high});
        assert (event_waiting == queue_out[1] && {event_cycle_high, event_word[47:32]} == head[130:67]);
        assert ({event_right, event_left} == head[65:46] && event_word[121:112] == 0);
        assert (event_word[127:122] == {2'd0, head[45:44], head[66], head[17:8] == 10'd1023});
        assert ({event_word[97:88], event_word[73:64]} == head[27:8] && event_word[31:16] == head[43:28]);
        assert ({event_word[58:52], event_word[15:0]} == {head[7:1], 15'd0, head[0]});
        assert (registers_full == full_ended && cycle == scanned);
        assert (happens[7:4] == {expired_deferred, expired, deferred, found});
        assert ({word_valid, word} == packer_out[128:0]);
    end

    always @* begin
        if (is_first) assume (reset);
        if (!is_first && !is_second) begin
            assert (empties == !running);
            assert (!running || run || !was_reset);
            if (counting) begin
                assert (count0 == counts[0] && count1 == counts[1]);
                assert (count2 == counts[2] && count3 == counts[3]);
                assert (count8 == looked && count9 == lates && cycle == cycles);
            end
            assert (a_valid == ((kind2[0] || kind2[2]) && ran));
            assert (a_look == looks && (!a_look || ended_before));
            if (a_valid && !was_reset) begin
                assert (a_counts == kind2[0] && {a_pixel, a_bin} == place2[9:2]);
                if (is_ordered) assert (a_quadrant == place2[1:0]);
            end
            // What the proof knows of the inside.
            assert (emptied <= 2);
            if (!running) assert ((emptied < 1 || exposure0 == 0) && (emptied < 2 || exposure1 == 0));
            if (running) assert (is_next == (since + 17'd1 >= x));
            if (running && !is_next) assert (until_due == x - 16'd1 - since);
            // Nothing is left of the run before.
            if (running && !ran) begin
                assert (!a_valid && !a_look && kind1 == 0 && kind2 == 0);
                assert (exposure0 == 0 && exposure1 == 0);
                assert (live == 0 && requesting == 0 && is_deferred == 0 && !busy);
            end
        end
    end
endmodule

module bin_counter #(parameter PIXELS_LOG2 = 1) (
    input                      clk, reset,
    input  [(1<<PIXELS_LOG2)-1:0] live,
    input                      a_valid, a_counts, a_look,
    input  [PIXELS_LOG2-1:0]   a_pixel,
    input  [6:0]               a_bin,
    input  [1:0]               a_quadrant,
    output                     e_valid, e_counts, e_look,
    output [PIXELS_LOG2-1:0]   e_pixel,
    output [6:0]               e_bin,
    output [1:0]               e_quadrant,
    output [9:0]               e_count0, e_count1,
    output                     e_full0, e_full1,
    input  [PIXELS_LOG2+3:0]   read_address,
    output [87:0]              read_word0, read_word1
);
    wire [6:0] inputs = {live, read_address};
    (* anyseq *) wire [PIXELS_LOG2+209:0] outputs;
    assign {e_valid, e_counts, e_look, e_pixel, e_bin, e_quadrant, e_count0, e_count1, e_full0, e_full1,
            read_word0, read_word1} = outputs;
endmodule

module peak_keeper #(parameter PIXELS_LOG2 = 1) (
    input                    clk, reset,
    input  [(1<<PIXELS_LOG2)-1:0] live,
    input                    e_valid, e_counts, e_look,
    input  [PIXELS_LOG2-1:0] e_pixel,
    input  [6:0]             e_bin,
    input  [1:0]             e_quadrant,
    input  [9:0]             e_count0, e_count1,
    input                    e_full0, e_full1,
    output                   scan,
    input  [PIXELS_LOG2-1:0] scan_pixel,
    output [9:0]             peak_count,
    output [6:0]             peak_bin,
    output [39:0]            maxima,
    output [15:0]            photons,
    output [23:0]            full
);
    wire [37:0] inputs = {live, e_valid, e_counts, e_look, e_pixel, e_bin, e_quadrant, e_count0, e_count1, e_full0,
                          e_full1, scan_pixel};
    (* anyseq *) wire [97:0] outputs;
    assign {scan, peak_count, peak_bin, maxima, photons, full} = outputs;
endmodule

module decision (
    input         clk,
    input  [15:0] alpha,
    input  [9:0]  minimum,
    input  [7:0]  middle,
    input  [9:0]  peak_count,
    input  [6:0]  peak_bin,
    input  [39:0] maxima,
    output [9:0]  background,
    output        is_clear
);
    wire [90:0] inputs = {alpha, minimum, middle, peak_count, peak_bin, maxima};
    (* anyseq *) wire [10:0] outputs;
    assign {background, is_clear} = outputs;
endmodule

module event_reader #(parameter PIXELS_LOG2 = 1, parameter REST = 38) (
    input                    clk, reset,
    input  [(1<<PIXELS_LOG2)-1:0] live,
    input  [7:0]             gate_first, gate_end,
    input                    found,
    input  [PIXELS_LOG2-1:0] found_pixel,
    input  [6:0]             found_bin,
    input  [REST-1:0]        found_rest,
    output                   reading,
    output [PIXELS_LOG2+3:0] read_address,
    input  [87:0]            read_word0, read_word1,
    output                   put,
    output [PIXELS_LOG2-1:0] put_pixel,
    output [6:0]             put_bin,
    output [REST-1:0]        put_rest,
    output [9:0]             put_left, put_right,
    output                   put_clipped,
    input                    host_asks,
    input  [PIXELS_LOG2+3:0] host_address,
    output                   host_taken,
    output [79:0]            host_word
);
    wire [REST+208:0] inputs = {live, gate_first, gate_end, found, found_pixel, found_bin, found_rest, read_word0, read_word1,
                                host_asks, host_address};
    (* anyseq *) wire [2*PIXELS_LOG2+REST+114:0] outputs;
    assign {reading, read_address, put, put_pixel, put_bin, put_rest, put_left, put_right, put_clipped,
            host_taken, host_word} = outputs;
endmodule

module event_queue #(parameter DEPTH_LOG2 = 1, parameter WIDTH = 8) (
    input              clk, reset, put,
    input  [WIDTH-1:0] in,
    input              take,
    output [WIDTH-1:0] head,
    output             waiting, is_last
);
    wire [WIDTH+1:0] inputs = {put, in, take};
    (* anyseq *) wire [WIDTH+1:0] outputs;
    assign {head, waiting, is_last} = outputs;
endmodule

module event_packer (
    input          clk, reset, enabled, waiting,
    input  [127:0] event_word,
    input  [9:0]   left, right,
    input  [47:0]  cycle_high,
    output         take, word_valid,
    output [127:0] word,
    input          word_taken
);
    wire [197:0] inputs = {enabled, waiting, event_word, left, right, cycle_high};
    (* anyseq *) wire [129:0] outputs;
    assign {take, word_valid, word} = outputs;
endmodule
