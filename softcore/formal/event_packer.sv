// The packer's offset is the centroid of dtof-core, rounded to the nearest, for all counts with
// left, right <= peak and background < peak. An event's word comes once, after a time word if
// and only if that is due, and stays until it is taken.
//
// It begins in any state, so that the history does not matter.
module top (
    input         clk,
    input         reset,
    input         enabled,
    input         waiting,
    input [127:0] event_word,
    input [9:0]   left, right,
    input [47:0]  cycle_high,
    input         word_taken
);
    wire take, word_valid;
    wire [127:0] word;
    event_packer dut (
        .clk(clk), .reset(reset), .enabled(enabled), .waiting(waiting), .event_word(event_word),
        .left(left), .right(right), .cycle_high(cycle_high), .take(take),
        .word_valid(word_valid), .word(word), .word_taken(word_taken)
    );

    // The event that was taken; the part of the time that was sent last.
    reg [127:0] of_event;
    reg [9:0] l, r;
    reg [47:0] high, sent_high;
    reg is_packing = 0, is_first = 0, is_sent = 0, knows_sent = 0, held = 0;
    reg [127:0] held_word;
    wire is_time = word[63:62] == 2'd0;
    always @(posedge clk) begin
        if (take) begin
            {of_event, l, r, high} <= {event_word, left, right, cycle_high};
            {is_packing, is_first} <= 2'b11;
        end
        if (word_valid && word_taken) begin
            is_first <= 0;
            is_packing <= is_packing && is_time;
            sent_high <= high;
            knows_sent <= is_packing;
            is_sent <= is_packing;
        end
        held <= word_valid && !word_taken && !reset && is_packing;
        held_word <= word;
        if (reset) {is_packing, is_sent, knows_sent} <= 3'b001;
    end

    wire [9:0] peak = event_word[73:64], background = event_word[97:88];
    wire [9:0] p = of_event[73:64], b = of_event[97:88];
    wire [9:0] above_l = l > b ? l - b : 10'd0, above_r = r > b ? r - b : 10'd0;
    wire [11:0] sum = above_l + above_r + (p - b);
    wire [9:0] distance = above_l > above_r ? above_l - above_r : above_r - above_l;
    wire [127:0] packed_word; // probe dut.packed_word
    // The offset is 128 + q or 128 - q.
    wire [9:0] offset = packed_word[121:112];
    wire [9:0] q = above_r >= above_l ? offset - 10'd128 : 10'd128 - offset;
    // 512 * distance + sum is 2 * sum * q and the remainder. As the solver knows nothing of
    // multiplication, the product grows with each bit of q, from the highest down: for each clock
    // of the division it is what was subtracted so far.
    wire [2:0] state;      // probe dut.state
    wire [2:0] step;       // probe dut.step
    wire [20:0] remainder; // probe dut.remainder
    wire [20:0] divisor;   // probe dut.divisor
    wire [6:0] quotient;   // probe dut.quotient
    wire [11:0] dut_sum;   // probe dut.sum
    wire [9:0] dut_distance; // probe dut.distance
    wire dut_is_left;      // probe dut.is_left
    wire [9:0] dut_l;      // probe dut.l
    wire [9:0] dut_r;      // probe dut.r
    wire dut_is_sent;      // probe dut.is_sent
    wire [47:0] dut_sent_high; // probe dut.sent_high
    wire [47:0] dut_high;  // probe dut.high
    wire divides = is_packing && state == 3'd4;
    reg [7:0] bits;
    reg [20:0] product;
    wire [7:0] bits_then = {bits[6:0], remainder >= divisor};
    always @(posedge clk) begin
        if (state == 3'd3) {bits, product} <= 0;
        if (divides) bits <= bits_then;
        if (divides && bits_then[0]) product <= product + ({9'd0, sum} << (8 - step));
    end
    wire [20:0] whole = {2'd0, distance, 9'd0} + sum, least = whole - product;
    always @* begin
        assume (!take || left <= peak && right <= peak && background < peak);
        assume (!take || event_word[63:62] == 2'd1);
        if (held) assert (word_valid && word == held_word);
        if (knows_sent && !(is_packing && word_valid))
            assert (dut_is_sent == is_sent && (!is_sent || dut_sent_high == sent_high));
        if (knows_sent && !is_packing) assert (state == 3'd0);
        if (is_packing) begin
            assert (!take);
            // What the registers hold on the way, which makes the rest true by induction.
            assert (l <= p && r <= p && b < p && of_event[63:62] == 2'd1);
            assert (state != 3'd0 && state != 3'd7 && dut_high == high);
            assert ({packed_word[127:122], packed_word[111:0]} == {of_event[127:122], of_event[111:0]});
            assert (is_first || state == 3'd6);
            if (state == 3'd1) assert (dut_l == l && dut_r == r);
            if (state == 3'd2) assert (dut_l == above_l && dut_r == above_r);
            if (state == 3'd3) assert (step == 0 || !divides);
            if (state == 3'd3 || divides)
                assert (dut_sum == sum && dut_distance == distance && dut_is_left == (above_r < above_l));
            if (divides) begin
                assert (divisor == {9'd0, sum} << (8 - step));
                assert (product <= whole && remainder == least && remainder < 2 * divisor);
                assert (((quotient ^ bits) & ((8'd1 << step) - 8'd1)) == 0);
                assert ((bits >> step) == 0);
                // The highest bit stands alone: the quotient is 128 at most.
                assert (step == 0 || !bits[step - 3'd1] || bits == 8'd1 << (step - 3'd1) && product == {1'd0, sum, 8'd0});
            end
            if (word_valid && is_time) assert (is_first && word == {16'd0, high, 64'd1 << 52});
            if (word_valid && knows_sent && is_first) assert (is_time == !(is_sent && sent_high == high));
            if (word_valid) begin
                assert (is_time ? state == 3'd5 : word == packed_word);
                assert (dut_is_sent && dut_sent_high == high);
                assert (is_first || is_sent && knows_sent && sent_high == high);
                assert (q <= 128);
                assert (q == bits);
                assert (product <= whole && least < {sum, 1'b0});
                assert (is_time || word == {of_event[127:122], offset, of_event[111:0]});
            end
        end
    end
endmodule
