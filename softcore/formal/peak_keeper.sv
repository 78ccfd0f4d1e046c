// What a look shows of a macropixel is its histogram when the look passed: no bin is higher
// than the peak, no equal one lower, and the peak's bin has that count; no bin is higher than
// the maximum of its quadrant; photons and full counters are all counted.
//
// Any macropixel, any bin of any quadrant; photons and looks in any clock. Of `bin_counter` it
// is known that the bin's count grows with each photon, up to 1023. Of `look_scan` it is known
// that `live` stays while a look passes. A scan reads in any order and lasts until the next
// look passes; a macropixel is shown in it until its `live` changes.
module top (
    input        clk,
    input        reset,
    input  [1:0] live,
    input        e_valid, e_counts, e_look,
    input  [0:0] e_pixel,
    input  [6:0] e_bin,
    input  [1:0] e_quadrant,
    input  [9:0] e_count0, e_count1,
    input        e_full0, e_full1,
    input  [0:0] scan_pixel
);
    (* anyconst *) wire [0:0] pixel;
    (* anyconst *) wire [6:0] bin;
    (* anyconst *) wire [1:0] quadrant;

    wire scan;
    wire [9:0] peak_count;
    wire [6:0] peak_bin;
    wire [39:0] maxima;
    wire [15:0] photons;
    wire [23:0] full;
    peak_keeper #(.PIXELS_LOG2(1)) dut (
        .clk(clk), .reset(reset), .live(live),
        .e_valid(e_valid), .e_counts(e_counts), .e_look(e_look), .e_pixel(e_pixel),
        .e_bin(e_bin), .e_quadrant(e_quadrant), .e_count0(e_count0), .e_count1(e_count1),
        .e_full0(e_full0), .e_full1(e_full1),
        .scan(scan), .scan_pixel(scan_pixel), .peak_count(peak_count), .peak_bin(peak_bin),
        .maxima(maxima), .photons(photons), .full(full)
    );

    reg is_first = 1;
    always @(posedge clk) is_first <= 0;
    always @* if (is_first) assume (reset);

    // The look passes E and then F.
    wire lives = live[pixel];
    reg look = 0, passed = 0, lived;
    always @(posedge clk) begin
        look <= e_look && !reset;
        passed <= look && !reset;
        lived <= lives;
    end
    always @* begin
        if (look) assume (lives == lived);
        if (!is_first) assert (scan == passed);
    end

    // The photon in E, and in F a clock later.
    wire is_mine = e_valid && e_pixel == pixel;
    wire counts = is_mine && e_counts;
    wire is_of_bin = counts && e_bin == bin;
    always @* if (is_of_bin) assume (e_quadrant == quadrant);
    reg mine = 0, of_quadrant = 0;
    reg [9:0] counted0, counted1;
    always @(posedge clk) begin
        mine <= is_mine && !reset;
        of_quadrant <= counts && e_quadrant == quadrant;
        {counted1, counted0} <= {e_count1, e_count0};
    end
    wire [9:0] e_count [0:1];
    assign {e_count[1], e_count[0]} = {e_count1, e_count0};
    wire [1:0] e_full = {e_full1, e_full0};

    // The invariant: `kept` is the state after the photon that was in F.
    wire [1:0] valid0;        // probe dut.kept[0].valid
    wire [1:0] valid1;        // probe dut.kept[1].valid
    wire [1:0] seen0;         // probe dut.kept[0].seen
    wire [1:0] seen1;         // probe dut.kept[1].seen
    wire [96:0] states00;     // probe dut.kept[0].states[0]
    wire [96:0] states01;     // probe dut.kept[0].states[1]
    wire [96:0] states10;     // probe dut.kept[1].states[0]
    wire [96:0] states11;     // probe dut.kept[1].states[1]
    wire [96:0] found0;       // probe dut.kept[0].f_state
    wire [96:0] found1;       // probe dut.kept[1].f_state
    wire [1:0] is_aside;      // probe dut.is_aside
    wire [96:0] aside0;       // probe dut.aside[0]
    wire [96:0] aside1;       // probe dut.aside[1]
    wire [1:0] valid = {valid1[pixel], valid0[pixel]}, seen = {seen1[pixel], seen0[pixel]};
    wire [96:0] states [0:1], found [0:1], kept [0:1];
    assign states[0] = pixel ? states01 : states00;
    assign states[1] = pixel ? states11 : states10;
    assign {found[1], found[0]} = {found1, found0};
    assign kept[0] = seen[0] ? states[0] : 97'd0;
    assign kept[1] = seen[1] ? states[1] : 97'd0;

    // The histogram since it was emptied: whether the bin has photons, its last count, all
    // photons, full counters.
    wire [50:0] histograms [0:1];
    genvar slot;
    generate
        for (slot = 0; slot < 2; slot = slot + 1) begin : histogram
            reg has, has_then;
            reg [9:0] last, last_then;
            reg [15:0] came, came_then;
            reg [23:0] lost, lost_then;
            wire is_spare = lives != slot;
            wire emptied = reset || e_look && is_spare;
            always @(posedge clk) begin
                if (is_of_bin) {has, last} <= {1'b1, e_count[slot]};
                if (is_mine && came != 16'd65535) came <= came + 1'b1;
                if (counts && e_full[slot] && lost != 24'hffffff) lost <= lost + 1'b1;
                if (emptied) {has, last, came, lost} <= 0;
                {has_then, last_then, came_then, lost_then} <= reset ? 51'd0 : {has, last, came, lost};
            end
            always @* if (is_of_bin) assume (e_count[slot] > last || &e_count[slot]);
            assign histograms[slot] = {has, last, came, lost};

            wire [9:0] highest = kept[slot][17+10*quadrant +: 10];
            reg [9:0] highest_before;
            reg may_rise = 0, was_emptied = 0;
            reg [9:0] rise;
            always @(posedge clk) begin
                highest_before <= highest;
                may_rise <= mine && of_quadrant && !is_first;
                rise <= slot ? counted1 : counted0;
                was_emptied <= reset || look && is_spare;
            end

            always @* if (!is_first) begin
                assert (has ? last != 0 : last == 0);
                assert (has_then ? last_then != 0 : last_then == 0);
                // The peak, the maximum, which is that of a photon, the numbers.
                if (has_then) assert (kept[slot][16:0] >= {last_then, ~bin});
                if (kept[slot][16:7] != 0 && kept[slot][6:0] == ~bin)
                    assert (has_then && kept[slot][16:7] == last_then);
                assert (highest >= last_then);
                if (was_emptied) assert (kept[slot] == 0);
                else if (highest != highest_before) assert (may_rise && highest == rise);
                assert (kept[slot][72:57] == came_then && kept[slot][96:73] == lost_then);
                // What a photon in F finds.
                if (mine) assert (found[slot] == kept[slot] && (valid[slot] || look));
                if (!(look && is_spare)) assert (valid[slot] == (seen[slot] || mine));
                else assert (!valid[slot]);
            end
        end
    endgenerate

    // What a look has to show from the clock after it passed F on: what was kept then, and the
    // histogram then.
    reg shows = 0, live_then, has, is_output = 0;
    reg [9:0] last;
    reg [15:0] came;
    reg [23:0] lost;
    reg [96:0] kept_then, output_then;
    wire [96:0] shown = scan ? kept[lives] : kept_then;
    wire is_shown = shows && lives == live_then;
    wire [9:0] highest = shown[17+10*quadrant +: 10];
    always @(posedge clk) begin
        shows <= (look || is_shown) && !reset;
        if (look) begin
            live_then <= lives;
            {has, last, came, lost} <= histograms[lives];
        end
        kept_then <= shown;
        is_output <= is_shown && scan_pixel == pixel && !reset;
        output_then <= shown;
    end
    wire [96:0] aside = pixel ? aside1 : aside0;
    always @* if (!is_first) begin
        if (is_shown) begin
            assert ((is_aside[pixel] ? aside : kept[lives]) == shown);
            if (has) assert (shown[16:0] >= {last, ~bin});
            if (shown[16:7] != 0 && shown[6:0] == ~bin) assert (has && shown[16:7] == last);
            assert (highest >= last);
            assert (shown[72:57] == came && shown[96:73] == lost);
        end
        if (is_output) assert ({full, photons, maxima, peak_count, ~peak_bin} == output_then);
    end
endmodule
