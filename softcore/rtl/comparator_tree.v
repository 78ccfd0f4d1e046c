// The paper's processing channel (section IV-B): a decision about one histogram of 128 bins
// of 10 bits, in two stages that work in parallel. It is reference hardware, the
// circuit to which core/src/detect/comparator_tree.rs is the model.
//
// First stage: all bins are read from a block RAM, whose word has LANES bins. With eight
// lanes bin k of each of the eight groups of 16 lies in word k: one bin of each group a
// clock, 16 clocks. With one lane word k has bin k: 128 clocks. Each group has a comparator
// and keeps its winner. Then the eight winners go through an 8-to-1 comparator tree, one
// level a clock. Its first level gives the four quadrants' maxima. Of equal counts the first
// wins, everywhere.
//
// Second stage: the background is the smaller of the two maxima of the half without the
// peak. Its square root takes five clocks, one bit each. The peak must exceed background +
// alpha * root, and have the least count.
//
// The paper does not state how many bins it reads a clock, how the tree is cut into clocks,
// or how many clocks it takes but for the root.
//
// `start` is high for one clock, 128 / LANES clocks after the last or later. `done` is high
// for one clock, 128 / LANES + 13 clocks after `start`. The results are there from then until
// the next `done`. `alpha` and `least` are to stay until `done`.
module comparator_tree #(
    parameter LANES = 8             // 1 or 8
) (
    input                  clk,
    input                  reset,
    input                  start,
    output reg [READ_BITS-1:0] address, // its word is there one clock later
    input      [10*LANES-1:0] counts, // lane 0 in bits 9..0
    input      [15:0]      alpha,   // in 1/256
    input      [9:0]       least,
    output                 done,
    output reg [6:0]       peak_bin,
    output reg [9:0]       peak_count,
    output reg [39:0]      quadrants, // their maxima, the first in bits 9..0
    output reg [9:0]       background,
    output reg [4:0]       root,    // of the background, rounded down
    output reg             event_found
);
    localparam READ_BITS = LANES == 8 ? 4 : 7;
    localparam ROOT = 3;            // clocks after the groups' winners are known
    localparam END = ROOT + 7;

    // Reading. A word that comes from a block RAM comes late in its clock: a register takes it.
    reg reading, is_sent, is_read;
    reg [READ_BITS-1:0] sent_address, read_address;
    reg [10*LANES-1:0] read;
    wire is_last = is_read && &read_address;
    always @(posedge clk) begin
        if (start) address <= 0;
        else if (reading) address <= address + 1;
        if (start) reading <= 1;
        else if (&address) reading <= 0;
        is_sent <= reading;
        sent_address <= address;
        is_read <= is_sent;
        read_address <= sent_address;
        read <= counts;
        if (reset) {reading, is_sent, is_read} <= 0;
    end

    // The groups' winners: place in the group, count.
    wire [3:0] place = read_address[3:0];
    reg [13:0] winners [0:7];
    genvar g;
    generate for (g = 0; g < 8; g = g + 1) begin : group
        wire [9:0] count = read[10 * (LANES == 8 ? g : 0) +: 10];
        wire is_mine = is_read && (LANES == 8 || read_address >> 4 == g);
        always @(posedge clk)
            if (is_mine && (place == 0 || count > winners[g][9:0])) winners[g] <= {place, count};
    end endgenerate

    // after[n]: n clocks after the winners were complete.
    reg [END:0] after;
    always @(posedge clk) after <= reset ? 0 : {after[END-1:0], is_last};

    // The tree.
    reg [14:0] quarter [0:3];
    reg [15:0] half [0:1];
    reg [9:0] smaller [0:1];        // of each half's two maxima
    reg [39:0] maxima;
    genvar q;
    generate for (q = 0; q < 4; q = q + 1) begin : first_level
        wire [13:0] one = winners[2*q], other = winners[2*q+1];
        always @(posedge clk) quarter[q] <= other[9:0] > one[9:0] ? {1'b1, other} : {1'b0, one};
    end
    for (q = 0; q < 2; q = q + 1) begin : second_level
        wire [14:0] one = quarter[2*q], other = quarter[2*q+1];
        wire is_higher = other[9:0] > one[9:0];
        always @(posedge clk) begin
            half[q] <= is_higher ? {1'b1, other} : {1'b0, one};
            smaller[q] <= is_higher ? one[9:0] : other[9:0];
        end
    end endgenerate
    always @(posedge clk) maxima <= {quarter[3][9:0], quarter[2][9:0], quarter[1][9:0], quarter[0][9:0]};

    // Peak and background, as they are when the second stage begins.
    wire is_upper = half[1][9:0] > half[0][9:0];
    wire [15:0] highest = half[is_upper];
    reg [6:0] bin;
    reg [9:0] count, level;
    reg [39:0] of_quadrants;
    always @(posedge clk) if (after[ROOT-1]) begin
        bin <= {is_upper, highest[15:10]};
        count <= highest[9:0];
        level <= smaller[!is_upper];
        of_quadrants <= maxima;
    end

    // The root: two bits of the background come down each clock, the highest first.
    reg [9:0] bits;
    reg [5:0] remainder;            // at most twice the digits
    reg [4:0] digits;
    wire [7:0] brought = {remainder, bits[9:8]};
    wire [7:0] tried = {1'b0, digits, 2'b01};
    wire fits = brought >= tried;
    wire [5:0] rest = brought[5:0] - (fits ? tried[5:0] : 6'd0);
    always @(posedge clk) if (after[ROOT-1]) begin
        bits <= smaller[!is_upper];
        remainder <= 0;
        digits <= 0;
    end else if (|after[ROOT+4:ROOT]) begin
        bits <= {bits[7:0], 2'b00};
        remainder <= rest;
        digits <= {digits[3:0], fits};
    end

    // The threshold, in 1/256.
    reg [20:0] above;
    always @(posedge clk) above <= alpha * digits;
    always @(posedge clk) if (after[END-1]) begin
        peak_bin <= bin;
        peak_count <= count;
        quadrants <= of_quadrants;
        background <= level;
        root <= digits;
        event_found <= {4'd0, count, 8'd0} > {4'd0, level, 8'd0} + {1'b0, above} && count >= least;
    end
    assign done = after[END];
endmodule
