// The neighbours of a peak, as they were at the look: what the live histogram held, less the
// photons that came since, which the spare one has. An event takes two clocks.
//
// When no event is on its way, the host's reads have their turn.
module event_reader #(
    parameter PIXELS_LOG2 = 2,
    parameter REST = 38 // bits that go along with an event
) (
    input                         clk,
    input                         reset,
    input  [(1<<PIXELS_LOG2)-1:0] live,
    input  [7:0]                  gate_first, gate_end,

    // Events found; `rest` goes along with them.
    input                         found,
    input  [PIXELS_LOG2-1:0]      found_pixel,
    input  [6:0]                  found_bin,
    input  [REST-1:0]             found_rest,
    output                        reading,    // more than one is on its way

    // The histograms.
    output reg [PIXELS_LOG2+3:0]  read_address,
    input  [87:0]                 read_word0, read_word1,

    output reg                    put,
    output reg [PIXELS_LOG2-1:0]  put_pixel,
    output reg [6:0]              put_bin,
    output reg [REST-1:0]         put_rest,
    output reg [9:0]              put_left, put_right,
    output reg                    put_clipped,

    // The host's read: eight bins of the live histogram, three clocks after `host_taken`.
    input                         host_asks,
    input  [PIXELS_LOG2+3:0]      host_address,
    output                        host_taken,
    output [79:0]                 host_word
);
    localparam WIDTH = PIXELS_LOG2 + 7 + REST;

    wire waiting, is_last;
    wire [PIXELS_LOG2-1:0] pixel;
    wire [6:0] bin;
    wire [REST-1:0] rest;
    reg is_right;

    event_queue #(.DEPTH_LOG2(PIXELS_LOG2), .WIDTH(WIDTH)) queue (
        .clk(clk),
        .reset(reset),
        .put(found),
        .in({found_pixel, found_bin, found_rest}),
        .take(waiting && is_right),
        .head({pixel, bin, rest}),
        .waiting(waiting),
        .is_last(is_last)
    );

    // The first clock requests the left neighbour, the second the right one.
    wire [7:0] neighbour = is_right ? {1'b0, bin} + 8'd1 : {1'b0, bin} - 8'd1;
    wire [PIXELS_LOG2+3:0] address = waiting ? {pixel, neighbour[6:3]} : host_address;
    assign host_taken = host_asks && !waiting;

    // Q has the address. Two clocks later, in S, the words are there, in T the bins.
    reg q_valid, r_valid, s_valid, t_valid, q_right, r_right, s_right, t_right;
    reg r_inside, s_inside, t_inside, left_inside, r_live, s_live;
    reg [7:0] q_neighbour;
    reg [2:0] r_lane, s_lane;
    reg [PIXELS_LOG2-1:0] q_pixel, r_pixel, s_pixel, t_pixel;
    reg [6:0] q_bin, r_bin, s_bin, t_bin;
    reg [REST-1:0] q_rest, r_rest, s_rest, t_rest;
    wire [87:0] ended = s_live ? read_word0 : read_word1;
    wire [87:0] since = s_live ? read_word1 : read_word0;
    wire [10:0] s_ended, s_since;
    reg [10:0] t_ended, t_since;
    word_bin of_ended (.word(ended), .number(s_lane), .count(s_ended));
    word_bin of_since (.word(since), .number(s_lane), .count(s_since));
    wire [10:0] count = t_ended - t_since;
    wire [9:0] at_look = t_inside ? count[9:0] | {10{count[10]}} : 10'd0;

    assign reading = waiting && !is_last;

    always @(posedge clk) begin
        is_right <= waiting && !is_right;
        read_address <= address;
        q_valid <= waiting;
        q_right <= is_right;
        q_neighbour <= neighbour;
        {q_pixel, q_bin, q_rest} <= {pixel, bin, rest};

        r_valid <= q_valid;
        {r_right, r_lane} <= {q_right, q_neighbour[2:0]};
        r_inside <= q_neighbour >= gate_first && q_neighbour < gate_end;
        r_live <= live[read_address[PIXELS_LOG2+3:4]];
        {r_pixel, r_bin, r_rest} <= {q_pixel, q_bin, q_rest};

        s_valid <= r_valid;
        {s_right, s_inside, s_lane, s_live} <= {r_right, r_inside, r_lane, r_live};
        {s_pixel, s_bin, s_rest} <= {r_pixel, r_bin, r_rest};

        t_valid <= s_valid;
        {t_right, t_inside} <= {s_right, s_inside};
        t_ended <= s_ended;
        t_since <= s_since;
        {t_pixel, t_bin, t_rest} <= {s_pixel, s_bin, s_rest};

        put <= t_valid && t_right;
        if (t_right) put_right <= at_look;
        else put_left <= at_look;
        left_inside <= t_inside;
        put_clipped <= !t_inside || !left_inside;
        {put_pixel, put_bin, put_rest} <= {t_pixel, t_bin, t_rest};
        if (reset) begin
            is_right <= 0;
            q_valid <= 0;
            r_valid <= 0;
            s_valid <= 0;
            t_valid <= 0;
            put <= 0;
        end
    end

    // Of the live histogram.
    genvar lane;
    generate
        for (lane = 0; lane < 8; lane = lane + 1) begin : host_bin
            wire [10:0] counted = since[11*lane +: 11];
            assign host_word[10*lane +: 10] = counted[9:0] | {10{counted[10]}};
        end
    endgenerate
endmodule
