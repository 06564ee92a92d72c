#include "absolute_encoder.h"

#include <ranger_sim/firmware.h>

#include "error_module.h"
#include "fixed.h"
#include "mch_table.h"

#define SPI 0u
#define WORD_MASK 0x1FFFu /* 13 bits */
#define COUNTS_PER_TURN 8192
#define RAD_PER_COUNT 0.0007669922f /* as the robot has it; 2 pi / 8192 would be 0.00076699039 */
#define ZERO 4590                   /* raw count at angle 0 */
#define SIGN 1                      /* of the mounting */
#define FASTEST_RPM 94              /* of the joint */
#define SLOTS_PER_MINUTE 120000
#define SPARE_COUNTS 5 /* that a step may be larger than the fastest joint's */
#define LARGEST_STEP (FASTEST_RPM * COUNTS_PER_TURN / SLOTS_PER_MINUTE + SPARE_COUNTS)

static int32_t value; /* what the spike limiter let through; 0 before the first reading */
static int32_t counts;
static float radians;
static int32_t angle;

int32_t absolute_encoder_counts(void) { return counts; }
float absolute_encoder_rad(void) { return radians; }
int32_t absolute_encoder_angle(void) { return angle; }

int32_t absolute_encoder_start(void)
{
    fw_spi_transfer(SPI);
    return 0;
}

int32_t absolute_encoder_accept(void)
{
    int32_t next = (int32_t)(fw_spi_SPDR(SPI) & WORD_MASK);
    if (value != 0) {
        if (next == value)
            return 0; /* as before, with all that follows from it */
        if (next > value + LARGEST_STEP) {
            next = value + LARGEST_STEP;
            error_report(ERR_AE_SPIKE);
        } else if (next < value - LARGEST_STEP) {
            next = value - LARGEST_STEP;
            error_report(ERR_AE_SPIKE);
        }
    }
    value = next;
    counts = SIGN * (next - ZERO);
    radians = (float)counts * RAD_PER_COUNT;
    angle = fixed_of_float(radians);
    return 0;
}
