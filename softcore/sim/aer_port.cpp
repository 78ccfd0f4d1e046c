// Random words through aer_port.v to a receiver that is fast, slow, or anything between.
// Status 0 if each word comes once, whole and in order, and each half word with all four
// phases; else 1.

#include <cstdint>
#include <cstdio>
#include <deque>
#include <random>

#include "Vaer_port.h"
#include "verilated.h"

namespace {

constexpr unsigned WORDS = 20000, HALVES = 8;
constexpr unsigned FASTEST = 6; // clocks a half word, to a receiver that answers at once

int fail(const char *what, unsigned cycle) {
    std::printf("AER port: %s in cycle %u\n", what, cycle);
    return 1;
}

} // namespace

int main() {
    Verilated::randReset(2);
    Verilated::randSeed(1);
    Vaer_port port;
    std::mt19937 random(1);
    port.aer_ack = 0;
    port.word_valid = 0;
    port.reset = 1;
    for (int i = 0; i < 8; i++) port.clk = i % 2, port.eval();
    port.reset = 0;

    std::deque<uint16_t> expected;
    unsigned taken = 0, halves = 0, wait = 0, slowest = 0, last = 0, fastest = UINT32_MAX;
    uint16_t before = 0;
    for (unsigned cycle = 0; halves < WORDS * HALVES; cycle++) {
        if (cycle % 1000 == 0) slowest = random() % 4 ? random() % 20 : 0;
        if (cycle == 100 * WORDS * HALVES) return fail("stands still", cycle);
        // A word waits until it is taken, then another comes, at once or later.
        if (!port.word_valid && taken < WORDS && (slowest == 0 || random() % 8 == 0)) {
            port.word_valid = 1;
            for (int i = 0; i < 4; i++) port.word[i] = random();
        }
        port.clk = 0;
        port.eval();
        bool is_taken = port.word_taken;
        if (is_taken && (!port.word_valid || !expected.empty())) return fail("takes a word too soon", cycle);
        if (is_taken)
            for (unsigned i = 0; i < HALVES; i++) expected.push_back(port.word[i / 2] >> 16 * (i % 2));
        bool req = port.aer_req;
        port.clk = 1;
        port.eval();
        if (is_taken) taken++, port.word_valid = 0;

        // The receiver, which is no part of the clock.
        if (!req && port.aer_req && port.aer_ack) return fail("REQ rises with ACK", cycle);
        if (req && !port.aer_req && !port.aer_ack) return fail("REQ falls without ACK", cycle);
        if (!req && port.aer_req && port.aer_data != before) return fail("a half word comes late", cycle);
        before = port.aer_data;
        if (port.aer_req == port.aer_ack) continue;
        if (wait < slowest && random() % (slowest + 1)) {
            wait++;
            continue;
        }
        wait = 0;
        port.aer_ack = port.aer_req;
        if (!port.aer_ack) continue;
        if (expected.empty() || port.aer_data != expected.front()) return fail("another half word", cycle);
        if (port.aer_first != (expected.size() == HALVES)) return fail("first half word", cycle);
        expected.pop_front();
        if (!port.aer_first && cycle - last < fastest) fastest = cycle - last;
        last = cycle;
        halves++;
    }
    if (!expected.empty()) return fail("a word is cut", 0);
    std::printf("AER port: %u words, at best a half word in %u clocks\n", taken, fastest);
    return fastest == FASTEST ? 0 : 1;
}
