// Photon FIFO: at most one word in and one word out a clock cycle.
//
// A word is a photon, or with bit 31 set the end of laser cycles, their number in
// bits 15..0. An end that follows an end takes no place of its own: the number of
// the newest word grows by one. One place is kept for an end, so a laser cycle is
// never lost, only photons (up to 65535 laser cycles after the last photon).
//
// Whether there is room is known at the clock edge: a place that falls free in
// that same cycle does not count. `lost` is high for one cycle after each word
// that found no room. `fill` is the number of words that wait. `head` is the
// oldest of them; when none waits it is 0xffff_ffff, or 0xffff_fffe with
// `finished`: none will come. `take` on an empty FIFO does nothing.
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

    reg [31:0] words [0:DEPTH - 1];
    reg [DEPTH_LOG2-1:0] first;

    wire empty = fill == 0;
    wire taken = take && !empty;
    wire [DEPTH_LOG2-1:0] next = first + fill[DEPTH_LOG2-1:0];
    wire [DEPTH_LOG2-1:0] newest = next - 1'b1;

    wire is_end = word[31];
    wire stays = !empty && !(taken && fill == 1);
    wire joins = is_end && stays && words[newest][31] && words[newest][15:0] != 16'hffff;
    wire room = !fill[DEPTH_LOG2] && (is_end || next + 1'b1 != first);
    wire stored = put && !joins && room;

    assign head = !empty ? words[first] : {31'h7fff_ffff, !finished};

    always @(posedge clk) begin
        if (stored) words[next] <= word;
        if (put && joins) words[newest][15:0] <= words[newest][15:0] + 1'b1;
        lost <= put && !joins && !room && !reset;
        if (reset) begin
            first <= 0;
            fill <= 0;
        end else begin
            if (taken) first <= first + 1'b1;
            if (stored && !taken) fill <= fill + 1'b1;
            if (taken && !stored) fill <= fill - 1'b1;
        end
    end
endmodule
