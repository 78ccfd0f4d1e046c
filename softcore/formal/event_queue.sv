// What is put into the queue leaves it once, in order, as long as no more are in it than it has
// places.
module top (
    input       clk,
    input       reset,
    input       put, take,
    input [3:0] in,
    input       marks
);
    wire [3:0] head;
    wire waiting, is_last;
    event_queue #(.DEPTH_LOG2(2), .WIDTH(4)) dut (
        .clk(clk), .reset(reset), .put(put), .in(in), .take(take), .head(head),
        .waiting(waiting), .is_last(is_last)
    );

    // The number of entries; for any entry, its value and the number before it.
    reg [2:0] many, before;
    reg [3:0] one;
    reg is_marked = 0, is_first = 1;
    always @(posedge clk) begin
        is_first <= 0;
        many <= reset ? 3'd0 : many + put - take;
        if (put && marks && !is_marked) begin
            one <= in;
            before <= many - take;
            is_marked <= 1;
        end else if (is_marked && take) begin
            before <= before - 1'b1;
            is_marked <= before != 0;
        end
        if (reset) is_marked <= 0;
    end
    always @* begin
        assume (!is_first || reset);
        if (!is_first) begin
            assume (!take || many != 0);
            assume (!put || many != 4);
            assert (waiting == (many != 0) && is_last == (many == 1));
            if (is_marked && before == 0) assert (waiting && head == one);
        end
    end
endmodule
