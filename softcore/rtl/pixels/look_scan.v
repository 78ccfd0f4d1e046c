// When to look, and what a look brings: the flow chart of the paper's section II-B, as
// `AsyncPixel` of dtof-core has it.
//
// A look is due at the end of a laser cycle once X have passed since the last look. It
// begins there unless the last one is still under way; then it begins at a later end, and
// each end that had to go without is counted as late. All macropixels are looked at, one a
// clock.
//
// The exposure N counts laser cycles at looks. N <= L1 is too early. N >= L2 ends the
// exposure without an event. While the last event of a macropixel waits, the decision is put
// off. An event that is taken before the clock in which a look begins no longer waits.
module look_scan #(
    parameter PIXELS_LOG2 = 2
) (
    input                              clk,
    input                              reset,     // for as many clocks as there are macropixels,
    input      [PIXELS_LOG2-1:0]       emptied,   // which macropixel it is in this clock
    input                              begins,    // laser cycles are counted from 0
    input      [15:0]                  x,
    input      [15:0]                  l1,
    input      [15:0]                  l2,
    input                              is_one_hit,

    input                              cycle_end,
    output                             look,      // one begins with this end
    output                             late,      // one is due, and does not begin
    output reg [63:0]                  cycle,     // laser cycles that have ended
    output reg [63:0]                  scan_cycle, // the number of the one that ended before the scan

    // What was kept of each macropixel, one clock after `scan_pixel`.
    input                              scan,
    output reg [PIXELS_LOG2-1:0]       scan_pixel,
    input      [9:0]                   peak_count,
    input      [6:0]                   peak_bin,
    input      [15:0]                  photons,
    input      [23:0]                  full,
    // What the decision pipeline makes of it, nine clocks later.
    input      [9:0]                   background,
    input                              is_clear,

    input                              taken,
    input      [PIXELS_LOG2-1:0]       taken_pixel,
    input                              reading,   // more than one event has its bins to be read

    output reg [(1<<PIXELS_LOG2)-1:0]  live,

    // An event was found.
    output reg                         found,
    output reg [PIXELS_LOG2-1:0]       found_pixel,
    output reg [9:0]                   found_count,
    output reg [6:0]                   found_bin,
    output reg [9:0]                   found_background,
    output reg [15:0]                  found_exposure,
    output reg                         found_deferred,
    output reg                         found_piled_up,

    // For the statistics.
    output reg                         expired,
    output reg                         expired_deferred,
    output reg                         deferred,
    output reg [23:0]                  full_ended // photons that met a full counter, of an exposure that ended
);
    localparam PIXELS = 1 << PIXELS_LOG2;
    localparam LATENCY = 10;

    // When.
    reg [15:0] since_look, passed, until_due;
    reg [63:0] look_cycle;
    reg busy, is_scanned, is_next;
    wire [15:0] since = since_look + {15'd0, !(&since_look)};
    wire is_due = cycle_end && is_next;
    assign look = is_due && !busy && !reset;
    assign late = is_due && busy && !reset;

    reg [PIXELS-1:0] requesting, requesting_at_look, is_deferred;
    reg scanning;
    wire scans = scan || scanning;
    wire is_last = &scan_pixel;

    always @(posedge clk) begin
        if (cycle_end) cycle <= cycle + 1'b1;
        if (cycle_end) since_look <= look ? 16'd0 : since;
        // The next end is due once X - 1 have passed.
        if (look || reset) begin
            until_due <= x - 16'd1;
            is_next <= x <= 16'd1;
        end else if (cycle_end && !is_next) begin
            until_due <= until_due - 1'b1;
            is_next <= until_due == 16'd1;
        end
        if (look) begin
            passed <= since;
            look_cycle <= cycle;
            requesting_at_look <= requesting;
            busy <= 1;
        end
        if (scan) begin
            scanning <= 1;
            scan_cycle <= look_cycle;
        end
        if (scans) scan_pixel <= scan_pixel + 1'b1;
        if (scans && is_last) scanning <= 0;
        // The next look empties the spare histograms two clocks later at the earliest. The last
        // event's bins are read by then.
        if (is_scanned && !found && !reading) begin
            busy <= 0;
            is_scanned <= 0;
        end
        if (o_valid && &o_pixel) is_scanned <= 1;
        if (begins) cycle <= 0;
        if (reset) begin
            since_look <= 0;
            busy <= 0;
            is_scanned <= 0;
            scanning <= 0;
            scan_pixel <= 0;
        end
    end

    // The rest of what was kept waits for the decision in a ring.
    localparam REST = 24 + 16 + 7 + 10;
    (* ram_style = "distributed" *)
    reg [REST-1:0] ring [0:15];
    reg [3:0] now;
    wire [3:0] then_ = now - (LATENCY - 3);
    reg [LATENCY-1:0] on_way;
    reg [REST-1:0] rest;
    always @(posedge clk) begin
        now <= now + 1'b1;
        ring[now] <= {full, photons, peak_bin, peak_count};
        rest <= ring[then_];
        on_way <= {on_way[LATENCY-2:0], scans};
        if (reset) begin
            now <= 0;
            on_way <= 0;
        end
    end

    // The exposures, two clocks before the decision is there.
    (* ram_style = "distributed" *)
    reg [15:0] exposures [0:PIXELS-1];
    reg [PIXELS_LOG2-1:0] n_pixel, o_pixel;
    reg [15:0] exposure, o_exposure;
    wire [16:0] sum = {1'b0, exposures[n_pixel]} + {1'b0, passed};
    wire o_valid = on_way[LATENCY-1];
    reg is_early, is_long, is_piled_up;
    reg [9:0] o_count;
    reg [6:0] o_bin;
    reg [23:0] o_full;
    always @(posedge clk) begin
        if (on_way[LATENCY-3]) n_pixel <= n_pixel + 1'b1;
        exposure <= sum[15:0] | {16{sum[16]}};
        o_exposure <= exposure;
        is_early <= exposure <= l1;
        is_long <= exposure >= l2;
        is_piled_up <= is_one_hit && {rest[32:17], 1'b0} > {1'b0, exposure};
        {o_full, o_bin, o_count} <= {rest[56:33], rest[16:0]};
        if (o_valid) o_pixel <= o_pixel + 1'b1;
        if (reset) begin
            n_pixel <= 0;
            o_pixel <= 0;
        end
    end

    // What comes of it.
    wire acts = o_valid && !is_early;
    wire waits = requesting_at_look[o_pixel];
    wire fires = acts && !is_long && !waits && is_clear;
    wire ends = acts && is_long || fires;
    // In reset all exposures are set to 0 in turn.
    always @(posedge clk)
        if (o_valid || reset) exposures[reset ? emptied : o_pixel] <= ends || reset ? 16'd0 : o_exposure;

    always @(posedge clk) begin
        if (ends) live[o_pixel] <= !live[o_pixel];
        if (acts) is_deferred[o_pixel] <= !ends && (waits || is_deferred[o_pixel]);
        if (taken) requesting[taken_pixel] <= 0;
        if (fires) requesting[o_pixel] <= 1;

        found <= fires && !reset;
        found_pixel <= o_pixel;
        found_count <= o_count;
        found_bin <= o_bin;
        found_background <= background;
        found_exposure <= o_exposure;
        found_deferred <= is_deferred[o_pixel];
        found_piled_up <= is_piled_up;

        expired <= acts && is_long;
        expired_deferred <= acts && is_long && is_deferred[o_pixel];
        deferred <= acts && !is_long && waits;
        full_ended <= ends ? o_full : 24'd0;
        if (reset) begin
            live <= 0;
            requesting <= 0;
            is_deferred <= 0;
            expired <= 0;
            expired_deferred <= 0;
            deferred <= 0;
            full_ended <= 0;
        end
    end
endmodule
