/* Start-up and output of an example on a Cortex-M4: vectors, memory, semihosting. */
#include <stdint.h>

#include "platform.h"

extern uint32_t stack_top, data_start, data_end, data_source, bss_start, bss_end;

/* Calls the emulator or debugger through Arm's semihosting. */
static uint32_t semihosting(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

/* Prints to the emulator's standard output. */
void print(const char *text)
{
    static const char console[] = ":tt";
    static const uint32_t open[3] = {(uint32_t)console, 4, sizeof console - 1};
    static uint32_t handle;
    uint32_t length = 0;

    if (handle == 0) {
        handle = semihosting(0x01, open);
    }
    while (text[length] != 0) {
        length++;
    }
    const uint32_t write[3] = {handle, (uint32_t)text, length};
    semihosting(0x05, write);
}

/* Ends the emulator: a failure if `code` is not 0. */
static void leave(uint32_t code)
{
    const uint32_t exit_extended = 0x20, application_exit = 0x20026;
    const uint32_t block[2] = {application_exit, code};
    for (;;) {
        semihosting(exit_extended, block);
    }
}

static void fault(void)
{
    print("fault\n");
    leave(1);
}

void reset(void)
{
    volatile uint32_t *const cpacr = (volatile uint32_t *)0xe000ed88;
    const uint32_t *from = &data_source;

    /* Enables the floating-point registers: compilers copy memory with them. */
    *cpacr |= 0xfu << 20;
    __asm__ volatile("dsb\n\tisb");
    for (uint32_t *to = &data_start; to < &data_end; to++) {
        *to = *from++;
    }
    for (uint32_t *to = &bss_start; to < &bss_end; to++) {
        *to = 0;
    }
    leave((uint32_t)run());
}

/* Stack, reset, NMI, and the faults. */
__attribute__((section(".vectors"), used)) static const struct {
    const uint32_t *stack;
    void (*handlers[15])(void);
} vectors = {
    &stack_top,
    {reset, fault, fault, fault, fault, fault},
};
