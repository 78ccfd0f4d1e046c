// What a look needs of a histogram, kept while counting: the highest bin, the maxima of the
// four quadrants, and how many photons came and how many met a full counter.
//
// Of equal bins the lowest is the peak: the key is the count with the inverted bin below it,
// and 0 for an empty histogram.
//
// At a look all macropixels are looked at one after the other, while photons come in. What
// a macropixel had when the look began is kept for it: the first photon after it puts the
// state it finds aside.
module peak_keeper #(
    parameter PIXELS_LOG2 = 2
) (
    input                         clk,
    input                         reset,
    input  [(1<<PIXELS_LOG2)-1:0] live,

    input                         e_valid,
    input                         e_counts,
    input                         e_look,
    input  [PIXELS_LOG2-1:0]      e_pixel,
    input  [6:0]                  e_bin,
    input  [1:0]                  e_quadrant,
    input  [9:0]                  e_count0, e_count1,
    input                         e_full0, e_full1,

    output reg                    scan,       // every photon before the look is in; for one clock
    input  [PIXELS_LOG2-1:0]      scan_pixel,
    // The state at the look, one clock after `scan_pixel`.
    output reg [9:0]              peak_count,
    output reg [6:0]              peak_bin,
    output reg [39:0]             maxima,     // of the quadrants, the first lowest
    output reg [15:0]             photons,    // sticks at 65535
    output reg [23:0]             full        // sticks at 2^24 - 1
);
    localparam PIXELS = 1 << PIXELS_LOG2;
    localparam STATE = 24 + 16 + 40 + 17;

    reg                   f_valid, f_counts, f_look;
    reg [PIXELS_LOG2-1:0] f_pixel;
    reg [6:0]             f_bin;
    reg [3:0]             f_quadrant;
    reg [9:0]             f_count0, f_count1;
    reg                   f_full0, f_full1;

    always @(posedge clk) begin
        f_valid <= e_valid && !reset;
        f_look <= e_look && !reset;
        scan <= f_look && !reset;
        {f_counts, f_pixel, f_bin} <= {e_counts, e_pixel, e_bin};
        f_quadrant <= 4'd1 << e_quadrant;
        {f_count0, f_count1, f_full0, f_full1} <= {e_count0, e_count1, e_full0, e_full1};
    end

    genvar slot, quadrant;
    generate
        for (slot = 0; slot < 2; slot = slot + 1) begin : kept
            // Emptied as the histograms are. `seen` is `valid` when the state is there.
            reg [PIXELS-1:0] valid, seen;
            (* ram_style = "distributed" *)
            reg [STATE-1:0] states [0:PIXELS-1];
            reg [STATE-1:0] f_state;
            wire [STATE-1:0] f_next;
            wire [PIXELS-1:0] valid_after = valid | (e_valid ? {{PIXELS-1{1'b0}}, 1'b1} << e_pixel : 0);
            wire [PIXELS-1:0] seen_after = seen | (f_valid ? {{PIXELS-1{1'b0}}, 1'b1} << f_pixel : 0);

            always @(posedge clk) begin
                if (e_valid) valid[e_pixel] <= 1;
                if (e_look) valid <= slot ? valid_after & live : valid_after & ~live;
                if (f_valid) seen[f_pixel] <= 1;
                if (f_look) seen <= slot ? seen_after & live : seen_after & ~live;
                if (reset) {valid, seen} <= 0;
                f_state <= !valid[e_pixel] ? {STATE{1'b0}}
                    : f_valid && f_pixel == e_pixel ? f_next : states[e_pixel];
                if (f_valid) states[f_pixel] <= f_next;
            end

            wire [9:0] f_count = slot ? f_count1 : f_count0;
            wire f_full = slot ? f_full1 : f_full0;
            wire [16:0] key = {f_count, ~f_bin};
            assign f_next[16:0] = f_counts && key > f_state[16:0] ? key : f_state[16:0];
            for (quadrant = 0; quadrant < 4; quadrant = quadrant + 1) begin : maximum
                wire [9:0] highest = f_state[17+10*quadrant +: 10];
                wire is_higher = f_counts && f_quadrant[quadrant] && f_count > highest;
                assign f_next[17+10*quadrant +: 10] = is_higher ? f_count : highest;
            end
            wire [15:0] came = f_state[72:57];
            assign f_next[72:57] = came + {15'd0, !(&came)};
            wire [23:0] lost = f_state[96:73];
            assign f_next[96:73] = lost + {23'd0, f_counts && f_full && !(&lost)};

            wire [STATE-1:0] looked = seen[scan_pixel] ? states[scan_pixel] : {STATE{1'b0}};
        end
    endgenerate

    // States put aside.
    reg [PIXELS-1:0] is_aside;
    (* ram_style = "distributed" *)
    reg [STATE-1:0] aside [0:PIXELS-1];
    wire [STATE-1:0] f_live = live[f_pixel] ? kept[1].f_state : kept[0].f_state;
    always @(posedge clk) begin
        if (f_valid && !is_aside[f_pixel]) aside[f_pixel] <= f_live;
        if (f_valid) is_aside[f_pixel] <= 1;
        if (f_look) is_aside <= 0;
    end

    wire [STATE-1:0] state = is_aside[scan_pixel] ? aside[scan_pixel]
        : live[scan_pixel] ? kept[1].looked : kept[0].looked;
    always @(posedge clk) begin
        peak_count <= state[16:7];
        peak_bin <= ~state[6:0];
        maxima <= state[56:17];
        photons <= state[72:57];
        full <= state[96:73];
    end
endmodule
