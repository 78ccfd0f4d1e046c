// A stand-in for the synchronizer: a bit that changes shortly before the clock may be taken as it is or
// as it was, each by itself.
module synchronizer #(
    parameter WIDTH = 1
) (
    input                  clk,
    input      [WIDTH-1:0] in,
    output reg [WIDTH-1:0] out
);
    reg [WIDTH-1:0] taken, before;
    (* anyseq *) wire [WIDTH-1:0] is_late;
    always @($global_clock) before <= in;
    always @(posedge clk) {out, taken} <= {taken, in & ~is_late | before & is_late};
endmodule
