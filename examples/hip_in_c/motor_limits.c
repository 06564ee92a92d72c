#include "motor_limits.h"

#include "error_module.h"
#include "fixed.h"
#include "mch_table.h"
#include "quirks.h"

#define TARGET_MIN FIXED(-4.0) /* A */
#define TARGET_MAX FIXED(4.0)
#define CURRENT_MIN FIXED(-5.0)
#define CURRENT_MAX FIXED(5.0)
#define EXCESS_LIMIT 20 /* A samples */
#define EXCESS_FADE (EXCESS_LIMIT / 10) /* the duty has faded to 0 at a tenth of the limit */

#define THERMAL_CURRENT 3.1 /* A */
#define THERMAL_TIME 10.0   /* s */
#define THERMAL_LIMIT (THERMAL_CURRENT * THERMAL_CURRENT * THERMAL_TIME) /* A^2 s */
#define SOFT_THERMAL (0.75 * THERMAL_LIMIT)
#define THERMAL_RATE ((int32_t)(65536.0 / THERMAL_TIME))
#if THERMAL_DERATING
#define THERMAL_SLOPE FIXED(1.0 / (THERMAL_LIMIT - SOFT_THERMAL))
#else /* a current minus a thermal state: a mistake of units, hence the wrong sign */
#define THERMAL_SLOPE FIXED(1.0 / (THERMAL_CURRENT - SOFT_THERMAL))
#endif
#define SLOT_S 32 /* 0.5 ms x 65536, truncated */

#define GEAR 66.0
#define RATED_SPEED_RAD_S 659.734 /* 6300 rpm at the motor shaft */
#define SOFT_SPEED 0.9            /* the current fades from here to the rated speed */
#define SPEED_MAX FIXED(RATED_SPEED_RAD_S / GEAR)
#define SPEED_SOFT FIXED(SOFT_SPEED * RATED_SPEED_RAD_S / GEAR)

static int32_t thermal; /* A^2 s */
static int32_t thermal_multiplier = FIXED_ONE;
static int too_hot;
static int32_t excess; /* A samples */
static int32_t excess_multiplier = FIXED_ONE;
static int overloaded;

static void monitor_heat(int32_t current)
{
    const int32_t loss = fixed_multiply(current, current) - fixed_multiply(thermal, THERMAL_RATE);
    thermal += (int32_t)((int64_t)loss * SLOT_S >> 16);
    if (thermal < FIXED(SOFT_THERMAL)) { /* nearly always */
        thermal_multiplier = FIXED_ONE;
        if (too_hot) {
            too_hot = 0;
            error_report(ERR_MC_TEMP_ON);
        }
    } else if (thermal < FIXED(THERMAL_LIMIT)) {
        thermal_multiplier = FIXED_ONE - fixed_multiply(thermal - FIXED(SOFT_THERMAL), THERMAL_SLOPE);
        error_report(ERR_MC_TEMP_SAFE);
    } else {
        thermal_multiplier = 0;
        too_hot = 1;
        error_report(ERR_MC_TEMP_OFF); /* in every slot */
    }
}

static void monitor_excess(int32_t current)
{
    if (current > 0)
        excess += current - CURRENT_MAX;
    else if (current < 0)
        excess += CURRENT_MIN - current;
    if (excess <= 0) { /* nearly always */
        excess = 0;
        excess_multiplier = FIXED_ONE;
        if (overloaded) {
            overloaded = 0;
            error_report(ERR_MC_MECH_ON);
        }
        return;
    }
    excess_multiplier = FIXED_ONE - excess / EXCESS_FADE;
    if (excess_multiplier < 0)
        excess_multiplier = 0;
    if (excess >= EXCESS_LIMIT * FIXED_ONE) {
        overloaded = 1;
        error_report(ERR_MC_MECH_OFF); /* in every slot */
    }
}

int motor_limits_monitor(int32_t current)
{
    monitor_heat(current);
    monitor_excess(current);
    return too_hot || overloaded;
}

int32_t motor_limits_target(int64_t wanted, int32_t velocity)
{
    const int32_t speed = velocity >= 0 ? velocity : -velocity;
    int32_t low = TARGET_MIN;
    int32_t high = TARGET_MAX;
    int32_t target = (int32_t)wanted;
    if (wanted > high) {
        target = high;
        error_report(ERR_MC_TCURR_OOB);
    } else if (wanted < low) {
        target = low;
        error_report(ERR_MC_TCURR_OOB);
    }
    if (THERMAL_DERATING && thermal_multiplier < FIXED_ONE) {
        high = fixed_multiply(high, thermal_multiplier);
        low = fixed_multiply(low, thermal_multiplier);
    }
    if (SPEED_LIMITER && speed > SPEED_SOFT) {
        int32_t share = 0;
        if (speed < SPEED_MAX)
            share = (int32_t)((int64_t)(SPEED_MAX - speed) * FIXED_ONE / (SPEED_MAX - SPEED_SOFT));
        if (velocity > 0)
            high = fixed_multiply(high, share);
        else
            low = fixed_multiply(low, share);
        if (target > high || target < low)
            error_report(ERR_MC_SPEED_LIMIT);
    }
    return target > high ? high : target < low ? low : target;
}

int32_t motor_limits_duty(int32_t duty, int32_t current)
{
    int32_t multiplier = excess_multiplier;
    if (!THERMAL_DERATING && thermal_multiplier < multiplier)
        multiplier = thermal_multiplier;
    if (multiplier != FIXED_ONE)
        duty = fixed_multiply(duty, multiplier);
    /* a current beyond its peak would be there in the next slot too: the duty shrinks in proportion */
    if (PEAK_CURRENT_LIMITER && current > CURRENT_MAX && duty > 0) {
        duty = (int32_t)((int64_t)duty * CURRENT_MAX / current);
        error_report(ERR_MC_CURR_OOB);
    } else if (PEAK_CURRENT_LIMITER && current < CURRENT_MIN && duty < 0) {
        duty = (int32_t)((int64_t)duty * CURRENT_MIN / current);
        error_report(ERR_MC_CURR_OOB);
    }
    return duty;
}
