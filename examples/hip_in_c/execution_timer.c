#include "execution_timer.h"

#include <ranger_sim/firmware.h>

#include "network_time.h"

#define ANEW_MASK 255u                  /* ms of the network time: the longest slot is looked for anew */
#define SECONDS_PER_CYCLE 0.0000000166667 /* of 60 MHz, as the robot has it */

static uint32_t longest; /* cycles from the slot's start to the end of its row */
static uint32_t longest_ever;

int32_t execution_time_record(void)
{
    const uint32_t since = fw_slot_cycles();
    if (since > longest || (network_time_ms() & ANEW_MASK) == 0) {
        longest = since;
        if (since > longest_ever)
            longest_ever = since;
    }
    return 0;
}

float execution_seconds(void) { return (float)longest * (float)SECONDS_PER_CYCLE; }
float execution_longest_seconds(void) { return (float)longest_ever * (float)SECONDS_PER_CYCLE; }
