// Random words through photon_fifo.v and through a model of what its head comment
// says. Status 0 if both always agree, else 1.

#include <cstdint>
#include <cstdio>
#include <deque>
#include <random>

#include "Vphoton_fifo.h"
#include "verilated.h"

namespace {

constexpr size_t DEPTH = 8;
constexpr uint32_t END = 0x80000000;
constexpr uint32_t MOST_ENDS = 0xffff;

class Model {
public:
    uint32_t head(bool finished) const { return words_.empty() ? 0xffffffff - finished : words_.front(); }
    size_t fill() const { return words_.size(); }
    uint32_t newest() const { return words_.empty() ? 0 : words_.back(); }

    // One clock cycle; true if the word put was lost.
    bool clock(bool put, uint32_t word, bool take) {
        size_t before = words_.size();
        if (take && before) words_.pop_front();
        if (!put) return false;
        if (word & END && !words_.empty() && words_.back() & END && (words_.back() & MOST_ENDS) != MOST_ENDS) {
            words_.back()++;
            return false;
        }
        if (before >= (word & END ? DEPTH : DEPTH - 1)) return true;
        words_.push_back(word & END ? END | 1 : word);
        return false;
    }

private:
    std::deque<uint32_t> words_;
};

} // namespace

int main() {
    Verilated::randReset(2);
    Verilated::randSeed(1);
    Vphoton_fifo fifo;
    Model model;
    std::mt19937 random(1);
    fifo.reset = 1;
    for (fifo.clk = 0; fifo.clk <= 1; fifo.clk++) fifo.eval();
    fifo.reset = 0;
    // Phases of 1000 cycles: words come more and less often than they are taken.
    unsigned put_of_16 = 0, take_of_16 = 0, end_of_16 = 0, lost = 0, full = 0, most = 0, emptied = 0;
    for (unsigned cycle = 0; cycle < 1000000; cycle++) {
        // At last only ends, and nothing is taken: more than one word's number holds.
        bool ends = cycle >= 900000;
        if (cycle % 1000 == 0) {
            put_of_16 = random() % 17;
            take_of_16 = ends ? 0 : random() % 17;
            end_of_16 = ends ? 16 : random() % 17;
            if (ends) put_of_16 = 16;
        }
        bool end = random() % 16 < end_of_16;
        fifo.put = random() % 16 < put_of_16;
        fifo.word = end ? END | random() : random() & 0x00ffffff;
        fifo.take = random() % 16 < take_of_16;
        fifo.finished = random() % 2;
        fifo.clk = 0;
        fifo.eval();
        bool head = fifo.head == model.head(fifo.finished);
        bool is_lost = model.clock(fifo.put, fifo.word, fifo.take);
        fifo.clk = 1;
        fifo.eval();
        if (!head || fifo.lost != is_lost || fifo.fill != model.fill()) {
            std::printf("photon FIFO: not as the model in cycle %u\n", cycle);
            return 1;
        }
        lost += is_lost;
        full += model.fill() == DEPTH;
        most += model.newest() == (END | MOST_ENDS);
        emptied += fifo.take && !model.fill();
    }
    std::printf("photon FIFO: as the model; %u words lost, full in %u cycles\n", lost, full);
    // What is hard to meet was met.
    return lost && full && most && emptied ? 0 : 1;
}
