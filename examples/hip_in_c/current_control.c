#include "current_control.h"

#include "error_module.h"
#include "fixed.h"
#include "mch_table.h"
#include "mcu_led.h"
#include "motor_limits.h"
#include "motor_output.h"
#include "quirks.h"

/* Counts per A and sample; where they come from is told in boards/modules/current_control.py. */
#define INTEGRAL_GAIN 20
#define PROPORTIONAL_GAIN (PROPORTIONAL_CURRENT_CONTROL ? 4 : 0)
#define INTEGRAL_LIMIT (LARGEST_DUTY * FIXED_ONE / INTEGRAL_GAIN)
#define START_CALLS 2 /* the first calls only feed the watchdog */

static int32_t integral; /* A samples x 65536 */
static int32_t calls;
static int block_positive;
static int block_negative;

void current_control_block(int positive, int negative)
{
    block_positive = positive;
    block_negative = negative;
}

/* First part of a sample: feed the watchdog, advance the monitors, switch the motor off or on. 0 in the first calls. */
static int supervise(int32_t current)
{
    const int stopped = (motor_output_off() & OFF_STOPPED) != 0;
    motor_output_feed_watchdog();
    if (calls < START_CALLS) {
        calls++;
        return 0;
    }
    if (motor_limits_monitor(current)) {
        if (!stopped) {
            motor_output_set_off(OFF_STOPPED, 1);
            led_on(LED_GREEN);
        }
    } else if (stopped) {
        motor_output_set_off(OFF_STOPPED, 0);
        led_off(LED_GREEN);
    }
    return 1;
}

/* The controller's sum for an error of the current, counts x 65536. */
static int32_t summed(int32_t error)
{
    int64_t total;
    integral += error;
    if (integral > INTEGRAL_LIMIT) {
        integral = INTEGRAL_LIMIT;
        error_report(ERR_MC_INTEG_SATUR);
    } else if (integral < -INTEGRAL_LIMIT) {
        integral = -INTEGRAL_LIMIT;
        error_report(ERR_MC_INTEG_SATUR);
    }
    total = (int64_t)PROPORTIONAL_GAIN * error + (int64_t)INTEGRAL_GAIN * integral;
    if (total > INT32_MAX) {
        total = INT32_MAX;
        error_report(ERR_MC_FIXED_LIMIT);
    } else if (total < INT32_MIN) {
        total = INT32_MIN;
        error_report(ERR_MC_FIXED_LIMIT);
    }
    return (int32_t)total;
}

void current_control_update(int32_t target, int32_t current)
{
    int32_t counts = 0;
    if (!supervise(current))
        return;
    if (motor_output_off()) {
        error_report(ERR_MC_NOT_RUNNING);
    } else {
        if ((block_positive && target > 0) || (block_negative && target < 0))
            target = 0;
        counts = motor_limits_duty(summed(target - current), current) >> 16;
        if (counts > LARGEST_DUTY) {
            counts = LARGEST_DUTY;
            error_report(ERR_MC_PWM_LIMIT);
        } else if (counts < -LARGEST_DUTY) {
            counts = -LARGEST_DUTY;
            error_report(ERR_MC_PWM_LIMIT);
        }
    }
    motor_output_write(counts);
}
