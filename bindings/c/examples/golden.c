/* Golden vectors: the photons of firmware/src/self_test.rs, through the C functions. It prints the
 * lines of firmware/self-test.out that need nothing else than this library. */
#include <dtof.h>

#include "platform.h"

static dtof_pixel_t pixel;
static dtof_checked_config_t checked;
static dtof_aer_encoder_t encoder;

/* A simple generator, with the multiplier and increment of Numerical Recipes. */
static uint32_t drawn;

static uint16_t below(uint32_t limit)
{
    drawn = drawn * 1664525u + 1013904223u;
    return (uint16_t)(((drawn >> 16) * limit) >> 16);
}

/* Prints the error and where it happened. */
static int failed(const char *where, dtof_status_t status)
{
    print(where);
    print(": ");
    print(dtof_status_text(status));
    print("\n");
    return 1;
}

#define TRY(call)                          \
    do {                                   \
        dtof_status_t status = (call);     \
        if (status != DTOF_OK) {           \
            return failed(#call, status);  \
        }                                  \
    } while (0)

static void print_field(const char *name, int64_t number)
{
    print(name);
    print_number(number);
}

/* An event and its words. */
static int print_event(const dtof_event_t *event)
{
    static const char digits[] = "0123456789abcdef";
    uint8_t bytes[DTOF_EVENT_BYTES];
    size_t length;

    print_field("level ", event->level);
    print_field(" echo ", event->echo);
    print_field(" cycle ", (int64_t)event->cycle);
    print_field(" exposure ", event->exposure);
    print_field(" bin ", event->peak_bin);
    print_field(" offset ", event->offset_q8);
    print_field(" count ", event->peak_count);
    print_field(" background ", event->background);
    print_field(" flags ", event->flags);
    print("\n");
    TRY(dtof_aer_encode(&encoder, event, bytes, &length));
    for (size_t word = 0; word < length; word += DTOF_WORD_BYTES) {
        char text[2 * DTOF_WORD_BYTES + 1];
        for (size_t byte = 0; byte < DTOF_WORD_BYTES; byte++) {
            text[2 * byte] = digits[bytes[word + byte] >> 4];
            text[2 * byte + 1] = digits[bytes[word + byte] & 15];
        }
        text[2 * DTOF_WORD_BYTES] = 0;
        print("word ");
        print(text);
        print("\n");
    }
    return 0;
}

/* Ends a laser cycle. Prints an event if there is one and the link has room. */
static int end(dtof_statistics_t *statistics, uint64_t cycle, int has_room)
{
    dtof_event_t event;

    TRY(dtof_pixel_end_laser_cycles(&pixel, &checked, cycle, statistics, 1, NULL));
    if (!has_room) {
        return 0;
    }
    dtof_status_t status = dtof_pixel_take_event(&pixel, &event);
    if (status == DTOF_ERROR_NO_EVENT) {
        return 0;
    }
    TRY(status);
    return print_event(&event);
}

static int print_statistics(dtof_statistics_t *statistics)
{
    dtof_counts_t counts;

    TRY(dtof_pixel_add_photons(&pixel, statistics));
    TRY(dtof_statistics_read(statistics, &counts));
    print_field("Statistics { counted: ", (int64_t)counts.counted);
    print_field(", excluded: ", (int64_t)counts.excluded);
    print_field(", saturated: ", (int64_t)counts.saturated);
    print_field(", rejected: ", (int64_t)counts.rejected);
    print_field(", gated_out: ", (int64_t)counts.gated_out);
    print_field(", repeated: ", (int64_t)counts.repeated);
    print_field(", events: ", (int64_t)counts.events);
    print_field(", deferred: ", (int64_t)counts.deferred);
    print_field(", expired: ", (int64_t)counts.expired);
    print_field(", expired_deferred: ", (int64_t)counts.expired_deferred);
    print_field(", ended_full: ", (int64_t)counts.ended_full);
    print_field(", blind_looks: ", (int64_t)counts.blind_looks);
    print(" }\n");
    return 0;
}

/* A macropixel that sees a target between two bins, and as much background. */
static int stream(void)
{
    const uint16_t target = 60;
    const uint64_t first = (1 << 16) - 400;
    dtof_statistics_t statistics;
    dtof_config_t config;

    print("stream of 128 bins\n");
    TRY(dtof_statistics_init(&statistics));
    TRY(dtof_config_paper(&config));
    config.x = 10;
    TRY(dtof_config_check(&config, &checked));
    TRY(dtof_pixel_init(&pixel, sizeof pixel, 1));
    drawn = 1;
    for (uint64_t cycle = first; cycle < first + 800; cycle++) {
        if (below(2) == 0) {
            TRY(dtof_pixel_count(&pixel, &checked, (uint16_t)(target + (below(4) == 0))));
        }
        if (below(2) == 0) {
            TRY(dtof_pixel_count(&pixel, &checked, below(DTOF_BINS)));
        }
        /* Sometimes the link has no room. */
        if (end(&statistics, cycle, cycle % 256 < 160)) {
            return 1;
        }
    }
    return print_statistics(&statistics);
}

/* A macropixel with the window rule that sees surfaces at bins 30 and 60, each with a photon in one
 * of `one_in` laser cycles, or none. */
static int watched(const char *name, const dtof_config_t *config, const uint16_t one_in[2])
{
    static const uint16_t targets[2] = {30, 60};
    dtof_statistics_t statistics;

    print("stream with ");
    print(name);
    print("\n");
    TRY(dtof_statistics_init(&statistics));
    TRY(dtof_config_check(config, &checked));
    TRY(dtof_pixel_init(&pixel, sizeof pixel, 2));
    drawn = 1;
    for (uint64_t cycle = 0; cycle < 400; cycle++) {
        for (int surface = 0; surface < 2; surface++) {
            if (one_in[surface] > 0 && below(one_in[surface]) == 0) {
                uint16_t code = (uint16_t)(targets[surface] + (below(4) == 0));
                TRY(dtof_pixel_count(&pixel, &checked, code));
            }
        }
        if (below(2) == 0) {
            TRY(dtof_pixel_count(&pixel, &checked, below(DTOF_BINS)));
        }
        if (end(&statistics, cycle, 1)) {
            return 1;
        }
    }
    return print_statistics(&statistics);
}

int run(void)
{
    static const uint16_t both[2] = {2, 4};
    static const uint16_t far[2] = {0, 16};
    dtof_config_t config;

    TRY(dtof_aer_encoder_init(&encoder));
    if (stream()) {
        return 1;
    }
    TRY(dtof_config_paper(&config));
    config.rule = DTOF_RULE_WINDOW;
    config.z_q12 = (uint16_t)(4.5 * 4096);
    config.l2 = 100;
    config.echoes = 4;
    config.peel_reach = 4;
    if (watched("echoes", &config, both)) {
        return 1;
    }
    config.l2 = 200;
    config.echoes = 1;
    config.tracking = 1;
    if (watched("tracking", &config, far)) {
        return 1;
    }
    print("end\n");
    return 0;
}
