/* What firmware.c, scheduler.c and startup.S have of each other. */
#ifndef CHIP_CHIP_H
#define CHIP_CHIP_H

#include <ranger_sim/firmware.h>

#define CORE_HZ 60000000u
#define CYCLES_PER_US (CORE_HZ / 1000000u)
#define SLOT_TIMER 1u /* as on the robot's boards; startup.S starts it, and programs leave it alone */

/* What the slot timer has counted; kept for who looks in from outside, a debugger or the harness. */
struct chip_slot_record {
    uint32_t slots;         /* begun */
    uint32_t overruns;
    uint32_t dropped;       /* tasks of rows that were not finished */
    uint32_t last_cycles;   /* from the slot's tick to its row's end */
    uint32_t most_cycles;
    uint32_t total_cycles;  /* modulo 2^32 */
};
extern volatile struct chip_slot_record chip_slots;

/* A handler for the slot timer; as fw_attach, but of the chip's own. */
void chip_attach_slot_timer(fw_work handler, int32_t vic_slot);
/* Pins, the VIC: before firmware_start. */
void chip_begin(void);
void chip_interrupts_on(void);
/* Never returns. */
void chip_run_schedule(const fw_schedule *schedule);
/* Wait until so many ns after reset. */
void chip_wait_until(uint32_t after_ns);

#endif
