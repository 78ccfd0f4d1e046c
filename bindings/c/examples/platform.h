/* What the examples need of the platform: host.c, and cortex-m4/start.c. */
#ifndef PLATFORM_H
#define PLATFORM_H

#include <stdint.h>

/* Text to where a reader sees it. */
void print(const char *text);

/* A whole number in decimals. */
void print_number(int64_t number);

/* The example. What is not 0 is a failure. */
int run(void);

#endif
