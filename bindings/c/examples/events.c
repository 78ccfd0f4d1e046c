/* Photons to an AER file, which `dtof decode` reads:
 *
 *     events OUT.aer                  generated photons
 *     events OUT.aer - < PHOTONS.csv  lines of pixel,cycle,bin, with laser cycles in order
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <dtof.h>

#define PIXELS 64u
#define BIN_WIDTH_PS 250u
#define GENERATED_CYCLES 2000u

static dtof_place_t places[PIXELS];
static dtof_array_t array;
static dtof_aer_encoder_t encoder;

/* The file, with the checksum and the number of its events. */
static FILE *file;
static const char *file_name;
static uint32_t checksum;
static uint64_t events;

static void fail(const char *where, const char *why)
{
    fprintf(stderr, "error: %s: %s\n", where, why);
    exit(EXIT_FAILURE);
}

static void check(const char *what, dtof_status_t status)
{
    if (status != DTOF_OK) {
        fail(what, dtof_status_text(status));
    }
}

static void put(const uint8_t *bytes, size_t length)
{
    check("checksum", dtof_crc32(&checksum, bytes, length));
    if (fwrite(bytes, 1, length, file) != length) {
        fail(file_name, strerror(errno));
    }
}

static void put_u32(uint8_t *at, uint32_t number)
{
    for (int byte = 0; byte < 4; byte++) {
        at[byte] = (uint8_t)(number >> (8 * byte));
    }
}

/* The header of docs/aer-format.md, without settings. */
static void put_header(void)
{
    uint8_t header[64] = "DTOF-AER";
    header[8] = DTOF_AER_VERSION;
    header[10] = sizeof header;
    put_u32(header + 12, DTOF_BINS);
    put_u32(header + 16, PIXELS);
    put_u32(header + 20, 1);
    put_u32(header + 24, BIN_WIDTH_PS << 16);
    put(header, sizeof header);
}

/* Ends laser cycles up to `next`, and writes the events. */
static void end_laser_cycles(uint64_t *cycle, uint64_t next)
{
    while (*cycle < next) {
        uint64_t rest = next - *cycle;
        uint16_t cycles = rest < UINT16_MAX ? (uint16_t)rest : UINT16_MAX, left;
        dtof_event_t event;
        check("laser cycles", dtof_array_end_laser_cycles(&array, cycles, &left));
        *cycle += (uint64_t)(cycles - left);
        while (dtof_array_next_event(&array, &event) == DTOF_OK) {
            uint8_t bytes[DTOF_EVENT_BYTES];
            size_t length;
            check("event", dtof_aer_encode(&encoder, &event, bytes, &length));
            put(bytes, length);
            events++;
        }
    }
}

/* A target in each pixel, three bins farther per row, and as much background. */
static void generate(void)
{
    uint32_t drawn = 1;
    uint64_t cycle = 0;
    while (cycle < GENERATED_CYCLES) {
        for (uint16_t pixel = 0; pixel < PIXELS; pixel++) {
            for (int photon = 0; photon < 2; photon++) {
                drawn = drawn * 1664525u + 1013904223u;
                uint16_t code = photon == 0 ? (uint16_t)(20 + 3 * (pixel / 8) + (drawn >> 31))
                                            : (uint16_t)((drawn >> 16) % DTOF_BINS);
                if ((drawn >> 8) % 8 == 0) {
                    check("photon", dtof_array_photon(&array, pixel, code));
                }
            }
        }
        end_laser_cycles(&cycle, cycle + 1);
    }
}

static void read_photons(void)
{
    char line[80], place[40];
    uint64_t cycle = 0;
    for (unsigned long number = 1; fgets(line, sizeof line, stdin) != NULL; number++) {
        unsigned long long at;
        unsigned pixel, code;
        char rest;
        snprintf(place, sizeof place, "standard input, line %lu", number);
        if (number == 1) {
            if (strcmp(line, "pixel,cycle,bin\n") != 0) {
                fail(place, "the header is not pixel,cycle,bin");
            }
            continue;
        }
        if (sscanf(line, "%u,%llu,%u%c", &pixel, &at, &code, &rest) != 4 || rest != '\n') {
            fail(place, "not three numbers");
        }
        if (pixel >= PIXELS || code > UINT16_MAX) {
            fail(place, "no such pixel or bin");
        }
        if (at < cycle) {
            fail(place, "an earlier laser cycle than the line before");
        }
        end_laser_cycles(&cycle, at);
        check("photon", dtof_array_photon(&array, (uint16_t)pixel, (uint16_t)code));
    }
    if (ferror(stdin)) {
        fail("standard input", strerror(errno));
    }
    end_laser_cycles(&cycle, cycle + 1);
}

int main(int arguments, char **argument)
{
    int from_input = arguments == 3 && strcmp(argument[2], "-") == 0;
    if (arguments != 2 && !from_input) {
        fail("usage", "events OUT.aer [- < PHOTONS.csv]");
    }
    file_name = argument[1];

    dtof_config_t settings;
    check("settings", dtof_config_paper(&settings));
    check("array", dtof_array_init(&array, sizeof *places, places, PIXELS, NULL, 0));
    check("array", dtof_array_configure(&array, &settings, PIXELS));
    check("encoder", dtof_aer_encoder_init(&encoder));

    /* Does not overwrite a file. */
    file = fopen(file_name, "wbx");
    if (file == NULL) {
        fail(file_name, strerror(errno));
    }
    put_header();
    if (from_input) {
        read_photons();
    } else {
        generate();
    }
    uint8_t last[DTOF_WORD_BYTES];
    check("end", dtof_aer_end(events, checksum, last));
    put(last, sizeof last);
    if (fclose(file) != 0) {
        fail(file_name, strerror(errno));
    }

    dtof_statistics_t statistics;
    dtof_counts_t counts;
    check("statistics", dtof_array_statistics(&array, &statistics, NULL, NULL));
    check("statistics", dtof_statistics_read(&statistics, &counts));
    printf("%s: %llu events; photons rejected %llu, saturated %llu; exposures without an event "
           "%llu\n",
           file_name, (unsigned long long)events, (unsigned long long)counts.rejected,
           (unsigned long long)counts.saturated, (unsigned long long)counts.expired);
    return EXIT_SUCCESS;
}
