// Runs an image on one processor in simulation.
//
// Standard output: what the program prints and a line `event HEX` an event word, its
// most significant digit first.
// Standard error: marks (with the cycles, the instructions and the lines that the two
// caches have filled until then), the end of the run, what became of the photons.
// Status: what the program wrote to EXIT, 250 if that is 256 or more, as after a
// trap; 250 when the processor stopped by itself; 2 at the limit of cycles; 3 for bad
// arguments or files.

#include <algorithm>
#include <cerrno>
#include <cinttypes>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "Vsoc.h"
#include "verilated.h"

namespace {

constexpr size_t RAM_BYTES = 256 * 1024;
constexpr int TRAP = 250;
constexpr int LIMIT = 2;
constexpr uint32_t END_OF_CYCLE = 0x80000001; // one laser cycle
constexpr size_t PARTS = 10;                  // of a stream; the fill of the FIFO is reported for each

[[noreturn]] void fail(const std::string &message) {
    std::fprintf(stderr, "%s\n", message.c_str());
    std::exit(3);
}

struct Options {
    std::string image, stream;
    uint64_t cycles = UINT64_MAX;
    uint64_t clocks_per_laser_cycle = 10; // 10 MHz laser, 100 MHz processor
    uint64_t acknowledge_after = 0;
};

struct Photon {
    uint64_t cycle;
    uint32_t word;
};

uint64_t number(const char *name, const char *text) {
    char *end;
    errno = 0;
    uint64_t value = std::strtoull(text, &end, 10);
    if (*text < '0' || *text > '9' || *end || errno) fail(std::string(name) + ": not a number: " + text);
    return value;
}

Options parse(int argc, char **argv) {
    Options options;
    for (int i = 1; i < argc; i++) {
        std::string name = argv[i];
        if (name.rfind("--", 0) != 0) {
            if (!options.image.empty()) fail("more than one image");
            options.image = name;
            continue;
        }
        if (++i == argc) fail(name + ": value missing");
        if (name == "--stream") options.stream = argv[i];
        else if (name == "--cycles") options.cycles = number("--cycles", argv[i]);
        else if (name == "--clocks-per-laser-cycle") options.clocks_per_laser_cycle = number(argv[i - 1], argv[i]);
        else if (name == "--acknowledge-after") options.acknowledge_after = number(argv[i - 1], argv[i]);
        else fail("unknown option " + name);
    }
    if (options.image.empty())
        fail("usage: sim IMAGE [--cycles LIMIT] [--stream FILE] [--clocks-per-laser-cycle N] [--acknowledge-after N]");
    if (options.clocks_per_laser_cycle == 0) fail("--clocks-per-laser-cycle: 0");
    return options;
}

std::ifstream open(const std::string &path) {
    std::ifstream file(path, std::ios::binary);
    if (!file || std::filesystem::is_directory(path)) fail(path + ": cannot read");
    return file;
}

std::vector<uint8_t> read_image(const std::string &path) {
    std::ifstream file = open(path);
    std::vector<uint8_t> bytes((std::istreambuf_iterator<char>(file)), {});
    if (bytes.empty()) fail(path + ": empty");
    if (std::string(bytes.begin(), bytes.begin() + std::min<size_t>(bytes.size(), 4)) == "\x7f" "ELF")
        fail(path + ": an ELF file, not memory from address 0 on");
    if (bytes.size() > RAM_BYTES) fail(path + ": larger than RAM");
    bytes.resize((bytes.size() + 3) / 4 * 4);
    return bytes;
}

// Lines `cycle pixel code`: laser cycle (not decreasing), pixel 0..255, TDC code.
std::vector<Photon> read_stream(const std::string &path) {
    std::vector<Photon> photons;
    std::ifstream file = open(path);
    std::string line;
    for (size_t n = 1; std::getline(file, line); n++) {
        if (line.empty() || line[0] == '#') continue;
        std::istringstream fields(line);
        int64_t cycle, pixel, code;
        std::string rest;
        if (!(fields >> cycle >> pixel >> code) || fields >> rest || cycle < 0 || pixel < 0 || pixel > 255
            || code < 0 || code > 0xffff || (!photons.empty() && uint64_t(cycle) < photons.back().cycle))
            fail(path + ": line " + std::to_string(n) + ": not `cycle pixel code`, or out of order");
        photons.push_back({uint64_t(cycle), uint32_t(pixel << 16 | code)});
    }
    if (photons.empty()) fail(path + ": no photons");
    return photons;
}

// The laser and its pixels. The first laser cycle starts when the program first
// reads a photon register. At the end of each laser cycle its photons go to the
// FIFO, one a clock cycle, then the end word. Photons that still wait at the end of
// the next laser cycle are lost. After the last photon's laser cycle the laser is
// off.
class Laser {
public:
    Laser(std::vector<Photon> photons, uint64_t clocks) : photons_(std::move(photons)), clocks_(clocks) {
        std::fill(std::begin(lowest_), std::end(lowest_), UINT64_MAX);
    }

