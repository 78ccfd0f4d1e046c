// Synchronizes bits to another clock by two flip-flops. Where several bits belong together, at most
// one of them changes in a clock of the sender.
module synchronizer #(
    parameter WIDTH = 1
) (
    input                  clk,
    input      [WIDTH-1:0] in,
    (* async_reg = "true", shreg_extract = "no" *)
    output reg [WIDTH-1:0] out
);
    (* async_reg = "true", shreg_extract = "no" *)
    reg [WIDTH-1:0] taken;
    always @(posedge clk) {out, taken} <= {taken, in};
endmodule
