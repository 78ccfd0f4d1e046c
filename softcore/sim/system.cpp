// The whole system with a program, clock by clock, as commands.h has it. Commands begin when
// the program makes its first mark. What the program prints goes to standard error.
//
// The receiver of the AER port raises and lowers ACK in clocks in which the link takes words: in
// all, or at random. A word is reported when it is complete, with the
// clock in which REQ rose for its first half word.

#include "Vsystem.h"
#include "commands.h"
#include "verilated.h"

using namespace commands;

namespace {

// Far more than a program takes before it is ready.
constexpr uint32_t PATIENCE = 1000000;

// The receiver of the AER port.
class Receiver {
public:
    void clock(Vsystem &system, uint32_t clock, bool answers) {
        if (system.aer_req && !had_req_ && system.aer_first) {
            first_ = clock;
            halves_ = 0;
        }
        had_req_ = system.aer_req;
        if (!answers) return;
        if (system.aer_req && !system.aer_ack) {
            uint32_t &part = word_[halves_ / 2 % 4];
            part = halves_ % 2 ? part | uint32_t(system.aer_data) << 16 : system.aer_data;
            if (++halves_ == 8) tell(WORD, first_, word_[0], word_[1], word_[2], word_[3]);
        }
        system.aer_ack = system.aer_req;
    }

    bool waits() const { return halves_ % 8 != 0; }

private:
    uint32_t word_[4] = {}, first_ = 0, halves_ = 0;
    bool had_req_ = false;
};

void edge(Vsystem &system) {
    system.clk = 0;
    system.eval();
    system.clk = 1;
    system.eval();
}

} // namespace

int main(int argc, char **argv) {
    Verilated::commandArgs(argc, argv);
    Verilated::randReset(2);
    Verilated::randSeed(1);
    Vsystem system;
    system.reset = 1;
    for (int i = 0; i < 8; i++) edge(system);
    system.reset = 0;
    uint32_t waited = 0;
    for (; !system.mark_valid; waited++) {
        edge(system);
        if (system.print_valid) std::fputc(system.written & 0xff, stderr);
        if (waited == PATIENCE || system.exit_valid || system.unmapped) {
            std::fprintf(stderr, "the program is not ready\n");
            return 2;
        }
    }
    Receiver receiver;
    uint32_t clock = 0, command;
    for (; next(command); clock++) {
        system.photon_code = command & 0x7f;
        system.photon_pixel = command >> 16 & 0x3f;
        system.photon_valid = command >> 24 & 1;
        system.photon_cycle_end = command >> 25 & 1;
        edge(system);
        receiver.clock(system, clock, command >> 26 & 1);
        if (system.print_valid) std::fputc(system.written & 0xff, stderr);
        if (system.look_begins) tell(LOOK, clock);
        if (system.event_leaves) tell(LEAVES, clock, system.event_pixel);
        if (system.exit_valid || system.unmapped) {
            std::fprintf(stderr, "the program ends\n");
            return 2;
        }
    }
    tell(END, clock, receiver.waits());
    system.final();
    return 0;
}
