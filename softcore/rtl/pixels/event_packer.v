// An event as its AER word (docs/aer-format.md), with the centroid of three bins: what
// `centroid` and `AerEncoder` of dtof-core make of it, with a time word where one is due.
//
// The offset is 128 + 256 * (right - left) / (left + peak + right) in 1/256 bin, of counts
// less the background and not below 0, to the nearest; halves away from the middle. As the
// peak is the highest bin, the quotient is at most 128: eight bits, one a clock. A word is
// there twelve clocks after its event, a time word before it.
module event_packer (
    input              clk,
    input              reset,
    input              enabled,

    // The event that waits, and its word but for the offset.
    input              waiting,
    input      [127:0] event_word,
    input      [9:0]   left, right,
    input      [47:0]  cycle_high,
    output             take,

    // The word stays until the link takes it.
    output             word_valid,
    output     [127:0] word,
    input              word_taken
);
    localparam IDLE = 3'd0, SUBTRACT = 3'd1, ADD = 3'd2, START = 3'd3, DIVIDE = 3'd4,
               TIME = 3'd5, EVENT = 3'd6;
    localparam [63:0] TIME_LOW = 64'd1 << 52;

    reg [2:0] state, step;
    reg [127:0] packed_word;
    reg [47:0] high, sent_high;
    reg is_sent;
    reg [9:0] l, r;
    reg [9:0] distance;
    reg is_left;
    reg [11:0] sum;
    reg [20:0] remainder, divisor;
    reg [6:0] quotient;

    wire [9:0] peak = packed_word[73:64];
    wire [9:0] background = packed_word[97:88];
    wire fits = remainder >= divisor;
    wire [9:0] shift = {2'd0, quotient, fits};

    assign take = enabled && waiting && state == IDLE && !reset;
    assign word_valid = state == TIME || state == EVENT;
    assign word = state == TIME ? {16'd0, high, TIME_LOW} : packed_word;

    always @(posedge clk) begin
        case (state)
            IDLE: if (take) begin
                packed_word <= event_word;
                high <= cycle_high;
                l <= left;
                r <= right;
                state <= SUBTRACT;
            end
            SUBTRACT: begin
                l <= l > background ? l - background : 10'd0;
                r <= r > background ? r - background : 10'd0;
                state <= ADD;
            end
            ADD: begin
                sum <= {2'd0, l} + {2'd0, r} + {2'd0, peak - background};
                distance <= r < l ? l - r : r - l;
                is_left <= r < l;
                state <= START;
            end
            START: begin
                // Of (512 * distance + sum) / (2 * sum), which rounds.
                remainder <= {2'd0, distance, 9'd0} + {9'd0, sum};
                divisor <= {1'd0, sum, 8'd0};
                step <= 0;
                state <= DIVIDE;
            end
            DIVIDE: begin
                if (fits) remainder <= remainder - divisor;
                divisor <= divisor >> 1;
                quotient <= shift[6:0];
                step <= step + 1'b1;
                if (&step) begin
                    packed_word[121:112] <= is_left ? 10'd128 - shift : 10'd128 + shift;
                    sent_high <= high;
                    is_sent <= 1;
                    state <= is_sent && sent_high == high ? EVENT : TIME;
                end
            end
            TIME: if (word_taken) state <= EVENT;
            EVENT: if (word_taken) state <= IDLE;
            default: state <= IDLE;
        endcase
        if (reset) begin
            state <= IDLE;
            is_sent <= 0;
        end
    end
endmodule
