// Block RAM with one port to write and one, clocked, to read.
//
// What is read in the clock in which the same word is written is not to be used. Parts
// differ in what they give, so in simulation it is wrong.
module histogram_ram #(
    parameter ADDRESS_BITS = 6,
    parameter WIDTH = 88
) (
    input                         clk,
    input                         write,
    input      [ADDRESS_BITS-1:0] write_address,
    input      [WIDTH-1:0]        write_data,
    input      [ADDRESS_BITS-1:0] read_address,
    output reg [WIDTH-1:0]        read_data
);
    (* ram_style = "block", no_rw_check *)
    reg [WIDTH-1:0] words [0:(1 << ADDRESS_BITS) - 1];

    always @(posedge clk) begin
        if (write) words[write_address] <= write_data;
        read_data <= words[read_address];
`ifdef VERILATOR
        if (write && write_address == read_address) read_data <= ~write_data;
`endif
    end
endmodule
