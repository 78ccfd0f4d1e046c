#include <dtof.h>

#include "operations.h"

static dtof_place_t places[PIXELS];
static dtof_array_t array;
static dtof_config_t config;
static dtof_aer_encoder_t encoder;

uint32_t pixel_bytes(void)
{
    return sizeof(dtof_place_t);
}

uint32_t configure(const struct settings *settings)
{
    if (dtof_array_init(&array, sizeof *places, places, PIXELS, NULL, 0) != DTOF_OK
        || dtof_config_paper(&config) != DTOF_OK) {
        return 1;
    }
    config.rule = (uint8_t)settings->rule;
    config.window = (uint8_t)settings->window;
    config.estimator = (uint8_t)settings->estimator;
    config.alpha_q8 = (uint16_t)settings->alpha_q8;
    config.z_q12 = (uint16_t)settings->z_q12;
    config.minimum_count = settings->minimum_count;
    config.x = (uint16_t)settings->x;
    config.l1 = (uint16_t)settings->l1;
    config.l2 = (uint16_t)settings->l2;
    return begin(0);
}

uint32_t begin(uint32_t number)
{
    (void)number;
    dtof_aer_encoder_init(&encoder);
    return dtof_array_configure(&array, &config, PIXELS);
}

uint32_t photon(uint32_t code)
{
    return dtof_array_photon(&array, 0, (uint16_t)code);
}

uint32_t photons(uint32_t number)
{
    return dtof_array_photons(&array, (uint16_t)(number % PIXELS), codes, PHOTONS);
}

uint32_t end(uint32_t cycle)
{
    (void)cycle;
    return dtof_array_end_laser_cycles(&array, 1, NULL);
}

uint32_t take(uint32_t number)
{
    dtof_event_t event;
    (void)number;
    uint32_t events = 0;
    while (dtof_array_next_event(&array, &event) == DTOF_OK) {
        events++;
    }
    return events;
}

uint32_t pack(uint32_t number)
{
    dtof_event_t event;
    size_t length;
    (void)number;
    if (dtof_array_next_event(&array, &event) != DTOF_OK
        || dtof_aer_encode(&encoder, &event, packed, &length) != DTOF_OK) {
        return 0;
    }
    return length;
}

uint32_t exposure(uint32_t number)
{
    for (uint32_t cycle = 0; cycle < 44; cycle++) {
        uint32_t first = 6 * cycle;
        uint32_t left = first < PHOTONS ? PHOTONS - first : 0;
        for (uint16_t pixel = 0; pixel < PIXELS; pixel++) {
            dtof_array_photons(&array, pixel, codes + first, left < 6 ? left : 6);
        }
        end(cycle);
    }
    return pack(number);
}
