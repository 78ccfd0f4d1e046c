// The decision is the paper's formula, for all inputs: proved from any state, so that the
// clocks before do not matter.
module top (
    input        clk,
    input [15:0] alpha,
    input [9:0]  minimum,
    input [7:0]  middle,
    input [9:0]  peak_count,
    input [6:0]  peak_bin,
    input [39:0] maxima
);
    // As in look_scan, which counts on it.
    localparam LATENCY = 9;

    wire [9:0] background;
    wire is_clear;
    decision dut (
        .clk(clk), .alpha(alpha), .minimum(minimum), .middle(middle),
        .peak_count(peak_count), .peak_bin(peak_bin), .maxima(maxima),
        .background(background), .is_clear(is_clear)
    );

    // Settings stay while the processor runs.
    reg [3:0] clock = 0;
    reg [15:0] settled_alpha;
    reg [9:0] settled_minimum;
    reg [7:0] settled_middle;
    // What came LATENCY clocks ago.
    reg [56:0] came [0:LATENCY-1];
    integer stage;
    always @(posedge clk) begin
        if (clock != LATENCY + 1) clock <= clock + 1'b1;
        settled_alpha <= alpha;
        settled_minimum <= minimum;
        settled_middle <= middle;
        came[0] <= {peak_count, peak_bin, maxima};
        for (stage = 1; stage < LATENCY; stage = stage + 1) came[stage] <= came[stage - 1];
    end

    wire [9:0] count, lowest, low, high;
    wire [6:0] bin;
    wire [9:0] of [0:3];
    assign {count, bin, of[3], of[2], of[1], of[0]} = came[LATENCY-1];
    wire is_upper = bin >= middle;
    wire [9:0] one = is_upper ? of[0] : of[2];
    wire [9:0] other = is_upper ? of[1] : of[3];
    wire [9:0] level = one < other ? one : other;

    // The root, by trial.
    reg [11:0] root;
    integer trial;
    always @* begin
        root = 0;
        for (trial = 1; trial < 32; trial = trial + 1)
            if (trial * trial <= level) root = trial;
    end
    wire [31:0] above = 32'd256 * level + alpha * root;
    wire expected = 32'd256 * count > above && count >= minimum;

    always @(posedge clk) begin
        if (clock != 0) begin
            assume (alpha == settled_alpha);
            assume (minimum == settled_minimum);
            assume (middle == settled_middle);
        end
        if (clock == LATENCY) begin
            assert (background == level);
            assert (is_clear == expected);
            assert (root * root <= level && (root + 12'd1) * (root + 12'd1) > level);
        end
    end
endmodule
