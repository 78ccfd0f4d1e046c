/* Counts the instructions of the operations. In QEMU with `-icount shift=8` an instruction takes
 * 256 ns, and the timer advances every 40 ns. See docs/results/bench/README.md. */
#include <stddef.h>

#include "operations.h"
#include "platform.h"

#define EXPOSURES 64u
#define CYCLES 44u

uint16_t codes[PHOTONS];
uint8_t packed[32];

typedef uint32_t operation(uint32_t number);

static volatile uint32_t *const systick = (volatile uint32_t *)0xe000e010;
static uint32_t overhead;

__attribute__((noinline)) static uint32_t measure(operation *of, uint32_t number, uint32_t *gave)
{
    uint32_t before = systick[2];
    *gave = of(number);
    uint32_t after = systick[2];
    return ((((before - after) & 0xffffff) * 5 + 16) / 32) - overhead;
}

__attribute__((naked)) static uint32_t only_return(uint32_t number)
{
    (void)number;
    __asm__("bx lr");
}

__attribute__((naked)) static uint32_t hundred(uint32_t number)
{
    (void)number;
    __asm__(".rept 99\n\tnop\n\t.endr\n\tbx lr");
}

static uint32_t drawn;

static uint16_t below(uint32_t limit)
{
    drawn = drawn * 1664525u + 1013904223u;
    return (uint16_t)(((drawn >> 16) * limit) >> 16);
}

/* Draws the photons of exposure `number`: background, and with a target every sixth photon in its
 * bin or the next. */
static void draw(uint32_t number, int target)
{
    drawn = number * 977 + 1;
    uint16_t bin = (uint16_t)(below(120) + 4);
    for (uint32_t index = 0; index < PHOTONS; index++) {
        int is_signal = target && index % 6 == 0;
        codes[index] = is_signal ? (uint16_t)(bin + (below(4) == 0)) : below(128);
    }
    begin(number);
}

/* Runs to the last laser cycle before the look. */
static void count_all(void)
{
    for (uint32_t pixel = 0; pixel < PIXELS; pixel++) {
        photons(pixel);
    }
    for (uint32_t cycle = 0; cycle + 1 < CYCLES; cycle++) {
        end(cycle);
    }
}

/* The checksum of all events: FNV-1a. */
static uint32_t sum = 0x811c9dc5;

static void add_packed(uint32_t length)
{
    for (uint32_t byte = 0; byte < length; byte++) {
        sum = (sum ^ packed[byte]) * 0x01000193;
    }
}

static void line(const char *name, uint32_t total, uint32_t runs)
{
    print(name);
    print(",");
    print_number(total);
    print(",");
    print_number(runs);
    print("\n");
}

/* Looks of all pixels, with or without events. */
static void looks(const char *name, int event)
{
    uint32_t total = 0, runs = 0;
    for (uint32_t number = 0; number < EXPOSURES; number++) {
        uint32_t gave, taken;
        draw(number, event);
        count_all();
        taken = measure(end, CYCLES - 1, &gave);
        if (take(0) == (event ? PIXELS : 0)) {
            total += taken;
            runs += PIXELS;
        }
    }
    line(name, total, runs);
}

int run(void)
{
    static const struct settings paper = {0, 3, 0, 4 * 256, 18309, 5, 4, 40, 2000};
    uint32_t total = 0, gave;

    systick[1] = 0xffffff;
    systick[2] = 0;
    systick[0] = 5;
    /* An operation includes its return, but not its call. */
    overhead = measure(only_return, 0, &gave) - 1;
    if (measure(hundred, 0, &gave) != 100 || configure(&paper) != 0) {
        print("the counter does not count instructions\n");
        return 1;
    }
    for (uint32_t number = 0; number < EXPOSURES; number++) {
        draw(number, 1);
        for (uint32_t index = 0; index < PHOTONS; index++) {
            total += measure(photon, codes[index], &gave);
        }
    }
    line("one photon", total, EXPOSURES * PHOTONS);
    total = 0;
    for (uint32_t number = 0; number < EXPOSURES; number++) {
        draw(number, 1);
        total += measure(photons, 0, &gave);
    }
    line("photon in a batch", total, EXPOSURES * PHOTONS);
    looks("look of one of 16 pixels; no event", 0);
    looks("look of one of 16 pixels; event", 1);
    total = 0;
    for (uint32_t number = 0; number < EXPOSURES; number++) {
        draw(number, 1);
        count_all();
        end(CYCLES - 1);
        total += measure(pack, number, &gave);
        add_packed(gave);
    }
    line("take and pack an event", total, EXPOSURES);
    total = 0;
    for (uint32_t number = 0; number < EXPOSURES; number++) {
        draw(number, 1);
        total += measure(exposure, number, &gave);
        add_packed(gave);
    }
    line("exposure of one of 16 pixels", total, EXPOSURES * PIXELS);
    line("RAM of a pixel", pixel_bytes(), 1);
    line("sum of the events", sum, 1);
    return 0;
}
