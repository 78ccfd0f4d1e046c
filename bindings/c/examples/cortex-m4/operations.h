/* The operations that are measured, in C (operations.c) and in Rust (operations.rs). */
#ifndef OPERATIONS_H
#define OPERATIONS_H

#include <stdint.h>

#define PIXELS 16
#define PHOTONS 256

/* Settings that are chosen at run time. */
struct settings {
    uint32_t rule, window, estimator, alpha_q8, z_q12, minimum_count, x, l1, l2;
};

/* The photons of an exposure. */
extern uint16_t codes[PHOTONS];
/* The bytes of an event. */
extern uint8_t packed[32];

/* Bytes of the room of a pixel. */
uint32_t pixel_bytes(void);
/* Makes the array: 0 if the configuration is valid. */
uint32_t configure(const struct settings *settings);
/* Resets all pixels, and begins a stream: 0 if it can. */
uint32_t begin(uint32_t number);
/* Counts one photon in pixel 0. */
uint32_t photon(uint32_t code);
/* Counts all photons of `codes` in pixel `number` with one call. */
uint32_t photons(uint32_t number);
/* Ends a laser cycle. */
uint32_t end(uint32_t cycle);
/* Takes all events. Returns how many. */
uint32_t take(uint32_t number);
/* Packs the next event into `packed`. Returns the number of bytes, 0 without an event. */
uint32_t pack(uint32_t number);
/* From the first photon of all pixels to the packed event of one: 44 laser cycles of 6 photons. */
uint32_t exposure(uint32_t number);

#endif
