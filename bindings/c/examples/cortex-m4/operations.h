/* The operations that are counted: operations.c has them in C, operations.rs in Rust. */
#ifndef OPERATIONS_H
#define OPERATIONS_H

#include <stdint.h>

#define PIXELS 16
#define PHOTONS 256

/* What is chosen when the program runs. */
struct settings {
    uint32_t rule, window, estimator, alpha_q8, z_q12, minimum_count, x, l1, l2;
};

/* The photons of an exposure. */
extern uint16_t codes[PHOTONS];
/* The bytes of an event. */
extern uint8_t packed[32];

/* Bytes of a pixel. */
uint32_t pixel_bytes(void);
/* Makes the configuration; 0 if it can be used. */
uint32_t configure(const struct settings *settings);
/* Makes all pixels anew, and begins a stream. */
uint32_t begin(uint32_t number);
/* One photon into pixel 0. */
uint32_t photon(uint32_t code);
/* All photons of `codes` into pixel `number`, at once. */
uint32_t photons(uint32_t number);
/* Ends a laser cycle of pixel 0; what the look brought. */
uint32_t end_one(uint32_t cycle);
/* Ends a laser cycle of all pixels; how many have an event. */
uint32_t end_all(uint32_t cycle);
/* Takes the event of pixel 0 and packs it into `packed`; how many bytes, 0 if there is none. */
uint32_t pack(uint32_t number);
/* From the first photon of all pixels to the packed event of one: 44 laser cycles of 6 photons. */
uint32_t exposure(uint32_t number);

#endif
