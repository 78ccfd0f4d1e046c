// One of the eight bins of a word. (A part select by 11 times the number would become a
// multiplier and a shifter of 88 bits.)
module word_bin (
    input      [87:0] word,
    input      [2:0]  number,
    output reg [10:0] count
);
    always @*
        case (number)
            3'd0: count = word[10:0];
            3'd1: count = word[21:11];
            3'd2: count = word[32:22];
            3'd3: count = word[43:33];
            3'd4: count = word[54:44];
            3'd5: count = word[65:55];
            3'd6: count = word[76:66];
            default: count = word[87:77];
        endcase
endmodule
