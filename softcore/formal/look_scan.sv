// A macropixel has no second event before its first was taken: the queues, with a place for
// each, never overflow.
module top (
    input        clk,
    input        reset,
    input [15:0] x, l1, l2,
    input        is_one_hit, cycle_end, is_clear, taken, reading,
    input [0:0]  taken_pixel
);
    (* anyconst *) wire [0:0] pixel;
    wire look, found;
    wire [0:0] found_pixel;
    // The photons before a look are in some clocks after it.
    reg [6:0] on_way = 0;
    look_scan #(.PIXELS_LOG2(1)) dut (
        .clk(clk), .reset(reset), .emptied(1'b0), .begins(1'b0), .x(x), .l1(l1), .l2(l2), .is_one_hit(is_one_hit),
        .cycle_end(cycle_end), .look(look), .scan(on_way[6]), .is_clear(is_clear),
        .peak_count(10'd0), .peak_bin(7'd0), .photons(16'd0), .full(24'd0), .background(10'd0),
        .taken(taken), .taken_pixel(taken_pixel), .reading(reading),
        .found(found), .found_pixel(found_pixel)
    );

    reg waits = 0;
    reg [2:0] clock = 0;
    wire is_found = found && found_pixel == pixel, is_taken = taken && taken_pixel == pixel;
    always @(posedge clk) begin
        if (!(&clock)) clock <= clock + 1'b1;
        on_way <= reset ? 7'd0 : {on_way[5:0], look};
        waits <= !reset && (is_found || waits && !is_taken);
    end
    always @* begin
        assume (reset == !(&clock));
        assume (!is_taken || waits);
        if (!reset) assert (!is_found || !waits);
    end
endmodule
