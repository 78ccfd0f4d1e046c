// A counter of one clock and what another clock sees of it: in Gray code one bit changes at a time, so
// it sees a value that the counter has had, two or three clocks ago.
module crossing_counter #(
    parameter WIDTH = 4
) (
    input                  clk,
    input                  reset,
    input                  counts,
    output reg [WIDTH-1:0] count,
    input                  other_clk,
    output reg [WIDTH-1:0] seen
);
    reg [WIDTH-1:0] gray;
    wire [WIDTH-1:0] taken, then_ = count + 1'b1;
    always @(posedge clk) begin
        if (counts) begin
            count <= then_;
            gray <= then_ ^ then_ >> 1;
        end
        if (reset) {count, gray} <= 0;
    end

    synchronizer #(.WIDTH(WIDTH)) of_gray (.clk(other_clk), .in(gray), .out(taken));
    integer place;
    always @* begin
        seen = taken;
        for (place = 1; place < WIDTH; place = place + 1) seen = seen ^ taken >> place;
    end
endmodule
