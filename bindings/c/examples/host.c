/* The platform of an example on a computer. */
#include <stdio.h>
#include <stdlib.h>

#include "platform.h"

void print(const char *text)
{
    if (fputs(text, stdout) == EOF) {
        exit(EXIT_FAILURE);
    }
}

int main(void)
{
    return run() == 0 && fflush(stdout) == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
