// The paper's rule as a pipeline: background, five steps of the square root, alpha times
// the root, comparison. A macropixel a clock, each after nine clocks.
//
// The background is the smaller of the two quadrants' maxima in the half without the peak.
// The peak stands clear if it exceeds background + alpha * root, exact in 1/256 counts, and
// has `minimum` photons. An empty histogram never stands clear.
module decision (
    input             clk,
    input      [15:0] alpha,      // in 1/256
    input      [9:0]  minimum,
    input      [7:0]  middle,     // the first bin of the upper half

    input      [9:0]  peak_count,
    input      [6:0]  peak_bin,
    input      [39:0] maxima,

    output reg [9:0]  background,
    output reg        is_clear
);
    localparam STEPS = 5;

    wire is_upper = {1'b0, peak_bin} >= middle;
    wire [9:0] one = is_upper ? maxima[9:0] : maxima[29:20];
    wire [9:0] other = is_upper ? maxima[19:10] : maxima[39:30];

    // A step brings a bit of the root, from the highest down. Its part of alpha * root is
    // added one clock later.
    reg [9:0]  peak   [0:STEPS+1];
    reg [9:0]  level  [0:STEPS+1];
    reg [9:0]  left   [0:STEPS];
    reg [4:0]  root   [0:STEPS];
    reg [20:0] above  [1:STEPS+1];
    reg        is_enough [0:STEPS+1];
    reg [9:0]  first, second, first_peak;
    reg [18:0] excess;
    reg        is_less;

    // The remainder of a step: negative (bit 10) if the bit is not in the root. The
    // part is (root + bit)^2 - root^2, at most 320.
    wire [10:0] less [0:STEPS-1];
    genvar number;
    generate
        for (number = 0; number < STEPS; number = number + 1) begin : part
            assign less[number] = {1'b0, left[number]}
                - (({5'd0, root[number], 1'b0} + (11'd1 << (STEPS - 1 - number))) << (STEPS - 1 - number));
        end
    endgenerate

    integer step;
    always @(posedge clk) begin
        first <= one;
        second <= other;
        first_peak <= peak_count;

        level[0] <= first < second ? first : second;
        left[0] <= first < second ? first : second;
        root[0] <= 0;
        peak[0] <= first_peak;
        is_enough[0] <= first_peak >= minimum;

        for (step = 0; step < STEPS; step = step + 1) begin
            left[step + 1] <= less[step][10] ? left[step] : less[step][9:0];
            root[step + 1] <= root[step] | (less[step][10] ? 5'd0 : 5'd1 << (STEPS - 1 - step));
        end
        above[1] <= 0;
        for (step = 1; step <= STEPS; step = step + 1)
            above[step + 1] <= above[step]
                + (root[step][STEPS - step] ? {5'd0, alpha} << (STEPS - step) : 21'd0);
        for (step = 0; step < STEPS + 1; step = step + 1) begin
            peak[step + 1] <= peak[step];
            level[step + 1] <= level[step];
            is_enough[step + 1] <= is_enough[step];
        end

        // How far the peak is above the background, in 1/256.
        is_less <= peak[STEPS] <= level[STEPS];
        excess <= {1'b0, peak[STEPS] - level[STEPS], 8'd0};
        is_clear <= is_enough[STEPS + 1] && !is_less && {2'd0, excess} > above[STEPS + 1];
        background <= level[STEPS + 1];
    end
endmodule
