/* The functions that host.c and cortex-m4/start.c provide for the examples. */
#ifndef PLATFORM_H
#define PLATFORM_H

#include <stdint.h>

/* Prints text. */
void print(const char *text);

/* Prints a whole number. */
void print_number(int64_t number);

/* Runs the example: 0 if it succeeds. */
int run(void);

#endif
