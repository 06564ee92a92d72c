/* What keeps the motor and its gearhead alive: clips, thermal model, peak current, speed. All 16.16.
 *
 * The allowed range of the target is the motor's clip, narrowed by the thermal state, narrowed again in the direction
 * of motion near the speed limit. The measured current acts on the duty: beyond the peak it is cut in the same slot,
 * and the integral of the excess fades the duty and switches the motor off. */
#ifndef MOTOR_LIMITS_H
#define MOTOR_LIMITS_H

#include <stdint.h>

/* Every slot, also while the motor is off: advance both monitors with the measured current (A). Not 0 when the motor
 * must be off. */
int motor_limits_monitor(int32_t current);
/* The target current that the motor may have now, at `velocity` (rad/s, joint side). */
int32_t motor_limits_target(int64_t target, int32_t velocity);
/* The controller's sum (counts x 65536) after what the measured current asks for. */
int32_t motor_limits_duty(int32_t duty, int32_t current);

#endif
