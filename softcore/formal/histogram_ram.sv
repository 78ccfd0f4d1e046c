// A stand-in for the histograms' memory, of which it keeps one word, any. The others hold
// anything at any time, and what is read in the clock of its writing is anything as well:
// whatever is proved with it is true of the memory.
module histogram_ram #(
    parameter ADDRESS_BITS = 6,
    parameter WIDTH = 88
) (
    input                         clk,
    input                         write,
    input      [ADDRESS_BITS-1:0] write_address,
    input      [WIDTH-1:0]        write_data,
    input      [ADDRESS_BITS-1:0] read_address,
    output     [WIDTH-1:0]        read_data
);
    wire [ADDRESS_BITS-1:0] address; // connected to the one of the wrapper
    (* anyseq *) wire [WIDTH-1:0] anything;
    reg [WIDTH-1:0] kept, was_kept;
    reg is_kept;
    always @(posedge clk) begin
        if (write && write_address == address) kept <= write_data;
        was_kept <= kept;
        is_kept <= read_address == address && !(write && write_address == address);
    end
    assign read_data = is_kept ? was_kept : anything;
endmodule
