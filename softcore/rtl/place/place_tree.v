// The comparator tree with the block RAM it reads, for simulation and for place and route,
// with a register at every port of the tree, so that all paths are timed. One bin a clock is
// written.
module place_tree #(
    parameter LANES = 8
) (
    input             clk,
    input             reset,
    input             write,
    input      [6:0]  write_bin,
    input      [9:0]  write_count,
    input             start,
    input      [15:0] alpha,
    input      [9:0]  least,
    output reg        done,
    output reg [6:0]  peak_bin,
    output reg [9:0]  peak_count,
    output reg [39:0] quadrants,
    output reg [9:0]  background,
    output reg [4:0]  root,
    output reg        event_found
);
    localparam READ_BITS = LANES == 8 ? 4 : 7;

    reg in_reset, do_write, do_start;
    reg [6:0] bin;
    reg [9:0] count, least_count;
    reg [15:0] factor;
    always @(posedge clk) begin
        in_reset <= reset;
        do_write <= write;
        bin <= write_bin;
        count <= write_count;
        do_start <= start;
        factor <= alpha;
        least_count <= least;
    end

    // A block RAM a lane: bins are written one at a time.
    wire [READ_BITS-1:0] address;
    wire [10*LANES-1:0] counts;
    genvar lane;
    generate for (lane = 0; lane < LANES; lane = lane + 1) begin : of_lane
        (* no_rw_check, ram_style = "block" *) reg [9:0] memory [0:128/LANES-1];
        reg [9:0] read;
        assign counts[10*lane +: 10] = read;
        always @(posedge clk) begin
            read <= memory[address];
            if (do_write && (LANES == 1 || {25'd0, bin} >> READ_BITS == lane)) memory[bin[READ_BITS-1:0]] <= count;
        end
    end endgenerate

    wire found;
    wire [6:0] of_bin;
    wire [9:0] of_count, of_background;
    wire [39:0] of_quadrants;
    wire [4:0] of_root;
    wire fires;
    comparator_tree #(.LANES(LANES)) tree (
        .clk(clk),
        .reset(in_reset),
        .start(do_start),
        .address(address),
        .counts(counts),
        .alpha(factor),
        .least(least_count),
        .done(found),
        .peak_bin(of_bin),
        .peak_count(of_count),
        .quadrants(of_quadrants),
        .background(of_background),
        .root(of_root),
        .event_found(fires)
    );
    always @(posedge clk) begin
        done <= found;
        peak_bin <= of_bin;
        peak_count <= of_count;
        quadrants <= of_quadrants;
        background <= of_background;
        root <= of_root;
        event_found <= fires;
    end
endmodule
