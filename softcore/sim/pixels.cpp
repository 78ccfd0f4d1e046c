// The pixel processor alone, clock by clock, as commands.h has it.

#include <deque>

#include "Vpixels.h"
#include "commands.h"
#include "verilated.h"

namespace {

constexpr uint32_t WAITING = 0x08;

struct Access {
    uint32_t address, data;
};

using namespace commands;

} // namespace

int main(int argc, char **argv) {
    Verilated::commandArgs(argc, argv);
    // What nothing has written, memory included, holds anything; the same every time.
    Verilated::randReset(2);
    Verilated::randSeed(1);
    Vpixels pixels;
    pixels.reset = 1;
    for (int i = 0; i < 8; i++) {
        pixels.clk = i & 1;
        pixels.eval();
    }
    pixels.reset = 0;

    std::deque<Access> accesses;
    uint32_t clock = 0, command;
    bool waits = false;
    for (; next(command); clock++) {
        if (command >> 27 & 1) {
            Access access;
            if (!next(access.address) || !next(access.data)) return 2;
            accesses.push_back(access);
        }
        pixels.photon_code = command & 0xffff;
        pixels.photon_pixel = command >> 16 & 0xff;
        pixels.photon_valid = command >> 24 & 1;
        pixels.cycle_end = command >> 25 & 1;
        pixels.reset = command >> 28 & 1;

        // The answer to the access that is under way.
        if (pixels.wb_ack) {
            if (!pixels.wb_we) tell(READ, clock, pixels.wb_adr, pixels.wb_dat_o);
            if (pixels.wb_adr == WAITING) waits = !pixels.wb_we && pixels.wb_dat_o & 1;
            accesses.pop_front();
        }
        // As a program does, an event is taken if it was there when its registers were read.
        while (!waits && !accesses.empty() && accesses.front().address == (1u << 31 | WAITING)) accesses.pop_front();
        pixels.wb_cyc = pixels.wb_stb = !accesses.empty();
        if (!accesses.empty()) {
            pixels.wb_we = accesses.front().address >> 31;
            pixels.wb_adr = accesses.front().address & 0xff;
            pixels.wb_dat_i = accesses.front().data;
        }

        pixels.word_taken = pixels.word_valid && command >> 26 & 1;
        if (pixels.word_taken) tell(WORD, clock, pixels.word[0], pixels.word[1], pixels.word[2], pixels.word[3]);
        pixels.clk = 0;
        pixels.eval();
        pixels.clk = 1;
        pixels.eval();
        if (pixels.look_begins) tell(LOOK, clock);
        if (pixels.event_leaves) tell(LEAVES, clock, pixels.event_pixel);
    }
    tell(END, clock, pixels.word_valid);
    pixels.final();
    return 0;
}
