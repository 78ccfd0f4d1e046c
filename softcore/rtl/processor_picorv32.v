// PicoRV32: no pipeline, one port for instructions and data. RV32IM, or RV32I
// with the macro RV32I. Its other options are as published: two-stage shifter,
// no barrel shifter, multiplication bit by bit.
//
// Its look-ahead port gives an address one cycle early, so RAM answers without
// a wait: an addition takes 3 cycles with its fetch, a load or a store 5.
//
// It has no trap handler of the RISC-V kind: an illegal instruction, or an access
// where nothing is mapped, stops it. Nor has it control and status registers; so that
// a program may set a trap handler, a write to one does nothing and a read gives 0.
module processor (
    input         clk,
    input         reset,
    output        fetch_valid,
    output [31:0] fetch_address,
    input         fetch_ready,
    input         fetch_error,
    input  [31:0] fetch_data,
    output        data_valid,
    output [31:0] data_address,
    output [31:0] data_write,
    output [3:0]  data_strobe,
    input         data_ready,
    input         data_error,
    input  [31:0] data_read,
    output        retired,
    output        fetch_filled,
    output        data_filled,
    output        stopped,
    output        unmapped
);
`ifdef RV32I
    localparam MULTIPLY = 1'b0;
`else
    localparam MULTIPLY = 1'b1;
`endif

    // The instruction port is not used: everything goes through the data port.
    assign fetch_valid = 0;
    assign fetch_address = 0;
    wire unused = &{1'b0, fetch_ready, fetch_error, fetch_data, instruction};

    wire look_read, look_write, trap;
    wire [3:0] look_strobe;
    assign data_valid = look_read || look_write;
    assign data_strobe = look_write ? look_strobe : 4'h0;

    wire coprocessor_valid;
    wire [31:0] instruction;
    wire csr = coprocessor_valid && instruction[6:0] == 7'h73 && instruction[14:12] != 0;

    picorv32 #(
        .ENABLE_MUL(MULTIPLY),
        .ENABLE_DIV(MULTIPLY),
        .ENABLE_PCPI(1'b1)
    ) cpu (
        .clk(clk),
        .resetn(!reset),
        .trap(trap),
        .mem_valid(),
        .mem_instr(),
        .mem_ready(data_ready),
        .mem_addr(),
        .mem_wdata(),
        .mem_wstrb(),
        .mem_rdata(data_read),
        .mem_la_read(look_read),
        .mem_la_write(look_write),
        .mem_la_addr(data_address),
        .mem_la_wdata(data_write),
        .mem_la_wstrb(look_strobe),
        .pcpi_valid(coprocessor_valid),
        .pcpi_insn(instruction),
        .pcpi_rs1(),
        .pcpi_rs2(),
        .pcpi_wr(csr),
        .pcpi_rd(32'h0),
        .pcpi_wait(1'b0),
        .pcpi_ready(csr),
        .irq(32'h0),
        .eoi(),
        .trace_valid(),
        .trace_data()
    );

    // Its own counter of instructions, watched.
    reg count;
    always @(posedge clk) count <= cpu.count_instr[0];
    assign retired = count != cpu.count_instr[0];
    assign fetch_filled = 1'b0;
    assign data_filled = 1'b0;
    assign stopped = trap;
    assign unmapped = data_error;
endmodule