    // To be called once a clock cycle, after the rising edge.
    void clock(Vsoc &soc) {
        if (soc.photon_lost) (put_ == END_OF_CYCLE ? ends_lost_ : lost_)++;
        if (soc.photon_fill > highest_) highest_ = soc.photon_fill;
        if (soc.photon_read && next_ < photons_.size()) {
            uint64_t &lowest = lowest_[PARTS * cycle_ / (photons_.back().cycle + 1)];
            if (soc.photon_fill < lowest) lowest = soc.photon_fill;
        }
        if (soc.photon_read && next_ < photons_.size() && ++phase_ == clocks_) end_of_cycle();
        soc.photon_valid = !waiting_.empty();
        soc.photon_finished = waiting_.empty() && next_ == photons_.size();
        if (!waiting_.empty()) {
            soc.photon_word = put_ = waiting_.front();
            waiting_.pop_front();
        }
    }

    void report() const {
        std::fprintf(stderr, "fifo: %zu photons, %" PRIu64 " lost, highest fill %" PRIu64 "\n", sent_, lost_, highest_);
        std::fprintf(stderr, "fifo: %" PRIu64 " laser cycles, %" PRIu64 " lost\n", cycle_, ends_lost_);
        std::fprintf(stderr, "fifo: lowest fill of each tenth");
        for (uint64_t lowest : lowest_) std::fprintf(stderr, " %" PRIu64, lowest);
        std::fprintf(stderr, "\n");
    }

private:
    void end_of_cycle() {
        phase_ = 0;
        size_t before = waiting_.size();
        waiting_.erase(std::remove_if(waiting_.begin(), waiting_.end(), [](uint32_t word) { return word != END_OF_CYCLE; }),
                       waiting_.end());
        lost_ += before - waiting_.size();
        for (; next_ < photons_.size() && photons_[next_].cycle == cycle_; next_++, sent_++)
            waiting_.push_back(photons_[next_].word);
        waiting_.push_back(END_OF_CYCLE);
        cycle_++;
    }

    std::vector<Photon> photons_;
    std::deque<uint32_t> waiting_;
    uint64_t clocks_, phase_ = 0, cycle_ = 0, lost_ = 0, ends_lost_ = 0, highest_ = 0;
    size_t next_ = 0, sent_ = 0;
    uint64_t lowest_[PARTS];
    uint32_t put_ = 0; // the last word put into the FIFO
};

// The link: takes an event word a number of cycles after REQ rose, and answers with ACK.
class Link {
public:
    explicit Link(uint64_t after) : after_(after) {}

    void clock(Vsoc &soc) {
        bool asked = soc.event_req && !soc.event_ack;
        soc.event_taken = asked && waited_ == after_;
        waited_ = asked && !soc.event_taken ? waited_ + 1 : 0;
        if (!soc.event_taken) return;
        std::printf("event %08x%08x%08x%08x\n", soc.event_word[3], soc.event_word[2], soc.event_word[1], soc.event_word[0]);
    }

private:
    uint64_t after_, waited_ = 0;
};

void clock(Vsoc &soc) {
    soc.clk = 0;
    soc.eval();
    soc.clk = 1;
    soc.eval();
}

void load(Vsoc &soc, const std::vector<uint8_t> &image) {
    soc.reset = 1;
    soc.load_valid = 1;
    for (size_t i = 0; i < image.size(); i += 4) {
        soc.load_address = i / 4;
        soc.load_data = image[i] | image[i + 1] << 8 | image[i + 2] << 16 | uint32_t(image[i + 3]) << 24;
        clock(soc);
    }
    soc.load_valid = 0;
    for (int i = 0; i < 16; i++) clock(soc);
    soc.reset = 0;
}

int run(Vsoc &soc, const Options &options, Laser &laser) {
    Link link(options.acknowledge_after);
    uint64_t instructions = 0, code = 0, data = 0;
    for (uint64_t cycle = 1; cycle <= options.cycles; cycle++) {
        clock(soc);
        instructions += soc.retired;
        code += soc.fetch_filled;
        data += soc.data_filled;
        if (soc.print_valid) std::putchar(soc.written & 0xff);
        if (soc.mark_valid)
            std::fprintf(stderr, "mark %u cycle %" PRIu64 " instructions %" PRIu64 " code %" PRIu64 " data %" PRIu64 "\n",
                         soc.written, cycle, instructions, code, data);
        if (soc.exit_valid) {
            std::fprintf(stderr, "exit 0x%x cycle %" PRIu64 " instructions %" PRIu64 "\n", soc.written, cycle, instructions);
            return soc.written < 256 ? soc.written : TRAP;
        }
        if (soc.stopped || soc.unmapped) {
            std::fprintf(stderr, "%s cycle %" PRIu64 " instructions %" PRIu64 "\n",
                         soc.unmapped ? "no memory at that address" : "the processor stops", cycle, instructions);
            return TRAP;
        }
        link.clock(soc);
        laser.clock(soc);
    }
    std::fprintf(stderr, "cycle limit\n");
    return LIMIT;
}

} // namespace

int main(int argc, char **argv) {
    Options options = parse(argc, argv);
    Verilated::commandArgs(argc, argv);
    // What nothing has written, memory included, holds anything; the same every time.
    Verilated::randReset(2);
    Verilated::randSeed(1);
    std::vector<uint8_t> image = read_image(options.image);
    Laser laser(options.stream.empty() ? std::vector<Photon>() : read_stream(options.stream), options.clocks_per_laser_cycle);
    Vsoc soc;
    load(soc, image);
    int result = run(soc, options, laser);
    if (!options.stream.empty()) laser.report();
    soc.final();
    return result;
}
