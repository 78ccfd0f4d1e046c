// Histograms through the comparator tree.
//
// Argument: a file with a decision a line, of 130 numbers: alpha in 1/256, the least count,
// 128 counts. Standard output: a line a decision, of peak bin, peak count, the four
// quadrants' maxima, background, root, event (0 or 1), clocks from start to done at the
// tree's own ports. Each is presented twice, as close together as the tree allows. Status
// 1 if it then decides otherwise, 3 for a bad argument or file.

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

#include "Vplace_tree.h"
#include "verilated.h"

namespace {

constexpr unsigned BINS = 128;
constexpr unsigned READS = BINS / LANES;
constexpr unsigned PATIENCE = 1000;
constexpr unsigned REGISTERS = 2; // before and after the tree

void clock(Vplace_tree &tree) {
    tree.clk = 0;
    tree.eval();
    tree.clk = 1;
    tree.eval();
}

std::string answer(const Vplace_tree &tree) {
    std::ostringstream text;
    text << unsigned(tree.peak_bin) << ' ' << tree.peak_count;
    for (unsigned quadrant = 0; quadrant < 4; quadrant++) text << ' ' << (tree.quadrants >> 10 * quadrant & 0x3ff);
    text << ' ' << tree.background << ' ' << unsigned(tree.root) << ' ' << unsigned(tree.event_found);
    return text.str();
}

} // namespace

int main(int argc, char **argv) {
    if (argc != 2) return std::fprintf(stderr, "usage: sim FILE\n"), 3;
    std::ifstream file(argv[1]);
    Verilated::randReset(2);
    Verilated::randSeed(1);
    Vplace_tree tree;
    tree.write = tree.start = 0;
    tree.reset = 1;
    for (int i = 0; i < 4; i++) clock(tree);
    tree.reset = 0;
    unsigned alpha, least, count;
    while (file >> alpha >> least) {
        tree.alpha = alpha;
        tree.least = least;
        tree.write = 1;
        for (unsigned bin = 0; bin < BINS; bin++) {
            if (!(file >> count)) return std::fprintf(stderr, "%s: ends in a line\n", argv[1]), 3;
            tree.write_bin = bin;
            tree.write_count = count;
            clock(tree);
        }
        tree.write = 0;
        std::string answers[2];
        unsigned clocks = 0, done = 0, took = 0;
        for (; done < 2; clocks++) {
            if (clocks == PATIENCE) return std::fprintf(stderr, "no decision\n"), 3;
            tree.start = clocks == 0 || clocks == READS;
            clock(tree);
            if (!tree.done) continue;
            if (done == 0) took = clocks + 1;
            else if (clocks + 1 - took != READS) return std::fprintf(stderr, "the second comes late\n"), 1;
            answers[done++] = answer(tree);
        }
        if (answers[0] != answers[1]) return std::fprintf(stderr, "%s, then %s\n", answers[0].c_str(), answers[1].c_str()), 1;
        std::printf("%s %u\n", answers[0].c_str(), took - REGISTERS);
    }
    return file.eof() ? 0 : (std::fprintf(stderr, "%s: cannot read\n", argv[1]), 3);
}
