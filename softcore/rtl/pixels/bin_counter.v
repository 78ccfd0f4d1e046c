// The histograms: a photon a clock, of any macropixel.
//
// Each macropixel has two histograms of 128 bins. Every photon counts in both. The live one
// is that of the exposure. The spare one is emptied at each look, so that it holds the
// photons since then: what the next exposure begins with, should the look bring an event.
// Then the two change their parts (`live`), and counting never stops.
//
// Eight bins make a word. A word is empty until its valid bit is set, and one clock takes
// all those bits away. A bin has 11 bits and counts to 1536. Its count is 1023 at most; the
// rest separates the photons after a look, as long as they are fewer than 512.
//
// A photon takes four clocks: A reads the words, B takes what is still on its way to them,
// C counts, D writes.
module bin_counter #(
    parameter PIXELS_LOG2 = 2
) (
    input                        clk,
    input                        reset,
    input  [(1<<PIXELS_LOG2)-1:0] live,      // which of the two is live

    // A photon. `a_look`: a look follows it. `a_counts`: it is in the gate.
    input                        a_valid,
    input                        a_counts,
    input                        a_look,
    input  [PIXELS_LOG2-1:0]     a_pixel,
    input  [6:0]                 a_bin,
    input  [1:0]                 a_quadrant,

    // The same a clock after its words were written, with the counts of its bin in both
    // histograms, and whether that was full.
    output reg                   e_valid,
    output reg                   e_counts,
    output reg                   e_look,
    output reg [PIXELS_LOG2-1:0] e_pixel,
    output reg [6:0]             e_bin,
    output reg [1:0]             e_quadrant,
    output reg [9:0]             e_count0, e_count1,
    output reg                   e_full0, e_full1,

    // A word of both histograms, two clocks after its address, as it was after the first.
    input  [PIXELS_LOG2+3:0]     read_address,
    output reg [87:0]            read_word0, read_word1
);
    localparam ADDRESS_BITS = PIXELS_LOG2 + 4;
    localparam PIXELS = 1 << PIXELS_LOG2;

    // Photons on their way.
    reg                    b_valid, b_counts, b_look, b_hit_d, b_hit_e;
    reg                    c_valid, c_counts, c_look, c_hit_d;
    reg                    d_valid, d_counts, d_look;
    reg [PIXELS_LOG2-1:0]  b_pixel, c_pixel, d_pixel;
    reg [6:0]              b_bin, c_bin, d_bin;
    reg [1:0]              b_quadrant, c_quadrant, d_quadrant;
    wire [ADDRESS_BITS-1:0] a_address = {a_pixel, a_bin[6:3]};
    wire [ADDRESS_BITS-1:0] b_address = {b_pixel, b_bin[6:3]};
    wire [ADDRESS_BITS-1:0] c_address = {c_pixel, c_bin[6:3]};
    wire [ADDRESS_BITS-1:0] d_address = {d_pixel, d_bin[6:3]};
    wire a_writes = a_valid && a_counts;
    wire b_writes = b_valid && b_counts;
    wire c_writes = c_valid && c_counts;
    wire d_writes = d_valid && d_counts;

    // The lane of a bin in its word.
    reg [7:0] c_lane;

    always @(posedge clk) begin
        b_valid <= a_valid && !reset;
        c_valid <= b_valid && !reset;
        d_valid <= c_valid && !reset;
        e_valid <= d_valid && !reset;
        b_look <= a_look && !reset;
        c_look <= b_look && !reset;
        d_look <= c_look && !reset;
        e_look <= d_look && !reset;
        {b_counts, b_pixel, b_bin, b_quadrant} <= {a_counts, a_pixel, a_bin, a_quadrant};
        {c_counts, c_pixel, c_bin, c_quadrant} <= {b_counts, b_pixel, b_bin, b_quadrant};
        {d_counts, d_pixel, d_bin, d_quadrant} <= {c_counts, c_pixel, c_bin, c_quadrant};
        {e_counts, e_pixel, e_bin, e_quadrant} <= {d_counts, d_pixel, d_bin, d_quadrant};
        c_lane <= b_writes ? 8'd1 << b_bin[2:0] : 8'd0;
        // Photons ahead with the same word: where they will be in the next clock.
        b_hit_d <= c_writes && c_address == a_address;
        b_hit_e <= d_writes && d_address == a_address;
        c_hit_d <= c_writes && c_address == b_address;
    end

    // While the words are read, the reader requests a word as well. Words that photons in B
    // and C are about to write for the first time are still empty; what D writes is passed on.
    reg read_hit;
    always @(posedge clk) read_hit <= d_writes && d_address == read_address;
    wire b_is_read = b_writes && b_address == read_address;
    wire c_is_read = c_writes && c_address == read_address;
    wire [PIXELS_LOG2-1:0] read_pixel = read_address[ADDRESS_BITS-1:4];

    genvar slot;
    generate
        for (slot = 0; slot < 2; slot = slot + 1) begin : histogram
            // Which words of a macropixel are valid: a row of bits, none if it has no row.
            (* ram_style = "distributed" *)
            reg [15:0] rows [0:PIXELS-1];
            reg [PIXELS-1:0] has_row;
            reg b_fresh, c_fresh;
            wire [15:0] row = has_row[a_pixel] ? rows[a_pixel] : 16'd0;
            wire [PIXELS-1:0] has_row_after = has_row | (a_writes ? {{PIXELS-1{1'b0}}, 1'b1} << a_pixel : 0);
            always @(posedge clk) begin
                if (a_writes) rows[a_pixel] <= row | 16'd1 << a_bin[6:3];
                has_row <= a_look ? has_row_after & (slot ? live : ~live) : has_row_after;
                if (reset) has_row <= 0;
                b_fresh <= !row[a_bin[6:3]];
                c_fresh <= b_fresh;
            end

            // The word as it is before this photon, in C at the latest.
            wire [87:0] b_read;
            reg [87:0] c_word, d_word, e_word;
            always @(posedge clk) c_word <= b_hit_d ? d_word : b_hit_e ? e_word : b_read;

            genvar lane;
            wire [87:0] c_counted;
            for (lane = 0; lane < 8; lane = lane + 1) begin : bin
                wire [10:0] so_far = {11{!c_fresh}} & (c_hit_d ? d_word[11*lane +: 11] : c_word[11*lane +: 11]);
                wire is_full = &so_far[10:9];
                assign c_counted[11*lane +: 11] = so_far + {10'd0, c_lane[lane] && !is_full};
            end
            always @(posedge clk) begin
                d_word <= c_counted;
                e_word <= d_word;
            end

            histogram_ram #(.ADDRESS_BITS(ADDRESS_BITS), .WIDTH(88)) counts (
                .clk(clk),
                .write(d_writes),
                .write_address(d_address),
                .write_data(d_word),
                .read_address(a_address),
                .read_data(b_read)
            );

            // The count of the photon's bin.
            wire [10:0] counted;
            word_bin of_photon (.word(d_word), .number(d_bin[2:0]), .count(counted));
            wire [9:0] count = counted[9:0] | {10{counted[10]}};

            // The reader's copy.
            wire [87:0] copy;
            reg is_empty;
            wire [15:0] read_row = has_row[read_pixel] ? rows[read_pixel] : 16'd0;
            always @(posedge clk)
                is_empty <= !read_row[read_address[3:0]] || b_is_read && b_fresh || c_is_read && c_fresh;
            histogram_ram #(.ADDRESS_BITS(ADDRESS_BITS), .WIDTH(88)) copies (
                .clk(clk),
                .write(d_writes),
                .write_address(d_address),
                .write_data(d_word),
                .read_address(read_address),
                .read_data(copy)
            );
            wire [87:0] read_word = is_empty ? 88'd0 : read_hit ? e_word : copy;
        end
    endgenerate

    always @(posedge clk) begin
        e_count0 <= histogram[0].count;
        e_count1 <= histogram[1].count;
        e_full0 <= histogram[0].counted[10];
        e_full1 <= histogram[1].counted[10];
        read_word0 <= histogram[0].read_word;
        read_word1 <= histogram[1].read_word;
    end
endmodule
