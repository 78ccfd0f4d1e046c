// Photons from one clock domain for a pixel processor in another: an asynchronous FIFO of 2 to the
// DEPTH_LOG2 entries.
//
// An entry has what a clock of `photon_clk` brought: a photon, the end of its laser cycle, or both.
// They come out in order, one a clock of `clk`. A photon that finds no room is lost, and `lost`
// counts it. The end of a laser cycle that finds none stays pending: it goes out as soon as there is
// room, and no photon passes it, so photons stay in their laser cycle. Up to 2 to the PENDING_BITS,
// less one, are pending. One more is lost, and `end_lost` stays high until a reset. With eight entries
// or more nothing is lost if `clk` is not slower than `photon_clk`.
//
// `reset` comes from a flip-flop of `clk` and lasts for eight clocks of both. What comes meanwhile is not taken, nor,
// at most, what comes in three clocks of `photon_clk` after it.
module photon_crossing #(
    parameter WIDTH = 24,           // bits of a photon
    parameter DEPTH_LOG2 = 4,
    parameter PENDING_BITS = 8,
    parameter LOST_BITS = 16
) (
    input                      photon_clk,
    input                      photon_valid,
    input      [WIDTH-1:0]     photon,
    input                      photon_cycle_end,

    input                      clk,
    input                      reset,
    output reg                 valid,
    output reg [WIDTH-1:0]     crossed,     // the photon
    output reg                 cycle_end,
    output     [LOST_BITS-1:0] lost,        // photons, modulo 2 to the LOST_BITS
    output                     end_lost
);
    (* ram_style = "distributed" *)
    reg [WIDTH+1:0] entries [0:(1 << DEPTH_LOG2) - 1];

    wire photon_reset;
    synchronizer of_reset (.clk(photon_clk), .in(reset), .out(photon_reset));

    // Where the next one goes, and where the oldest is: one bit more than an entry's number.
    wire put, waiting;
    wire [DEPTH_LOG2:0] next, next_seen, first, first_seen;
    crossing_counter #(.WIDTH(DEPTH_LOG2 + 1)) putting (
        .clk(photon_clk), .reset(photon_reset), .counts(put), .count(next),
        .other_clk(clk), .seen(next_seen)
    );
    crossing_counter #(.WIDTH(DEPTH_LOG2 + 1)) taking (
        .clk(clk), .reset(reset), .counts(waiting), .count(first),
        .other_clk(photon_clk), .seen(first_seen)
    );

    reg [PENDING_BITS-1:0] pending;
    reg end_is_lost;
    wire has_pending = pending != 0;
    wire [DEPTH_LOG2:0] fill = next - first_seen;
    wire has_room = !fill[DEPTH_LOG2];
    wire puts_photon = photon_valid && has_room && !has_pending;
    wire puts_end = has_room && (photon_cycle_end || has_pending);
    wire sends = has_room && has_pending;
    wire adds = photon_cycle_end && (!has_room || has_pending);
    assign put = puts_photon || puts_end;
    always @(posedge photon_clk) begin
        if (put) entries[next[DEPTH_LOG2-1:0]] <= {puts_end, puts_photon, photon};
        if (sends && !adds) pending <= pending - 1'b1;
        if (adds && !sends) begin
            if (&pending) end_is_lost <= 1;
            else pending <= pending + 1'b1;
        end
        if (photon_reset) begin
            pending <= 0;
            end_is_lost <= 0;
        end
    end
    synchronizer of_end_lost (.clk(clk), .in(end_is_lost), .out(end_lost));

    wire [LOST_BITS-1:0] unused_lost;
    crossing_counter #(.WIDTH(LOST_BITS)) losing (
        .clk(photon_clk), .reset(photon_reset), .counts(photon_valid && !puts_photon),
        .count(unused_lost), .other_clk(clk), .seen(lost)
    );

    assign waiting = next_seen != first;
    always @(posedge clk) begin
        if (waiting) {cycle_end, valid, crossed} <= entries[first[DEPTH_LOG2-1:0]];
        if (!waiting || reset) {cycle_end, valid} <= 0;
    end
endmodule
