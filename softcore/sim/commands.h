// The commands of a simulation and its answers, for a program at the other ends of the pipes:
// softcore/runner/src/pixels/command.rs.
//
// Standard input, words of 32 bits, little-endian: one a clock,
//   bits 15..0  TDC code, 23..16 macropixel
//   bit 24      there is a photon
//   bit 25      the laser cycle ends
//   bit 26      the link takes a word if one waits
//   bit 27      a bus access follows in two more words: address, with bit 31 set if it is
//               written, and data. Accesses wait for those before them.
//   bit 28      reset
// Standard output, six words each: what happened, the clock, and up to four words more:
//   0 a look begins; 1 an event leaves: macropixel; 2 an AER word is taken: the word, least
//   significant part first; 3 a register is read: address, data; 4 the end: whether a word
//   waits.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace commands {

enum Happened : uint32_t { LOOK, LEAVES, WORD, READ, END };

inline bool next(uint32_t &word) {
    static std::vector<uint32_t> words(1 << 16);
    static size_t first = 0, end = 0;
    if (first == end) {
        first = 0;
        end = std::fread(words.data(), 4, words.size(), stdin);
        if (end == 0) return false;
    }
    word = words[first++];
    return true;
}

inline void tell(Happened what, uint32_t clock, uint32_t a = 0, uint32_t b = 0, uint32_t c = 0, uint32_t d = 0) {
    static std::vector<uint32_t> words;
    words.insert(words.end(), {what, clock, a, b, c, d});
    if (words.size() < 1 << 14 && what != END) return;
    if (std::fwrite(words.data(), 4, words.size(), stdout) != words.size() || std::fflush(stdout)) std::exit(2);
    words.clear();
}

} // namespace commands
