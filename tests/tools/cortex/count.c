/* Prints how many instructions the longest update of each kind takes on the emulated machine. Under
   -icount shift=0 an instruction takes a nanosecond, and the counter of the system a tick of 40 ns. */
#include <stdint.h>
#include <stdio.h>

#define TICK 40

uint32_t longest(uint32_t kind, uint32_t (*clock)(void));

static uint32_t ticks(void)
{
    return *(volatile uint32_t *)0xE000E018u;
}

/* 2000 instructions and a few more, to check the length of a tick */
static uint32_t known(void)
{
    const uint32_t start = ticks();
    uint32_t left = 1000;
    __asm__ volatile("1: subs %0, #1\n bne 1b" : "+r"(left) : : "cc");
    return (start - ticks()) & 0x00ffffffu;
}

int main(void)
{
    static const char *const kinds[] = {
        "nothing",
        "observer, 6 efforts",
        "estimator, 2 efforts, 11 parameters",
        "the same, exponential forgetting",
        "the same, directional forgetting",
        "estimator, 6 efforts, 10 parameters, exponential forgetting",
        "estimator, 6 efforts, 36 parameters, exponential forgetting",
        "the same, directional forgetting",
        "gradient law, 6 efforts, 60 parameters",
        "natural law, 6 efforts, 6 bodies",
        "projection of one body, a Newton step",
        "payload, mass and centre with deviations, twice",
    };
    *(volatile uint32_t *)0xE000E014u = 0x00ffffffu;
    *(volatile uint32_t *)0xE000E018u = 0;
    *(volatile uint32_t *)0xE000E010u = 5;
    printf("a loop of 2000: %lu instructions\n", (unsigned long)known() * TICK);
    for (uint32_t kind = 0; kind < sizeof kinds / sizeof kinds[0]; kind++) {
        printf("%s: %lu instructions\n", kinds[kind], (unsigned long)longest(kind, ticks) * TICK);
    }
    return 0;
}
