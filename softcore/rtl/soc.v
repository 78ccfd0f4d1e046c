// One processor, its RAM and its input and output, for simulation.
//
// The processor is the module `processor` of the file processor_NAME that is
// compiled with this one. All have the same two ports here, one for
// instructions and one for data. `valid` high at a clock edge is one access,
// answered in the next cycle with `ready` high and the data read, or with
// `error` high beside it where nothing is mapped. A new access may be made in
// every cycle. This is the timing of a dual-port block RAM of an FPGA.
// Each processor's file states the cost of an access.
//
// Addresses
//   0x0000_0000  RAM, 256 KiB. Execution starts at 0.
//   0xF000_0000  PRINT         write: the low byte is printed
//   0xF000_0004  MARK          write: a number, logged with the clock cycle
//   0xF000_0008  EXIT          write: the run ends, 0 is success
//   0xF000_0010  PHOTON_STATUS read: bit 0 a word waits; bit 1 words were lost
//                              since the last read of this register;
//                              bits 31..16 how many words wait
//   0xF000_0014  PHOTON        read: takes the oldest word. Bits 15..0 TDC
//                              code, 23..16 pixel; bit 31: as many laser cycles
//                              end as in bits 15..0; 0xffff_ffff when none
//                              waits, 0xffff_fffe when none will come
//   0xF000_0018  EVENT_DATA    write: 32 bits of a 128-bit event word, least
//                              significant first; the last four are kept. Not to
//                              be written while REQ is high
//   0xF000_001C  EVENT_REQ     write 1: REQ rises, with the event word. write 0:
//                              REQ falls, and ACK with it.
//                              read: bit 0 ACK, high from the cycle after the
//                              link took the word until REQ falls
// Other writes do nothing, other reads give 0.
// Input and output registers take whole words only.
module soc #(
    parameter RAM_BITS = 16,        // log2 of the words of RAM
    parameter FIFO_DEPTH_LOG2 = 9   // log2 of the words of the photon FIFO
) (
    input               clk,
    input               reset,

    // The program is written into RAM here while `reset` is high.
    input               load_valid,
    input      [RAM_BITS-1:0] load_address, // in words
    input      [31:0]   load_data,

    // Photons, one word a cycle at most.
    input               photon_valid,
    input      [31:0]   photon_word,
    input               photon_finished, // none will come
    output              photon_lost,
    output     [FIFO_DEPTH_LOG2:0] photon_fill,
    output reg          photon_read,    // a photon register has been read

    // Writes of the program, one cycle after they were made.
    output reg          print_valid,
    output reg          mark_valid,
    output reg          exit_valid,
    output reg [31:0]   written,

    // The link takes an event word while REQ is high and ACK is not: `event_taken`
    // is high for one cycle, and ACK from then on.
    output reg          event_req,
    output reg          event_ack,
    output reg [127:0]  event_word,
    input               event_taken,

    output              retired,        // an instruction was completed
    output              fetch_filled,   // the instruction cache began to fill a line
    output              data_filled,    // the data cache did
    output              stopped,        // the processor has stopped for good
    output              unmapped        // it accessed an unmapped address and cannot report it
);
    // Instruction port.
    wire        fetch_valid;
    wire [31:0] fetch_address;
    reg         fetch_ready, fetch_error;
    reg  [31:0] fetch_data;

    // Data port. `data_strobe` names the bytes to write; 0 is a read.
    wire        data_valid;
    wire [31:0] data_address, data_write;
    wire [3:0]  data_strobe;
    reg         data_ready, data_error;
    wire [31:0] data_read;

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
    wire [2:0] register = data_address[4:2];
    wire unused = &{1'b0, fetch_address[1:0], data_address[1:0]};

    // RAM. The loader borrows the data port.
    reg [31:0] ram [0:(1 << RAM_BITS) - 1];
    reg [31:0] ram_read;
    wire [RAM_BITS-1:0] ram_address = load_valid ? load_address : data_address[RAM_BITS+1:2];
    wire [31:0] ram_write = load_valid ? load_data : data_write;
    wire [3:0] ram_strobe = load_valid ? 4'hf : (data_valid && data_ram && !reset) ? data_strobe : 4'h0;

    always @(posedge clk) begin
        fetch_ready <= fetch_valid && !reset;
        fetch_error <= fetch_valid && !fetch_ram && !reset;
        fetch_data <= ram[fetch_address[RAM_BITS+1:2]];

        data_ready <= data_valid && !reset;
        data_error <= data_valid && !data_ram && !data_io && !reset;
        ram_read <= ram[ram_address];
        if (ram_strobe[0]) ram[ram_address][7:0] <= ram_write[7:0];
        if (ram_strobe[1]) ram[ram_address][15:8] <= ram_write[15:8];
        if (ram_strobe[2]) ram[ram_address][23:16] <= ram_write[23:16];
        if (ram_strobe[3]) ram[ram_address][31:24] <= ram_write[31:24];
    end

    // Input and output.
    localparam PRINT = 0, MARK = 1, EXIT = 2, PHOTON_STATUS = 4, PHOTON = 5,
               EVENT_DATA = 6, EVENT_REQ = 7;

    wire io = data_valid && data_io && !reset;
    wire io_read = io && data_strobe == 0;
    wire io_write = io && data_strobe != 0;
    wire [31:0] photon_head;
    wire [15:0] photon_waiting = {{15 - FIFO_DEPTH_LOG2{1'b0}}, photon_fill};
    reg photon_lost_since;
    reg read_is_io;
    reg [31:0] io_data;

    assign data_read = read_is_io ? io_data : ram_read;

    photon_fifo #(.DEPTH_LOG2(FIFO_DEPTH_LOG2)) photons (
        .clk(clk),
        .reset(reset),
        .put(photon_valid),
        .word(photon_word),
        .finished(photon_finished),
        .take(io_read && register == PHOTON),
        .head(photon_head),
        .fill(photon_fill),
        .lost(photon_lost)
    );

    always @(posedge clk) begin
        print_valid <= io_write && register == PRINT;
        mark_valid <= io_write && register == MARK;
        exit_valid <= io_write && register == EXIT;
        if (io_write) written <= data_write;

        read_is_io <= io;
        case (register)
            PHOTON_STATUS: io_data <= {photon_waiting, 14'd0, photon_lost_since || photon_lost, photon_fill != 0};
            PHOTON: io_data <= photon_head;
            EVENT_REQ: io_data <= {31'd0, event_ack};
            default: io_data <= 0;
        endcase

        if (io_read && register == PHOTON_STATUS) photon_lost_since <= 0;
        else if (photon_lost) photon_lost_since <= 1;
        if (io_read && (register == PHOTON_STATUS || register == PHOTON)) photon_read <= 1;

        if (io_write && register == EVENT_DATA) event_word <= {data_write, event_word[127:32]};
        if (event_req && event_taken) event_ack <= 1;
        if (io_write && register == EVENT_REQ) begin
            event_req <= data_write[0];
            if (!data_write[0]) event_ack <= 0;
        end

        if (reset) begin
            photon_lost_since <= 0;
            photon_read <= 0;
            event_req <= 0;
            event_ack <= 0;
        end
    end
endmodule
