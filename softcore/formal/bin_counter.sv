// Every photon in the gate counts in its bin of both histograms, or meets a full counter; a
// look empties the spare one and no other; the reader sees just that.
//
// Any macropixel, any bin; photons, looks, flips of `live` and reads in any clock.
module top (
    input       clk,
    input       reset,
    input       a_valid, a_counts, a_look,
    input [0:0] a_pixel,
    input [6:0] a_bin,
    input [1:0] live,
    input [4:0] read_address
);
    (* anyconst *) wire [0:0] pixel;
    (* anyconst *) wire [6:0] bin;
    wire [4:0] address = {pixel, bin[6:3]};
    // drive dut.histogram[0].counts.address address
    // drive dut.histogram[0].copies.address address
    // drive dut.histogram[1].counts.address address
    // drive dut.histogram[1].copies.address address

    wire e_valid, e_counts, e_look, e_full0, e_full1;
    wire [0:0] e_pixel;
    wire [6:0] e_bin;
    wire [1:0] e_quadrant;
    wire [9:0] e_count0, e_count1;
    wire [87:0] read_word0, read_word1;
    bin_counter #(.PIXELS_LOG2(1)) dut (
        .clk(clk), .reset(reset), .live(live),
        .a_valid(a_valid), .a_counts(a_counts), .a_look(a_look), .a_pixel(a_pixel),
        .a_bin(a_bin), .a_quadrant(2'd0),
        .e_valid(e_valid), .e_counts(e_counts), .e_look(e_look), .e_pixel(e_pixel),
        .e_bin(e_bin), .e_quadrant(e_quadrant), .e_count0(e_count0), .e_count1(e_count1),
        .e_full0(e_full0), .e_full1(e_full1),
        .read_address(read_address), .read_word0(read_word0), .read_word1(read_word1)
    );

    reg is_first = 1;
    reg [1:0] clocks = 0;
    always @(posedge clk) clocks <= reset ? 2'd0 : clocks + !(&clocks);
    always @(posedge clk) is_first <= 0;
    always @* if (is_first) assume (reset);

    // The photon's way.
    reg [3:0] valid = 0, of_bin = 0, of_word = 0, look = 0;
    wire counts = a_valid && a_counts && !reset;
    always @(posedge clk) begin
        valid <= {valid[2:0], a_valid && !reset};
        of_bin <= {of_bin[2:0], counts && a_pixel == pixel && a_bin == bin};
        of_word <= {of_word[2:0], counts && a_pixel == pixel && a_bin[6:3] == bin[6:3]};
        look <= {look[2:0], a_look && !reset};
        if (reset) {valid, of_bin, of_word, look} <= 0;
    end

    wire [87:0] words [0:1];
    assign words[0] = read_word0;
    assign words[1] = read_word1;
    wire [9:0] e_counted [0:1];
    assign e_counted[0] = e_count0;
    assign e_counted[1] = e_count1;
    wire [1:0] e_full = {e_full1, e_full0};
    reg [1:0] is_read = 0;
    always @(posedge clk) is_read <= {is_read[0], read_address == address};


    // What the proof knows of the inside: what was written last, what D writes, the valid bits.
    wire [87:0] counts0;      // probe dut.histogram[0].counts.kept
    wire [87:0] counts1;      // probe dut.histogram[1].counts.kept
    wire [87:0] copies0;      // probe dut.histogram[0].copies.kept
    wire [87:0] copies1;      // probe dut.histogram[1].copies.kept
    wire [87:0] d_word0;      // probe dut.histogram[0].d_word
    wire [87:0] d_word1;      // probe dut.histogram[1].d_word
    wire [15:0] rows00;       // probe dut.histogram[0].rows[0]
    wire [15:0] rows01;       // probe dut.histogram[0].rows[1]
    wire [15:0] rows10;       // probe dut.histogram[1].rows[0]
    wire [15:0] rows11;       // probe dut.histogram[1].rows[1]
    wire [1:0] has_row0;      // probe dut.histogram[0].has_row
    wire [1:0] has_row1;      // probe dut.histogram[1].has_row
    wire [87:0] counts_kept [0:1], copies_kept [0:1], d_words [0:1];
    assign {counts_kept[1], counts_kept[0]} = {counts1, counts0};
    assign {copies_kept[1], copies_kept[0]} = {copies1, copies0};
    assign {d_words[1], d_words[0]} = {d_word1, d_word0};
    wire [15:0] row0 = pixel ? rows01 : rows00, row1 = pixel ? rows11 : rows10;
    wire [1:0] is_valid = {has_row1[pixel] && row1[bin[6:3]], has_row0[pixel] && row0[bin[6:3]]};

    genvar slot;
    generate
        for (slot = 0; slot < 2; slot = slot + 1) begin : histogram
            // The count, which is right from the clock after a photon is in A on.
            reg [10:0] count;
            wire emptied = reset || a_look && live[pixel] == (slot == 0);
            wire is_mine = counts && a_pixel == pixel && a_bin == bin;
            wire is_of_word = counts && a_pixel == pixel && a_bin[6:3] == bin[6:3];
            wire [10:0] now = count + (is_mine && count != 11'd1536);
            // What the word's last photon made of it, for B, C, D, E.
            reg [10:0] last_b, last_c, last_d, last_e;
            reg has_b = 0, has_c = 0, has_d = 0, has_e = 0;
            // A reader sees what photons in D or past it have counted. Two clocks later it has it.
            reg came_b = 0, came_c = 0;
            reg [10:0] seen, read;
            always @(posedge clk) begin
                count <= emptied ? 11'd0 : now;
                {came_b, came_c} <= emptied ? 2'd0 : {now != count, came_b};
                {seen, read} <= {count - came_b - came_c, seen};
                if (is_of_word) {last_b, has_b} <= {now, 1'b1};
                {last_c, last_d, last_e} <= {last_b, last_c, last_d};
                {has_c, has_d, has_e} <= {has_b, has_c, has_d};
                if (reset) {has_b, has_c, has_d, has_e} <= 0;
            end

            wire [10:0] kept, copied, writes, was_read;
            word_bin of_read (.word(words[slot]), .number(bin[2:0]), .count(was_read));
            word_bin of_kept (.word(counts_kept[slot]), .number(bin[2:0]), .count(kept));
            word_bin of_copy (.word(copies_kept[slot]), .number(bin[2:0]), .count(copied));
            word_bin of_d (.word(d_words[slot]), .number(bin[2:0]), .count(writes));
            always @* if (!is_first) begin
                assert (count <= 11'd1536);
                assert (is_valid[slot] ? has_b && last_b == count : count == 0);
                if (has_e) assert (kept == last_e && copied == last_e);
                if (of_word[2]) assert (has_d && writes == last_d);
                if (is_read[1] && clocks > 1) assert (was_read == read);
                if (of_bin[3]) begin
                    assert (e_valid && e_counts && e_pixel == pixel && e_bin == bin);
                    assert (e_counted[slot] == (last_e > 11'd1023 ? 10'd1023 : last_e[9:0]));
                    assert (e_full[slot] == (last_e > 11'd1023));
                end
            end
        end
    endgenerate
    always @* if (!is_first) assert (e_look == look[3] && e_valid == valid[3]);
endmodule
