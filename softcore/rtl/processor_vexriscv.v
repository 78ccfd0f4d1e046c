// VexRiscv: five-stage pipeline, 4 KiB of instruction cache, data cache
// (the file VexRiscv.v of its package: RV32IM, no debug). Two Wishbone buses.
//
// A load that the cache has takes 1 cycle, and its result 2 more to arrive at the
// next instruction. One that it has not takes 14: a line of 8 words is filled by one
// burst, a word each cycle after the first. Stores go through to RAM, one every 2
// cycles. Addresses with the top bit set are not cached: a read takes 4 cycles.
//
// It takes no notice of bus errors: a load or store where nothing is mapped stops the
// run; what is fetched there is 0, an illegal instruction.
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
    localparam BURST = 3'b010; // Wishbone cycle type: another word follows

    wire fetch_stb, data_stb, data_we;
    wire [29:0] fetch_word, data_word;
    wire [2:0] fetch_type, data_type;
    wire [3:0] data_bytes;

    // The next word of a burst is requested while one is answered. It lies in the same line
    // of eight words.
    assign fetch_valid = fetch_stb && (!fetch_ready || fetch_type == BURST);
    assign fetch_address = {fetch_word[29:3], fetch_word[2:0] + {2'd0, fetch_ready}, 2'b00};
    assign data_valid = data_stb && (!data_ready || data_type == BURST);
    assign data_address = {data_word[29:3], data_word[2:0] + {2'd0, data_ready}, 2'b00};
    assign data_strobe = data_we ? data_bytes : 4'h0;

    VexRiscv cpu (
        .clk(clk),
        .reset(reset),
        .externalResetVector(32'h0),
        .timerInterrupt(1'b0),
        .softwareInterrupt(1'b0),
        .externalInterruptArray(32'h0),
        .iBusWishbone_CYC(),
        .iBusWishbone_STB(fetch_stb),
        .iBusWishbone_ACK(fetch_ready),
        .iBusWishbone_WE(),
        .iBusWishbone_ADR(fetch_word),
        .iBusWishbone_DAT_MISO(fetch_error ? 32'h0 : fetch_data),
        .iBusWishbone_DAT_MOSI(),
        .iBusWishbone_SEL(),
        .iBusWishbone_ERR(fetch_error),
        .iBusWishbone_CTI(fetch_type),
        .iBusWishbone_BTE(),
        .dBusWishbone_CYC(),
        .dBusWishbone_STB(data_stb),
        .dBusWishbone_ACK(data_ready),
        .dBusWishbone_WE(data_we),
        .dBusWishbone_ADR(data_word),
        .dBusWishbone_DAT_MISO(data_read),
        .dBusWishbone_DAT_MOSI(data_write),
        .dBusWishbone_SEL(data_bytes),
        .dBusWishbone_ERR(data_error),
        .dBusWishbone_CTI(data_type),
        .dBusWishbone_BTE()
    );

    assign retired = cpu.lastStageIsFiring;
    // The first word of a line has come.
    assign fetch_filled = fetch_stb && fetch_ready && fetch_type == BURST && fetch_word[2:0] == 0;
    assign data_filled = data_stb && data_ready && data_type == BURST && data_word[2:0] == 0;
    assign stopped = 1'b0;
    assign unmapped = data_error;
endmodule
