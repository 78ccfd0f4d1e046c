// The AER port: a word of 128 bits goes out as eight half words of 16 bits, least
// significant first, each with a handshake of four phases.
//
//   aer_data   the half word, at rest from a clock before REQ rises until ACK has come
//   aer_first  high with the first half word of a word
//   aer_req    rises when the half word is there, falls after ACK has risen
//   aer_ack    rises when the receiver has taken the half word, falls after REQ has
//
// ACK may come at any time: two flip-flops take it over. A receiver that answers at once
// gets a half word every six clocks. One that never answers stops the port, and words wait.
module aer_port (
    input             clk,
    input             reset,
    input             word_valid,
    input     [127:0] word,
    output            word_taken,   // for one clock
    output reg        aer_req,
    output     [15:0] aer_data,
    output            aer_first,
    input             aer_ack
);
    reg [127:0] rest;
    reg [3:0] left;                 // half words
    (* async_reg = "true", shreg_extract = "no" *)
    reg [1:0] acks;
    wire ack = acks[1];

    assign word_taken = word_valid && left == 0 && !ack;
    assign aer_data = rest[15:0];
    assign aer_first = left[3];

    always @(posedge clk) begin
        acks <= {acks[0], aer_ack};
        if (word_taken) begin
            rest <= word;
            left <= 8;
        end else if (left != 0 && !aer_req && !ack) begin
            aer_req <= 1;
        end else if (aer_req && ack) begin
            aer_req <= 0;
            rest <= rest >> 16;
            left <= left - 1;
        end
        if (reset) begin
            aer_req <= 0;
            left <= 0;
        end
    end
endmodule
