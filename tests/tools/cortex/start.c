/* Starts the emulated machine: vectors, floating point, the C library by semihosting. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* an address, which the table of vectors begins with */
extern void stack_top(void);
extern uint32_t data_from, data_start, data_end, bss_start, bss_end;
extern void initialise_monitor_handles(void);
int main(void);

void start(void);

void start(void)
{
    /* full access to the coprocessors of floating point */
    *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20;
    memcpy(&data_start, &data_from, (size_t)((char *)&data_end - (char *)&data_start));
    memset(&bss_start, 0, (size_t)((char *)&bss_end - (char *)&bss_start));
    initialise_monitor_handles();
    exit(main());
}

/* the C library calls both */
void _init(void);
void _fini(void);

void _init(void)
{
}

void _fini(void)
{
}

static void fault(void)
{
    abort();
}

__attribute__((section(".vectors"), used)) static void (*const vectors[])(void) = {
    stack_top, start, fault, fault, fault, fault, fault,
};
