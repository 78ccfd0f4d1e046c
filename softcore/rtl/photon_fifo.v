// Photon FIFO: at most one word in and one word out a clock cycle.
//
// What is put is a photon, or with bit 31 set the end of one laser cycle, whatever
// the other bits. What is taken is a photon, bit 31 clear, or with bit 31 set the
// end of as many laser cycles as in bits 15..0: an end that follows an end takes no
// place of its own, the number of the newest word grows by one. One place is kept
// for an end, so a laser cycle is never lost, only photons (up to 65535 laser cycles
// after the last photon).
//
// Whether there is room is known at the clock edge: a place that falls free in
// that same cycle does not count. `lost` is high for one cycle after each word
// that found no room. `fill` is the number of words that wait. `head` is the
// oldest of them; when none waits it is 0xffff_ffff, or 0xffff_fffe with
// `finished`: none will come. `take` goes with the `head` of the same clock cycle, and
// takes one word in every cycle that it is high; on an empty FIFO it does nothing.
//
// The newest word waits in a register, where its number can grow; the older ones
// are in a memory with one port to write and one, clocked, to read: block RAM.
module photon_fifo #(
    parameter DEPTH_LOG2 = 9
) (
    input                       clk,
    input                       reset,
    input                       put,
    input      [31:0]           word,
    input                       finished,
    input                       take,
    output     [31:0]           head,
    output reg [DEPTH_LOG2:0]   fill,
    output reg                  lost
);
    localparam DEPTH = 1 << DEPTH_LOG2;

    reg [31:0] older [0:DEPTH - 1];
    reg [31:0] newest;
    // Where the oldest of the older words is, and where the next one goes.
    reg [DEPTH_LOG2-1:0] first, last;

    wire empty = fill == 0;
    wire one = fill == 1;
    wire taken = take && !empty;
    wire newest_stays = !empty && !(taken && one);

    wire is_end = word[31];
    wire [31:0] stored_word = is_end ? 32'h8000_0001 : word;
    wire joins = is_end && newest_stays && newest[31] && newest[15:0] != 16'hffff;
    wire full_for_photons = fill[DEPTH_LOG2] || &fill[DEPTH_LOG2-1:0];
    wire room = !fill[DEPTH_LOG2] && (is_end || !full_for_photons);
    wire stored = put && !joins && room;

    // The oldest word is read one clock cycle ahead. If it is written in that same
    // cycle, the read returns another word.
    wire moves = stored && newest_stays;
    wire [DEPTH_LOG2-1:0] next_first = taken && !one ? first + 1'b1 : first;
    reg [31:0] oldest, moved;
    reg is_moved;

    always @(posedge clk) begin
        if (moves) older[last] <= newest;
        oldest <= older[next_first];
    end

    assign head = empty ? {31'h7fff_ffff, !finished} : one ? newest : is_moved ? moved : oldest;

    always @(posedge clk) begin
        moved <= newest;
        is_moved <= moves && last == next_first;
        if (stored) newest <= stored_word;
        else if (put && joins) newest[15:0] <= newest[15:0] + 1'b1;
        lost <= put && !joins && !room && !reset;
        if (reset) begin
            first <= 0;
            last <= 0;
            fill <= 0;
        end else begin
            first <= next_first;
            if (moves) last <= last + 1'b1;
            if (stored && !taken) fill <= fill + 1'b1;
            if (taken && !stored) fill <= fill - 1'b1;
        end
    end
endmodule
