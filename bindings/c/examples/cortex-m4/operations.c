#include <dtof.h>

#include "operations.h"

static dtof_pixel_t pixels[PIXELS];
static dtof_checked_config_t config;
static dtof_statistics_t statistics;
static dtof_aer_encoder_t encoder;

uint32_t pixel_bytes(void)
{
    return sizeof(dtof_pixel_t);
}

uint32_t configure(const struct settings *settings)
{
    dtof_config_t pixel_settings;
    if (dtof_statistics_init(&statistics) != DTOF_OK
        || dtof_config_paper(&pixel_settings) != DTOF_OK) {
        return 1;
    }
    pixel_settings.rule = (uint8_t)settings->rule;
    pixel_settings.window = (uint8_t)settings->window;
    pixel_settings.estimator = (uint8_t)settings->estimator;
    pixel_settings.alpha_q8 = (uint16_t)settings->alpha_q8;
    pixel_settings.z_q12 = (uint16_t)settings->z_q12;
    pixel_settings.minimum_count = settings->minimum_count;
    pixel_settings.x = (uint16_t)settings->x;
    pixel_settings.l1 = (uint16_t)settings->l1;
    pixel_settings.l2 = (uint16_t)settings->l2;
    return dtof_config_check(&pixel_settings, &config);
}

uint32_t begin(uint32_t number)
{
    for (uint16_t pixel = 0; pixel < PIXELS; pixel++) {
        dtof_pixel_init(&pixels[pixel], sizeof pixels[pixel], pixel);
    }
    dtof_aer_encoder_init(&encoder);
    return number;
}

uint32_t photon(uint32_t code)
{
    return dtof_pixel_count(&pixels[0], &config, (uint16_t)code);
}

uint32_t photons(uint32_t number)
{
    return dtof_pixel_count_batch(&pixels[number % PIXELS], &config, codes, PHOTONS);
}

uint32_t end_one(uint32_t cycle)
{
    dtof_look_t look;
    dtof_pixel_end_laser_cycles(&pixels[0], &config, cycle, &statistics, 1, &look);
    return look;
}

uint32_t end_all(uint32_t cycle)
{
    size_t fired;
    dtof_pixels_end_laser_cycles(pixels, PIXELS, cycle, &config, &statistics, 1, &fired);
    return fired;
}

uint32_t pack(uint32_t number)
{
    dtof_event_t event;
    size_t length;
    (void)number;
    if (dtof_pixel_take_event(&pixels[0], &event) != DTOF_OK
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
        for (uint32_t pixel = 0; pixel < PIXELS; pixel++) {
            dtof_pixel_count_batch(&pixels[pixel], &config, codes + first, left < 6 ? left : 6);
        }
        end_all(cycle);
    }
    return pack(number);
}
