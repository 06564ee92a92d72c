#include "motor_output.h"

#include <ranger_sim/firmware.h>

#include "quirks.h"

#define PERIOD_COUNTS 600 /* 100 kHz at 60 MHz */
#define SIGN 1            /* of the motor's mounting */
#define WATCHDOG_PIN FW_P0(6)
#define LOW_SIDE_2_PIN FW_P0(11)
#define LOW_SIDE_6_PIN FW_P1(17)
#define OFF_UNLESS_0 0x7FFFu /* what SLEEP and SHUTDOWN look at in the word they get */

static uint32_t off;
static int second_pattern;
static int low_side = -1;
static uint32_t last_MR2;
static uint32_t last_MR6;

void motor_output_start(void) { fw_pwm_start(PERIOD_COUNTS); }

uint32_t motor_output_off(void) { return off; }

void motor_output_set_off(enum off reason, int set)
{
    off = set ? off | (uint32_t)reason : off & ~(uint32_t)reason;
}

void motor_output_receive_sleep(uint32_t value_word, uint32_t time_word)
{
    (void)time_word;
    motor_output_set_off(OFF_SLEEP, (value_word & OFF_UNLESS_0) != 0);
}

void motor_output_receive_shutdown(uint32_t value_word, uint32_t time_word)
{
    (void)time_word;
    motor_output_set_off(OFF_SHUTDOWN, (value_word & OFF_UNLESS_0) != 0);
}

void motor_output_enable_low_side(int on)
{
    if (on == low_side)
        return;
    low_side = on;
    fw_pin_write(LOW_SIDE_2_PIN, (uint32_t)on);
    fw_pin_write(LOW_SIDE_6_PIN, (uint32_t)on);
}

void motor_output_feed_watchdog(void)
{
    if (!(off & (OFF_SHUTDOWN | OFF_STOPPED)))
        fw_pin_toggle(WATCHDOG_PIN);
}

static int32_t within(int32_t value, int32_t largest)
{
    return value > largest ? largest : value < -largest ? -largest : value;
}

void motor_output_write(int32_t duty)
{
    const int asleep = (off & OFF_SLEEP) != 0;
    int32_t MR2 = 0;
    int32_t MR6 = 0;
    if (!asleep) {
        /* stopped or shut down, the patterns go on with a duty of 0 until the watchdog cuts the bridge off */
        const int32_t counts = off ? 0 : SIGN * within(duty, LARGEST_DUTY);
        if (second_pattern) {
            MR2 = PERIOD_COUNTS;
            MR6 = PERIOD_COUNTS;
            if (counts >= 0)
                MR6 -= counts + ALTERNATING_OFFSET_COUNTS;
            else
                MR2 -= -counts + ALTERNATING_OFFSET_COUNTS;
        } else if (counts >= 0) {
            MR2 = counts;
        } else {
            MR6 = -counts;
        }
        second_pattern = !second_pattern;
    }
    motor_output_enable_low_side(!asleep);
    if ((uint32_t)MR2 != last_MR2 || (uint32_t)MR6 != last_MR6) {
        last_MR2 = (uint32_t)MR2;
        last_MR6 = (uint32_t)MR6;
        fw_pwm_write(last_MR2, last_MR6);
    }
    motor_output_feed_watchdog();
}
