// Photons and ends of laser cycles through photon_crossing.v, with two clocks of any periods.
// Status 0 if what comes out is in order and in its laser cycle, all else is counted as lost, and
// nothing is lost while `clk` is not slower; else 1.

#include <cstdint>
#include <cstdio>
#include <random>
#include <vector>

#include "Vphoton_crossing.h"
#include "verilated.h"

namespace {

constexpr unsigned PHASES = 4000;
constexpr unsigned CLOCKS = 200; // of the photons in a phase: fewer ends than may be pending
constexpr unsigned REST = 400;   // of both, until the slower one has all

struct Sent {
    uint32_t cycle;
    uint64_t clock;
    bool is_alone; // nothing waited
};

int fail(const char *what, unsigned phase) {
    std::printf("photon crossing: %s in phase %u\n", what, phase);
    return 1;
}

} // namespace

int main() {
    Verilated::randReset(2);
    Verilated::randSeed(1);
    Vphoton_crossing crossing;
    std::mt19937 random(1);
    crossing.photon_valid = crossing.photon_cycle_end = 0;
    crossing.reset = 1;
    for (unsigned i = 0; i < 16; i++) crossing.clk = crossing.photon_clk = i % 2, crossing.eval();
    crossing.reset = 0;
    for (unsigned i = 0; i < 16; i++) crossing.clk = crossing.photon_clk = i % 2, crossing.eval();

    // The number of a photon is its code; 24 bits hold all.
    std::vector<Sent> sent;
    size_t received = 0, lost = 0;
    uint64_t clock = 0, longest = 0, alone = 0;
    uint32_t cycle = 0, cycle_out = 0;
    uint16_t told = 0;
    for (unsigned phase = 0; phase < PHASES; phase++) {
        // Half periods; every fourth time the same, which meets edges at once.
        unsigned half = 2 + random() % 30, photon_half = random() % 4 ? 2 + random() % 30 : half;
        unsigned photons_of_16 = 1 + random() % 16, ends_of_16 = random() % 17;
        bool may_lose = photon_half < half;
        uint64_t at = random() % half, photon_at = random() % photon_half;
        for (unsigned clocks = 0, rest = 0; rest < 2 * REST;) {
            uint64_t now = at < photon_at ? at : photon_at;
            bool ticks = now == at && !crossing.clk, photon_ticks = now == photon_at && !crossing.photon_clk;
            if (now == photon_at) {
                crossing.photon_clk = !crossing.photon_clk;
                photon_at += photon_half;
            }
            if (now == at) {
                crossing.clk = !crossing.clk;
                at += half;
            }
            crossing.eval();
            if (photon_ticks) {
                // What this clock took, and what the next one will.
                clocks++;
                bool is_alone = received == sent.size() && cycle_out == cycle && !crossing.cycle_end;
                if (crossing.photon_valid) sent.push_back({cycle, clock + ticks, is_alone});
                cycle += crossing.photon_cycle_end;
                crossing.photon_valid = clocks < CLOCKS && random() % 16 < photons_of_16;
                crossing.photon_cycle_end = clocks < CLOCKS && random() % 16 < ends_of_16;
                crossing.photon = sent.size() & 0xffffff;
                crossing.eval();
            }
            if (clocks >= CLOCKS) rest += ticks;
            if (!ticks) continue;
            clock++;
            if (crossing.valid) {
                if (crossing.crossed < received || crossing.crossed >= sent.size()) return fail("a wrong photon", phase);
                const Sent &photon = sent[crossing.crossed];
                if (photon.cycle != cycle_out) return fail("another laser cycle", phase);
                uint64_t delay = clock - photon.clock;
                if (photon.is_alone) {
                    // In hardware a bit that is taken late makes it four.
                    if (delay != 3) return fail("a photon alone does not take three clocks", phase);
                    alone++;
                }
                if (!may_lose && delay > longest) longest = delay;
                lost += crossing.crossed - received;
                received = crossing.crossed + 1;
            }
            cycle_out += crossing.cycle_end;
        }
        lost += sent.size() - received;
        received = sent.size();
        if (cycle_out != cycle || crossing.end_lost) return fail("an end is lost", phase);
        if (uint16_t(lost) != crossing.lost) return fail("a photon is lost and not counted", phase);
        if (!may_lose && crossing.lost != told) return fail("a photon is lost", phase);
        told = crossing.lost;
    }
    std::printf("photon crossing: %zu photons and %u laser cycles, %zu photons lost where the clock is slower, "
                "at most %llu clocks where it is not; %llu photons alone, three clocks each\n",
                sent.size(), cycle, lost, static_cast<unsigned long long>(longest),
                static_cast<unsigned long long>(alone));
    return lost > 1 << 16 && alone > 1 << 10 ? 0 : 1;
}
