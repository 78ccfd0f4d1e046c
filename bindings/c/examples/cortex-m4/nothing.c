/* An image that is looked at, not run. */
#include "platform.h"

int run(void)
{
    return 0;
}
