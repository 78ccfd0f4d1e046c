/* An image that is inspected, not run. */
#include "platform.h"

int run(void)
{
    return 0;
}
