// VexRiscv with its RAM, a Wishbone bus and the registers of soc.v that an FPGA has.
//
// Addresses
//   0x0000_0000  RAM, 4 bytes << RAM_BITS. Execution starts at 0.
//   0xE000_0000  the Wishbone bus, 256 words. An access ends with its ACK.
//   0xF000_0000  PRINT       write: the low byte is printed           } in simulation;
//   0xF000_0004  MARK        write: a number, logged with the clock   } nothing on an
//   0xF000_0008  EXIT        write: the run ends, 0 is success        } FPGA
//   0xF000_0018  EVENT_DATA  write: 32 bits of a 128-bit event word, least significant
//                            first; the last four are kept. Not to be written while REQ
//                            is high
//   0xF000_001C  EVENT_REQ   write 1: REQ rises, with the event word. write 0: REQ falls,
//                            and ACK with it.
//                            read: bit 0 ACK, high from the clock after the link took the
//                            word until REQ falls
// Other writes do nothing, other reads give 0. Whole words only but for RAM.
//
// RAM holds RAM_FILE, words in hexadecimal, when the FPGA is configured. In simulation it
// holds the file of the argument +ram=FILE if there is one. A word that is fetched in the
// clock in which it is written may be either: a program that writes code flushes the
// instruction cache before it runs it.
module computer #(
    parameter RAM_BITS = 14,        // log2 of the words of RAM
    parameter RAM_FILE = ""
) (
    input              clk,
    input              reset,

    // Wishbone classic, one access at a time.
    output reg         wb_cyc,
    output             wb_stb,
    output reg         wb_we,
    output reg  [7:0]  wb_adr,      // in words
    output reg  [31:0] wb_dat_o,
    input       [31:0] wb_dat_i,
    input              wb_ack,

    // An event word of the program; `event_taken` for one clock.
    output             event_valid,
    output reg [127:0] event_word,
    input              event_taken,

    // For simulation: writes of the program one clock after they were made, and what the
    // processor does.
    output reg         print_valid,
    output reg         mark_valid,
    output reg         exit_valid,
    output reg  [31:0] written,
    output             retired,
    output             fetch_filled,
    output             data_filled,
    output             unmapped
);
    wire        fetch_valid;
    wire [31:0] fetch_address;
    reg         fetch_ready, fetch_error;
    reg  [31:0] fetch_data;
    wire        data_valid;
    wire [31:0] data_address, data_write;
    wire [3:0]  data_strobe;
    reg         data_ready, data_error;
    wire [31:0] data_read;
    wire        stopped;

    processor processor (
        .clk(clk),
        .reset(reset),
        .fetch_valid(fetch_valid),
        .fetch_address(fetch_address),
        .fetch_ready(fetch_ready),
        .fetch_error(fetch_error),
        .fetch_data(fetch_data),
        .data_valid(data_valid),
        .data_address(data_address),
        .data_write(data_write),
        .data_strobe(data_strobe),
        .data_ready(data_ready),
        .data_error(data_error),
        .data_read(data_read),
        .retired(retired),
        .fetch_filled(fetch_filled),
        .data_filled(data_filled),
        .stopped(stopped),
        .unmapped(unmapped)
    );

    // Address decoding. Bits 1..0 do not matter: accesses are whole words.
    wire fetch_ram = fetch_address[31:RAM_BITS+2] == 0;
    wire data_ram = data_address[31:RAM_BITS+2] == 0;
    wire data_io = data_address[31:5] == 27'h780_0000;
    wire data_bus = data_address[31:10] == 22'h38_0000;
    wire [2:0] register = data_address[4:2];
    wire unused = &{1'b0, fetch_address[1:0], data_address[1:0], stopped};

    // RAM.
    (* no_rw_check *) reg [31:0] ram [0:(1 << RAM_BITS) - 1];
    reg [31:0] ram_read;
    wire [RAM_BITS-1:0] ram_address = data_address[RAM_BITS+1:2];
    wire [3:0] ram_strobe = data_valid && data_ram && !reset ? data_strobe : 4'h0;

`ifdef VERILATOR
    reg [8*256-1:0] ram_file;
    initial if ($value$plusargs("ram=%s", ram_file) != 0) $readmemh(ram_file, ram);
`endif
    generate if (RAM_FILE != "") initial $readmemh(RAM_FILE, ram); endgenerate

    always @(posedge clk) fetch_data <= ram[fetch_address[RAM_BITS+1:2]];

    always @(posedge clk) begin
        ram_read <= ram[ram_address];
        if (ram_strobe[0]) ram[ram_address][7:0] <= data_write[7:0];
        if (ram_strobe[1]) ram[ram_address][15:8] <= data_write[15:8];
        if (ram_strobe[2]) ram[ram_address][23:16] <= data_write[23:16];
        if (ram_strobe[3]) ram[ram_address][31:24] <= data_write[31:24];
    end

    // The bus. The processor holds a request until it is answered, as everywhere.
    wire bus_done = wb_cyc && wb_ack;
    assign wb_stb = wb_cyc;

    always @(posedge clk) begin
        fetch_ready <= fetch_valid && !reset;
        fetch_error <= fetch_valid && !fetch_ram && !reset;
        data_ready <= (data_valid && !data_bus || bus_done) && !reset;
        data_error <= data_valid && !data_ram && !data_io && !data_bus && !reset;

        if (!wb_cyc) begin
            wb_cyc <= data_valid && data_bus;
            wb_we <= data_strobe != 0;
            wb_adr <= data_address[9:2];
            wb_dat_o <= data_write;
        end
        if (wb_ack || reset) wb_cyc <= 0;
    end

    // Input and output.
    localparam PRINT = 0, MARK = 1, EXIT = 2, EVENT_DATA = 6, EVENT_REQ = 7;

    wire io_write = data_valid && data_io && !reset && data_strobe != 0;
    reg event_req, event_ack;
    reg read_is_ram;
    reg [31:0] other_read;

    assign data_read = read_is_ram ? ram_read : other_read;
    assign event_valid = event_req && !event_ack;

    always @(posedge clk) begin
        print_valid <= io_write && register == PRINT;
        mark_valid <= io_write && register == MARK;
        exit_valid <= io_write && register == EXIT;
        if (io_write) written <= data_write;

        read_is_ram <= data_ram;
        if (bus_done) other_read <= wb_dat_i;
        else other_read <= {31'd0, event_ack && register == EVENT_REQ};

        if (io_write && register == EVENT_DATA) event_word <= {data_write, event_word[127:32]};
        if (event_valid && event_taken) event_ack <= 1;
        if (io_write && register == EVENT_REQ) begin
            event_req <= data_write[0];
            if (!data_write[0]) event_ack <= 0;
        end
        if (reset) begin
            event_req <= 0;
            event_ack <= 0;
        end
    end
endmodule
