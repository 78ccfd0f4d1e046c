// Of photons in one clock each comes out once in the other, as it was, after as many ends of laser
// cycles as were before it, or is counted as lost. No end is lost unless `end_lost` says so. If
// one of the clocks stops, the other side sees all that was done after three clocks. A reset ends
// after three clocks of the photons at most.
//
// Two clocks: any two, with edges at any time. Reset at any time, as long as it has to be.
// two clocks
module top (
    input       photon_clk,
    input       photon_valid,
    input [0:0] photon,
    input       photon_cycle_end,
    input       clk,
    input       resets, marks
);
    // A reset lasts for four clocks of the photons and then as many of the processor.
    reg in_reset = 1, photon_clk_before = 1, clk_before = 1;
    reg [2:0] photon_clocks = 0, clocks = 0;
    wire photon_ticks = photon_clk && !photon_clk_before, ticks = clk && !clk_before;
    wire may_end = photon_clocks == 4 && clocks == 4;
    always @($global_clock) begin
        {photon_clk_before, clk_before} <= {photon_clk, clk};
        if (!in_reset) {photon_clocks, clocks} <= 0;
        else if (photon_clocks != 4) photon_clocks <= photon_clocks + photon_ticks;
        else if (clocks != 4) clocks <= clocks + ticks;
    end
    always @(posedge clk) in_reset <= resets || in_reset && !may_end;

    wire valid, crossed, cycle_end, end_lost;
    wire [1:0] lost;
    photon_crossing #(.WIDTH(1), .DEPTH_LOG2(2), .PENDING_BITS(2), .LOST_BITS(2)) dut (
        .photon_clk(photon_clk), .photon_valid(photon_valid), .photon(photon),
        .photon_cycle_end(photon_cycle_end), .clk(clk), .reset(in_reset), .valid(valid),
        .crossed(crossed), .cycle_end(cycle_end), .lost(lost), .end_lost(end_lost)
    );
    wire photon_reset;          // probe dut.photon_reset
    wire loses;                 // probe dut.losing.counts
    wire end_is_lost;           // probe dut.end_is_lost
    wire [1:0] pending;            // probe dut.pending
    wire waiting;               // probe dut.waiting
    wire [2:0] next;            // probe dut.next
    wire [2:0] next_gray;       // probe dut.putting.gray
    wire [2:0] next_before;     // probe dut.putting.of_gray.before
    wire [2:0] next_taken;      // probe dut.putting.of_gray.taken
    wire [2:0] next_out;        // probe dut.putting.of_gray.out
    wire [2:0] first;           // probe dut.first
    wire [2:0] first_gray;      // probe dut.taking.gray
    wire [2:0] first_before;    // probe dut.taking.of_gray.before
    wire [2:0] first_taken;     // probe dut.taking.of_gray.taken
    wire [2:0] first_out;       // probe dut.taking.of_gray.out
    wire [1:0] lost_here;       // probe dut.losing.count
    wire [1:0] lost_gray;       // probe dut.losing.gray
    wire [1:0] lost_before;     // probe dut.losing.of_gray.before
    wire [1:0] lost_taken;      // probe dut.losing.of_gray.taken
    wire end_before;            // probe dut.of_end_lost.before
    wire end_taken;             // probe dut.of_end_lost.taken
    wire reset_before;          // probe dut.of_reset.before
    wire reset_taken;           // probe dut.of_reset.taken
    wire [2:0] entry0;          // probe dut.entries[0]
    wire [2:0] entry1;          // probe dut.entries[1]
    wire [2:0] entry2;          // probe dut.entries[2]
    wire [2:0] entry3;          // probe dut.entries[3]
    wire [11:0] entries = {entry3, entry2, entry1, entry0};

    // What came in, and one photon of all.
    reg [3:0] photons, ends, photons_before, ends_before;
    reg [2:0] at;
    reg [1:0] one;
    reg is_marked;
    wire is_taken = photon_valid && !loses;
    reg [1:0] losses;
    always @(posedge photon_clk) begin
        photons <= photons + is_taken;
        ends <= ends + photon_cycle_end;
        losses <= losses + loses;
        if (is_taken && marks && !is_marked) begin
            {is_marked, one} <= {1'b1, photon_cycle_end, photon};
            {photons_before, ends_before, at} <= {photons, ends, next};
        end
        if (photon_reset) {photons, ends, losses, is_marked} <= 0;
    end

    // What came out.
    reg [3:0] photons_out, ends_out;
    reg is_out, is_leaving, was_waiting;
    wire is_one = is_marked && !is_out && valid && photons_out == photons_before;
    always @(posedge clk) begin
        photons_out <= photons_out + valid;
        ends_out <= ends_out + cycle_end;
        is_out <= is_out || is_one;
        is_leaving <= is_marked && !is_out && waiting && first == at;
        was_waiting <= waiting;
        if (in_reset) {photons_out, ends_out, is_out, is_leaving, was_waiting} <= 0;
    end

    // Clocks of the photons since a reset.
    reg [1:0] free = 0;
    always @($global_clock) free <= in_reset ? 2'd0 : free + (photon_ticks && !(&free));

    // Clocks of each since the other had one.
    reg [1:0] alone = 0, photon_alone = 0;
    always @($global_clock) begin
        alone <= photon_ticks ? 2'd0 : alone + (ticks && !(&alone));
        photon_alone <= ticks ? 2'd0 : photon_alone + (photon_ticks && !(&photon_alone));
    end

    // What each side knows of the other, in order.
    function [2:0] binary(input [2:0] gray);
        binary = gray ^ gray >> 1 ^ gray >> 2;
    endfunction
    wire [2:0] has_0 = binary(next_out) - first, has_1 = binary(next_taken) - first;
    wire [2:0] has_2 = binary(next_before) - first, fill = next - first;
    wire [2:0] room_1 = next - binary(first_before), room_2 = next - binary(first_taken), room_3 = next - binary(first_out);
    wire knows_next = has_0 <= has_1 && has_1 <= has_2 && has_2 <= fill && fill - has_2 <= 1 && fill <= 4;
    wire knows_first = fill <= room_1 && room_1 <= room_2 && room_2 <= room_3 && room_1 - fill <= 1 && room_3 <= 4;

    wire [2:0] ahead = at - first;
    reg [3:0] photons_there, ends_there, photons_ahead, ends_ahead;
    reg is_empty;
    integer entry;
    always @* begin
        {photons_there, ends_there, photons_ahead, ends_ahead, is_empty} = 0;
        for (entry = 0; entry < 4; entry = entry + 1) begin
            if (((entry - first) & 3) < fill) begin
                photons_there = photons_there + entries[3 * entry + 1];
                ends_there = ends_there + entries[3 * entry + 2];
                is_empty = is_empty || !entries[3 * entry + 1] && !entries[3 * entry + 2];
            end
            if (((entry - first) & 3) < ahead) begin
                photons_ahead = photons_ahead + entries[3 * entry + 1];
                ends_ahead = ends_ahead + entries[3 * entry + 2];
            end
        end
    end
    wire [2:0] entry_at = entries >> 3 * at[1:0];

    always @* if (!in_reset) begin
        // Each is on its way until it is out.
        assert (photons - photons_out == photons_there + valid);
        assert (end_is_lost || ends - ends_out == ends_there + pending + cycle_end);
        if (is_one) assert ({cycle_end, crossed} == one && (end_is_lost || ends_out == ends_before));
        assert (losses == lost_here);
        // What is seen to wait comes out, and nothing is lost while there is room.
        assert (waiting == (has_0 != 0) && (valid || cycle_end) == was_waiting && !is_empty);
        if (alone == 3 && !photon_ticks)
            assert (next_out == next_gray && lost == lost_here && end_lost == end_is_lost);
        if (photon_alone == 3 && !ticks) assert (first_out == first_gray);
        // What the proof knows of the inside.
        assert (knows_next);
        if (is_marked && !is_out && !is_leaving) begin
            assert (ahead < fill && entry_at == {one[1], 1'b1, one[0]});
            assert (photons_before - photons_out == photons_ahead + valid);
            assert (end_is_lost || ends_before - ends_out == ends_ahead + cycle_end);
        end
        assert (!is_leaving || is_one && first == at + 3'd1);
        assert (next_gray == (next ^ next >> 1) && first_gray == (first ^ first >> 1));
        assert (lost_gray == (lost_here ^ lost_here >> 1));
        if (alone >= 1 && !photon_ticks)
            assert (next_before == next_gray && lost_before == lost_gray && end_before == end_is_lost);
        if (alone >= 2 && !photon_ticks)
            assert (next_taken == next_gray && lost_taken == lost_gray && end_taken == end_is_lost);
        if (photon_alone >= 1 && !ticks) assert (first_before == first_gray);
        if (photon_alone >= 2 && !ticks) assert (first_taken == first_gray);
        // The photons' side is in reset a little longer.
        assert (reset_taken <= photon_reset);
        if (free >= 1) assert (!reset_before);
        if (free >= 2) assert (!reset_taken);
        if (free >= 3) assert (!photon_reset);
        if (!photon_reset) assert (knows_first && (!loses || room_3 == 4 || pending != 0));
        else begin
            assert ({next, next_before, next_taken, next_out, first, first_before} == 0);
            assert ({pending, photons, photons_out, ends, ends_out, losses, is_marked, end_is_lost} == 0);
            assert ({lost_here, valid, cycle_end, was_waiting} == 0);
            if (!reset_taken) assert (first_taken == 0);
        end
    end else begin
        // What a reset has done so far.
        if (photon_clocks >= 1) assert (reset_before);
        if (photon_clocks >= 2) assert (reset_taken);
        if (photon_clocks >= 3) assert (photon_reset);
        if (photon_clocks >= 4)
            assert ({next, next_gray, pending, end_is_lost, lost_here, lost_gray, photons, ends, losses, is_marked} == 0);
        if (clocks >= 1) begin
            assert ({first, first_gray, valid, cycle_end, photons_out, ends_out, is_out, is_leaving, was_waiting} == 0);
            assert ({next_before, lost_before, end_before} == 0);
        end
        if (clocks >= 2) assert ({next_taken, lost_taken, end_taken, first_before} == 0);
        if (clocks >= 3) assert ({next_out, end_lost, lost} == 0);
        assert (clocks == 0 || photon_clocks == 4);
    end
endmodule
