// The pixel processor behind photon_crossing, with clocks of any periods of which `clk` is not the
// slower, against one that has the clock of the photons: softcore/sim/two_clocks.v. Status 0 if both
// have the same words and counts, else 1.

#include <array>
#include <cstdint>
#include <cstdio>
#include <random>
#include <vector>

#include "Vtwo_clocks.h"
#include "verilated.h"

namespace {

constexpr unsigned RUNS = 200;
constexpr unsigned CYCLES = 2000; // laser cycles of a run
constexpr unsigned REST = 400;    // clocks until all words are out
constexpr unsigned PATIENCE = 1000;
// Registers, and what docs/softcore.md writes to them.
constexpr uint8_t CONTROL = 0x00, LOOK = 0x01, COUNTS = 0x40;
constexpr std::array<uint32_t, 5> SETTINGS{0x00280004, 0x000007D0, 0x00050400, 0x60402000, 0x00000080};
constexpr uint32_t RUN = 3, COUNTING = 4;
constexpr uint8_t LATE = 20, ALL = 24; // words of COUNTS

using Word = std::array<uint32_t, 4>;

struct Both {
    Vtwo_clocks top;
    unsigned half = 1, tdc_half = 1; // of the periods
    uint64_t at = 0, tdc_at = 0;
    std::vector<Word> words, other_words;
    bool acked = false, other_acked = false;
    uint32_t read = 0, other_read = 0;

    // Goes to the next edge. Whether `clk` rose, and the photons' clock.
    std::array<bool, 2> edge() {
        uint64_t now = at < tdc_at ? at : tdc_at;
        bool rises = now == at && !top.clk, tdc_rises = now == tdc_at && !top.tdc_clk;
        if (rises) {
            if (top.word_valid) words.push_back({top.word[0], top.word[1], top.word[2], top.word[3]});
            if (top.wb_ack) acked = true, read = top.wb_dat_o;
        }
        if (tdc_rises) {
            if (top.other_word_valid)
                other_words.push_back({top.other_word[0], top.other_word[1], top.other_word[2], top.other_word[3]});
            if (top.other_ack) other_acked = true, other_read = top.other_dat_o;
        }
        if (now == at) top.clk = !top.clk, at += half;
        if (now == tdc_at) top.tdc_clk = !top.tdc_clk, tdc_at += tdc_half;
        top.eval();
        return {rises, tdc_rises};
    }

    void tdc_clocks(unsigned clocks) {
        while (clocks) clocks -= edge()[1];
    }

    // Resets come from flip-flops of their clocks.
    void resets(bool on) {
        while (!edge()[0]) {}
        top.reset = on;
        while (!edge()[1]) {}
        top.other_reset = on;
    }

    // Whether both answer.
    bool access(uint8_t address, bool writes, uint32_t data = 0) {
        acked = other_acked = false;
        top.wb_cyc = 1, top.wb_we = writes, top.wb_adr = address, top.wb_dat_i = data;
        for (unsigned edges = 0; edges < PATIENCE && !(acked && other_acked); edges++) edge();
        top.wb_cyc = 0;
        tdc_clocks(4);
        return acked && other_acked;
    }
};

int fail(const char *what, unsigned run) {
    std::printf("two clocks: %s in run %u\n", what, run);
    return 1;
}

} // namespace

int main() {
    Verilated::randReset(2);
    Verilated::randSeed(1);
    std::mt19937 random(1);
    Both both;
    Vtwo_clocks &top = both.top;
    uint64_t photons = 0, words = 0;
    for (unsigned run = 0; run < RUNS; run++) {
        // Every fourth time the same, which meets edges at once.
        both.half = 2 + random() % 30;
        both.tdc_half = random() % 4 ? both.half + random() % 30 : both.half;
        both.at += random() % both.half;
        both.tdc_at = both.at + random() % both.tdc_half;
        // Photons in a reset and after it, while nothing runs, do not count.
        auto photon = [&](unsigned photons_of_16) {
            top.tdc_valid = random() % 16 < photons_of_16;
            top.tdc_pixel = random() % 8 ? random() % 4 : random() % 256;
            top.tdc_code = random() % 16 ? random() % 128 : random() % 65536;
            if (random() % 4 == 0) top.tdc_code = 16 + 30 * (top.tdc_pixel & 3);
        };
        both.resets(true);
        for (unsigned clocks = 0; clocks < 40; clocks++) {
            if (clocks == 12) both.resets(false);
            photon(8);
            top.tdc_cycle_end = random() % 8 == 0;
            both.tdc_clocks(1);
        }
        top.tdc_valid = top.tdc_cycle_end = 0;
        both.tdc_clocks(REST);
        both.words.clear(), both.other_words.clear();
        bool answers = true;
        for (size_t i = 0; i < SETTINGS.size(); i++) answers &= both.access(LOOK + i, true, SETTINGS[i]);
        answers &= both.access(CONTROL, true, RUN);
        for (unsigned i = 0; i < PATIENCE && !(both.read & both.other_read & COUNTING); i++)
            answers &= both.access(CONTROL, false);
        if (!answers || !(both.read & both.other_read & COUNTING)) return fail("it does not run", run);
        uint16_t lost = top.lost;

        unsigned photons_of_16 = 1 + random() % 16;
        for (unsigned cycle = 0; cycle < CYCLES; cycle++) {
            // Looks come every fourth one; a look of four events takes 26 clocks.
            for (unsigned left = 8 + random() % 16; left; left--) {
                photon(photons_of_16);
                top.tdc_cycle_end = left == 1;
                photons += top.tdc_valid;
                both.tdc_clocks(1);
            }
        }
        top.tdc_valid = top.tdc_cycle_end = 0;
        both.tdc_clocks(REST);
        if (top.lost != lost || top.end_lost) return fail("something is lost", run);
        if (both.words != both.other_words) return fail("other words", run);
        words += both.words.size();
        for (uint8_t count = 0; count < ALL; count++) {
            if (!both.access(COUNTS + count, false) || both.read != both.other_read) return fail("other counts", run);
            if (count == LATE && both.read) return fail("a look is late", run);
        }
    }
    std::printf("two clocks: %llu photons, %llu words\n", static_cast<unsigned long long>(photons),
                static_cast<unsigned long long>(words));
    top.final();
    return words > 1 << 14 ? 0 : fail("too few words", RUNS);
}
