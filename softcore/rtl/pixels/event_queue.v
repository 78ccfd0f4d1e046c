// A queue in distributed RAM. It has a place for each macropixel: none is ever missing, as
// a macropixel has no second event before its first was taken.
module event_queue #(
    parameter DEPTH_LOG2 = 2,
    parameter WIDTH = 8
) (
    input              clk,
    input              reset,
    input              put,
    input  [WIDTH-1:0] in,
    input              take,    // only while one waits
    output [WIDTH-1:0] head,
    output             waiting,
    output             is_last  // one waits, and no other
);
    (* ram_style = "distributed" *)
    reg [WIDTH-1:0] places [0:(1 << DEPTH_LOG2) - 1];
    // One bit more than a place's number.
    reg [DEPTH_LOG2:0] first, next;

    assign waiting = first != next;
    assign is_last = next == first + 1'b1;
    assign head = places[first[DEPTH_LOG2-1:0]];

    always @(posedge clk) begin
        if (put) places[next[DEPTH_LOG2-1:0]] <= in;
        if (put) next <= next + 1'b1;
        if (take) first <= first + 1'b1;
        if (reset) begin
            first <= 0;
            next <= 0;
        end
    end
endmodule
