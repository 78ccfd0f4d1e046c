// The neighbours of an event are the counts at its look, though photons came since.
//
// From any state in which the event is at the head of the queue. Of `bin_counter` it is known
// that the ended histogram has the counts up to the look and later ones, up to 1536, and the other one
// only the later ones, which are fewer than 512. The settings and `live` of the macropixel stay.
module top (
    input        clk,
    input        found, found_pixel, host_asks,
    input [6:0]  found_bin,
    input [3:0]  found_rest,
    input [4:0]  host_address,
    input        other_live,
    input [87:0] read_word0, read_word1,
    input [8:0]  left_since, right_since
);
    (* anyconst *) wire [0:0] pixel;
    (* anyconst *) wire [6:0] bin;
    (* anyconst *) wire [3:0] rest;
    (* anyconst *) wire is_live;
    (* anyconst *) wire [7:0] gate_first;
    (* anyconst *) wire [7:0] gate_end;
    (* anyconst *) wire [10:0] left;
    (* anyconst *) wire [10:0] right;
    wire [1:0] live = pixel ? {is_live, other_live} : {other_live, is_live};

    wire [4:0] read_address;
    wire put, put_clipped;
    wire [0:0] put_pixel;
    wire [6:0] put_bin;
    wire [3:0] put_rest;
    wire [9:0] put_left, put_right;
    event_reader #(.PIXELS_LOG2(1), .REST(4)) dut (
        .clk(clk), .reset(1'b0), .live(live), .gate_first(gate_first), .gate_end(gate_end),
        .found(found), .found_pixel(found_pixel), .found_bin(found_bin), .found_rest(found_rest),
        .read_address(read_address), .read_word0(read_word0), .read_word1(read_word1),
        .put(put), .put_pixel(put_pixel), .put_bin(put_bin), .put_rest(put_rest),
        .put_left(put_left), .put_right(put_right), .put_clipped(put_clipped),
        .host_asks(host_asks), .host_address(host_address)
    );
    wire waiting;          // probe dut.waiting
    wire is_right;         // probe dut.is_right
    wire [11:0] head;      // probe dut.queue.head

    // Two clocks after its address, the word.
    reg [2:0] clock = 0;
    reg [4:0] asked, asked_before;
    always @(posedge clk) begin
        if (!(&clock)) clock <= clock + 1'b1;
        {asked, asked_before} <= {read_address, asked};
    end
    wire [6:0] left_bin = bin - 7'd1, right_bin = bin + 7'd1;
    wire [87:0] ended = is_live ? read_word0 : read_word1, since = is_live ? read_word1 : read_word0;
    wire [10:0] left_ended, left_now, right_ended, right_now;
    word_bin of_left_ended (.word(ended), .number(left_bin[2:0]), .count(left_ended));
    word_bin of_left_now (.word(since), .number(left_bin[2:0]), .count(left_now));
    word_bin of_right_ended (.word(ended), .number(right_bin[2:0]), .count(right_ended));
    word_bin of_right_now (.word(since), .number(right_bin[2:0]), .count(right_now));
    wire [11:0] left_all = left + left_since, right_all = right + right_since;
    wire has_left = bin != 7'd0 && {1'b0, left_bin} >= gate_first && {1'b0, left_bin} < gate_end;
    wire has_right = bin != 7'd127 && {1'b0, right_bin} >= gate_first && {1'b0, right_bin} < gate_end;
    always @* begin
        assume (gate_end <= 8'd128 && left <= 11'd1536 && right <= 11'd1536);
        if (clock == 0) assume (!is_right);
        // It is not taken in the first clock, and the queue never overflows.
        if (clock <= 1) assume (waiting && head == {pixel, bin, rest});
        if (clock >= 2 && asked_before == {pixel, left_bin[6:3]})
            assume (left_now == left_since && left_ended == (left_all > 1536 ? 1536 : left_all));
        if (clock >= 2 && asked_before == {pixel, right_bin[6:3]})
            assume (right_now == right_since && right_ended == (right_all > 1536 ? 1536 : right_all));
        if (clock == 6) begin
            assert (put && put_pixel == pixel && put_bin == bin && put_rest == rest);
            assert (put_left == (!has_left ? 0 : left > 1023 ? 1023 : left));
            assert (put_right == (!has_right ? 0 : right > 1023 ? 1023 : right));
            assert (put_clipped == !(has_left && has_right));
        end
    end
endmodule
