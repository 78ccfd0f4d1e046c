// The pixel processor: counts the photons of 2 to 64 macropixels of 128 bins, a photon a
// clock, looks at all of them every X laser cycles, and gives their events.
//
// It does what `AsyncPixel` of dtof-core does with the paper's rule, 10-bit counters and
// one echo, bit for bit. Photons and looks are in order: a look takes in every photon up to
// the laser cycle's last, and no later one. docs/softcore.md has the times and the registers.
module pixel_processor #(
    parameter PIXELS_LOG2 = 2       // log2 of the macropixels, 1 to 6
) (
    input             clk,
    input             reset,

    // Photons, at most one a clock. A photon in the clock of `cycle_end` is the last of the
    // laser cycle that ends.
    input             photon_valid,
    input      [7:0]  photon_pixel,
    input      [15:0] photon_code,
    input             cycle_end,

    // AER words, if the registers choose packed events. One stays until it is taken,
    // or `run` falls.
    output            word_valid,
    output     [127:0] word,
    input             word_taken,

    // What an observer needs: a look began, an event left its macropixel. Each for one clock.
    output reg        look_begins,
    output reg        event_leaves,
    output reg [5:0]  event_pixel,

    input             wb_cyc, wb_stb, wb_we,
    input      [7:0]  wb_adr,
    input      [31:0] wb_dat_i,
    output     [31:0] wb_dat_o,
    output            wb_ack
);
    localparam PIXELS = 1 << PIXELS_LOG2;
    localparam REST = 38;
    localparam RECORD = PIXELS_LOG2 + 7 + REST + 10 + 10 + 1 + 64;

    wire run, packs, is_one_hit;
    wire [15:0] x, l1, l2, alpha;
    wire [9:0] minimum;
    wire [7:0] gate_first, gate_second, gate_middle, gate_fourth, gate_end;

    // While the processor stands still its memory is emptied, a macropixel a clock.
    reg [PIXELS_LOG2:0] emptied;
    reg running;
    wire begins;
    wire stopped = !running;
    always @(posedge clk) begin
        running <= run && (running || emptied[PIXELS_LOG2]) && !reset;
        if (running || reset) emptied <= 0;
        else if (!emptied[PIXELS_LOG2]) emptied <= emptied + 1'b1;
    end

    // What comes in.
    reg i_valid, i_end;
    reg [7:0] i_pixel;
    reg [15:0] i_code;
    always @(posedge clk) begin
        i_valid <= photon_valid && running;
        i_end <= cycle_end && running;
        i_pixel <= photon_pixel;
        i_code <= photon_code;
    end

    wire is_stray = |(i_pixel >> PIXELS_LOG2);
    wire is_rejected = |i_code[15:7];
    wire [7:0] bin = {1'b0, i_code[6:0]};
    wire is_gated = bin >= gate_first && bin < gate_end;
    wire look, late;

    reg a_valid, a_counts, a_look;
    reg [PIXELS_LOG2-1:0] a_pixel;
    reg [6:0] a_bin;
    reg [1:0] a_quadrant;
    reg strayed, rejected, gated_out, counted, was_late;
    always @(posedge clk) begin
        a_valid <= i_valid && !is_stray && !is_rejected && !stopped;
        a_counts <= is_gated;
        a_look <= look;
        a_pixel <= i_pixel[PIXELS_LOG2-1:0];
        a_bin <= bin[6:0];
        a_quadrant <= bin < gate_middle ? {1'b0, bin >= gate_second} : {1'b1, bin >= gate_fourth};

        strayed <= i_valid && is_stray;
        rejected <= i_valid && !is_stray && is_rejected;
        gated_out <= i_valid && !is_stray && !is_rejected && !is_gated;
        counted <= i_valid && !is_stray && !is_rejected && is_gated;
        was_late <= late;
        look_begins <= look;
    end

    wire [PIXELS-1:0] live;
    wire e_valid, e_counts, e_look;
    wire [PIXELS_LOG2-1:0] e_pixel;
    wire [6:0] e_bin;
    wire [1:0] e_quadrant;
    wire [9:0] e_count0, e_count1;
    wire e_full0, e_full1;
    wire [PIXELS_LOG2+3:0] read_address;
    wire [87:0] read_word0, read_word1;
    bin_counter #(.PIXELS_LOG2(PIXELS_LOG2)) counter (
        .clk(clk), .reset(stopped), .live(live),
        .a_valid(a_valid), .a_counts(a_counts), .a_look(a_look),
        .a_pixel(a_pixel), .a_bin(a_bin), .a_quadrant(a_quadrant),
        .e_valid(e_valid), .e_counts(e_counts), .e_look(e_look),
        .e_pixel(e_pixel), .e_bin(e_bin), .e_quadrant(e_quadrant),
        .e_count0(e_count0), .e_count1(e_count1), .e_full0(e_full0), .e_full1(e_full1),
        .read_address(read_address), .read_word0(read_word0), .read_word1(read_word1)
    );

    wire scan;
    wire [PIXELS_LOG2-1:0] scan_pixel;
    wire [9:0] peak_count;
    wire [6:0] peak_bin;
    wire [39:0] maxima;
    wire [15:0] photons;
    wire [23:0] full;
    peak_keeper #(.PIXELS_LOG2(PIXELS_LOG2)) keeper (
        .clk(clk), .reset(stopped), .live(live),
        .e_valid(e_valid), .e_counts(e_counts), .e_look(e_look),
        .e_pixel(e_pixel), .e_bin(e_bin), .e_quadrant(e_quadrant),
        .e_count0(e_count0), .e_count1(e_count1), .e_full0(e_full0), .e_full1(e_full1),
        .scan(scan), .scan_pixel(scan_pixel),
        .peak_count(peak_count), .peak_bin(peak_bin), .maxima(maxima),
        .photons(photons), .full(full)
    );

    wire [9:0] background;
    wire is_clear;
    decision decision (
        .clk(clk), .alpha(alpha), .minimum(minimum), .middle(gate_middle),
        .peak_count(peak_count), .peak_bin(peak_bin), .maxima(maxima),
        .background(background), .is_clear(is_clear)
    );

    wire taken, reading, found, found_deferred, found_piled_up;
    wire [PIXELS_LOG2-1:0] taken_pixel, found_pixel;
    wire [9:0] found_count, found_background;
    wire [6:0] found_bin;
    wire [15:0] found_exposure;
    wire [63:0] cycle, scan_cycle;
    wire expired, expired_deferred, deferred;
    wire [23:0] full_ended;
    look_scan #(.PIXELS_LOG2(PIXELS_LOG2)) scanner (
        .clk(clk), .reset(stopped), .emptied(emptied[PIXELS_LOG2-1:0]), .begins(begins), .x(x), .l1(l1), .l2(l2), .is_one_hit(is_one_hit),
        .cycle_end(i_end), .look(look), .late(late), .cycle(cycle), .scan_cycle(scan_cycle),
        .scan(scan), .scan_pixel(scan_pixel),
        .peak_count(peak_count), .peak_bin(peak_bin), .photons(photons), .full(full),
        .background(background), .is_clear(is_clear),
        .taken(taken), .taken_pixel(taken_pixel), .reading(reading), .live(live),
        .found(found), .found_pixel(found_pixel), .found_count(found_count),
        .found_bin(found_bin), .found_background(found_background),
        .found_exposure(found_exposure), .found_deferred(found_deferred),
        .found_piled_up(found_piled_up),
        .expired(expired), .expired_deferred(expired_deferred), .deferred(deferred),
        .full_ended(full_ended)
    );

    wire put, put_clipped, host_asks, host_taken;
    wire [PIXELS_LOG2-1:0] put_pixel;
    wire [6:0] put_bin;
    wire [REST-1:0] put_rest;
    wire [9:0] put_left, put_right;
    wire [PIXELS_LOG2+3:0] host_address;
    wire [79:0] host_word;
    event_reader #(.PIXELS_LOG2(PIXELS_LOG2), .REST(REST)) reader (
        .clk(clk), .reset(stopped), .live(live), .gate_first(gate_first), .gate_end(gate_end),
        .found(found), .found_pixel(found_pixel), .found_bin(found_bin),
        .found_rest({found_piled_up, found_deferred, found_exposure, found_background, found_count}),
        .reading(reading),
        .read_address(read_address), .read_word0(read_word0), .read_word1(read_word1),
        .put(put), .put_pixel(put_pixel), .put_bin(put_bin), .put_rest(put_rest),
        .put_left(put_left), .put_right(put_right), .put_clipped(put_clipped),
        .host_asks(host_asks), .host_address(host_address), .host_taken(host_taken),
        .host_word(host_word)
    );

    // The events that wait.
    wire waiting, take, register_takes, packer_takes, unused_is_last;
    wire [PIXELS_LOG2-1:0] pixel;
    wire [9:0] left, right, count, level;
    wire [6:0] peak;
    wire [15:0] exposure;
    wire is_clipped, is_piled_up, is_deferred;
    wire [63:0] event_cycle;
    event_queue #(.DEPTH_LOG2(PIXELS_LOG2), .WIDTH(RECORD)) queue (
        .clk(clk), .reset(stopped),
        .put(put),
        .in({scan_cycle, put_clipped, put_right, put_left, put_rest, put_bin, put_pixel}),
        .take(take),
        .head({event_cycle, is_clipped, right, left,
               is_piled_up, is_deferred, exposure, level, count, peak, pixel}),
        .waiting(waiting),
        .is_last(unused_is_last)
    );
    assign take = register_takes || packer_takes;
    assign taken = take;
    assign taken_pixel = pixel;
    always @(posedge clk) begin
        event_leaves <= take;
        event_pixel <= {{6-PIXELS_LOG2{1'b0}}, pixel};
    end

    // As an AER word but for the offset.
    wire [5:0] flags = {2'd0, is_piled_up, is_deferred, is_clipped, &count};
    wire [127:0] event_word = {
        flags, 10'd0, 14'd0, level, 14'd0, count,
        2'd1, 3'd0, peak, 4'd0, event_cycle[15:0], exposure, {16-PIXELS_LOG2{1'b0}}, pixel
    };
    event_packer packer (
        .clk(clk), .reset(stopped), .enabled(packs),
        .waiting(waiting), .event_word(event_word), .left(left), .right(right),
        .cycle_high(event_cycle[63:16]), .take(packer_takes),
        .word_valid(word_valid), .word(word), .word_taken(word_taken)
    );

    pixel_registers #(.PIXELS_LOG2(PIXELS_LOG2)) registers (
        .clk(clk), .reset(reset),
        .wb_cyc(wb_cyc), .wb_stb(wb_stb), .wb_we(wb_we), .wb_adr(wb_adr),
        .wb_dat_i(wb_dat_i), .wb_dat_o(wb_dat_o), .wb_ack(wb_ack),
        .running(running), .run(run), .begins(begins), .packs(packs), .is_one_hit(is_one_hit),
        .x(x), .l1(l1), .l2(l2), .alpha(alpha), .minimum(minimum),
        .gate_first(gate_first), .gate_second(gate_second), .gate_middle(gate_middle),
        .gate_fourth(gate_fourth), .gate_end(gate_end),
        .event_waiting(waiting), .event_take(register_takes), .event_word(event_word),
        .event_left(left), .event_right(right), .event_cycle_high(event_cycle[63:16]),
        .happens({was_late, look_begins, expired_deferred, expired, deferred, found,
                  strayed, gated_out, rejected, counted}),
        .full_ended(full_ended), .cycle(cycle),
        .host_asks(host_asks), .host_address(host_address), .host_taken(host_taken),
        .host_word(host_word)
    );
endmodule
