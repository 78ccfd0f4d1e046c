/* Events in millimetres from the raw histograms of a TMF8820, here and on a Cortex-M4.
 *
 * A set of histograms is 30 packets: packet n has one byte of each count of channel n mod 10, the
 * least significant ones in packets 0 to 9. Channel 0 is the reference, 1 to 9 are the zones. On a
 * board `read_packet` reads 135 bytes from register 0x20 on, after each interrupt. */
#include <dtof.h>

#include "platform.h"

#if DTOF_BINS != 128
#error "a TMF8820 has 128 bins"
#endif

enum {
    CHANNELS = 10,
    PACKETS = 3 * CHANNELS,
    HEADER = 7,
    PACKET = HEADER + DTOF_BINS,
    RAW_HISTOGRAM = 0x81,
    /* 537 * 1024 laser pulses of a measurement. */
    LASER_CYCLES = 549888,
    SETS = 6
};

/* A bin of 92.1 ps, and time zero of a public log: see dtof_sensors::tmf882x. */
static const uint32_t bin_width_ps_q16 = 6035866;
static const int32_t offset_mm_q8 = -45952;

static dtof_checked_config_t config;
static dtof_statistics_t statistics;
static dtof_scale_t scale;

/* The counts of a set so far, and the packet that is due. */
static uint32_t counts[CHANNELS][DTOF_BINS];
static uint8_t next;
/* A set is dropped, and its loss is told: its other packets are not due. */
static int is_waiting;

/* The counts of a simulated scene: a pulse in bin 20 + 5 * channel. Every other set loses a
 * packet: one in the middle, the last, the first. */
static uint32_t count_of(uint32_t channel, uint32_t bin)
{
    uint32_t peak = 20 + 5 * channel;
    return bin == peak ? 70000 : bin == peak + 1 ? 30000 : 300;
}

static int read_packet(uint32_t set, uint8_t number, uint8_t bytes[PACKET])
{
    if ((set == 1 && number == 17) || (set == 3 && number == 29) || (set == 5 && number == 0)) {
        return 0;
    }
    for (uint32_t at = 0; at < HEADER; at++) {
        bytes[at] = 0;
    }
    bytes[0] = RAW_HISTOGRAM;
    bytes[4] = number;
    bytes[5] = DTOF_BINS;
    for (uint32_t bin = 0; bin < DTOF_BINS; bin++) {
        bytes[HEADER + bin] = (uint8_t)(count_of(number % CHANNELS, bin) >> 8 * (number / CHANNELS));
    }
    return 1;
}

/* Prints the events of a zone, which is its pixel. */
static dtof_status_t decide(uint16_t zone, uint64_t cycle)
{
    dtof_event_t events[DTOF_ECHOES];
    size_t found = 0;
    dtof_status_t status = dtof_histogram_decide(&config, counts[zone + 1], zone, cycle, LASER_CYCLES,
                                                 &statistics, events, &found);
    for (size_t i = 0; i < found && status == DTOF_OK; i++) {
        int32_t range_mm_q8;
        status = dtof_range(&scale, events[i].position_q8, &range_mm_q8);
        if (status == DTOF_OK) {
            print("zone ");
            print_number(events[i].pixel);
            print(": ");
            print_number((range_mm_q8 + 128) / 256);
            print(" mm\n");
        }
    }
    return status;
}

/* Takes a packet. One that is not due costs its set. */
static dtof_status_t take(const uint8_t bytes[PACKET], uint64_t cycle)
{
    uint8_t number = bytes[4];
    if (bytes[0] != RAW_HISTOGRAM && next == 0) {
        /* The results come between two sets. */
        return DTOF_OK;
    }
    if (bytes[0] != RAW_HISTOGRAM || bytes[5] != DTOF_BINS || number >= PACKETS
        || (number != next && number != 0)) {
        if (!is_waiting) {
            print("a packet is missing, the set is dropped\n");
        }
        is_waiting = 1;
        next = 0;
        return DTOF_OK;
    }
    if (number == 0 && next != 0) {
        print("a packet is missing, the set is dropped\n");
    }
    is_waiting = 0;
    uint32_t channel = number % CHANNELS, shift = 8u * (number / CHANNELS);
    for (uint32_t bin = 0; bin < DTOF_BINS; bin++) {
        uint32_t byte = (uint32_t)bytes[HEADER + bin] << shift;
        counts[channel][bin] = shift == 0 ? byte : counts[channel][bin] | byte;
    }
    next = (uint8_t)((number + 1) % PACKETS);
    if (shift < 16 || channel == 0) {
        return DTOF_OK;
    }
    return decide((uint16_t)(channel - 1), cycle);
}

int run(void)
{
    dtof_config_t settings;
    dtof_status_t status = dtof_config_paper(&settings);
    if (status == DTOF_OK) {
        status = dtof_config_check(&settings, &config);
    }
    if (status == DTOF_OK) {
        status = dtof_statistics_init(&statistics);
    }
    if (status == DTOF_OK) {
        status = dtof_scale_init(&scale, bin_width_ps_q16, offset_mm_q8);
    }
    for (uint32_t set = 0; set < SETS && status == DTOF_OK; set++) {
        for (uint8_t number = 0; number < PACKETS && status == DTOF_OK; number++) {
            uint8_t packet[PACKET];
            if (read_packet(set, number, packet)) {
                status = take(packet, (uint64_t)(set + 1) * LASER_CYCLES);
            }
        }
    }
    if (status != DTOF_OK) {
        print(dtof_status_text(status));
        print("\n");
        return 1;
    }
    print("end\n");
    return 0;
}
