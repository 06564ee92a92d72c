/* A program to debug: a main loop that calls, a table, a device that it asks, an interrupt that counts. */

#include <stdint.h>

#define SAMPLE (*(volatile uint32_t *)0xE0000000) /* another number at every read */
#define LEVEL (*(volatile uint32_t *)0xE0000004)

volatile uint32_t turns, sum, ticks;
uint32_t history[8];

__attribute__((interrupt("IRQ"))) void tick(void)
{
    ticks++;
    LEVEL = 0; /* the device lowers its line */
}

__attribute__((noinline)) uint32_t weigh(uint32_t sample)
{
    uint32_t weight = sample * 3;
    return weight + 1;
}

__attribute__((noinline)) void remember(uint32_t value)
{
    history[turns & 7] = value;
    sum += value;
}

int main(void)
{
    for (;;) {
        remember(weigh(SAMPLE));
        turns++;
    }
}

__asm__(".section .vectors, \"ax\"\n"
        "b start\n"          /* reset */
        "b .\n b .\n b .\n b .\n nop\n"
        "b tick\n"           /* IRQ */
        "b .\n"
        "start: .global start\n"
        "msr cpsr_c, #0xD2\n" /* IRQ mode */
        "ldr sp, =0x40003F00\n"
        "msr cpsr_c, #0x1F\n" /* system mode, interrupts on */
        "ldr sp, =0x40004000\n"
        "bl main\n"
        ".ltorg\n"
        ".text\n");
