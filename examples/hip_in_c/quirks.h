/* Switches between what the robot's paper describes (the defaults) and what its firmware of 2016 did, as in
 * boards/quirks.py. Each can be set by itself in firmware.toml ([defines]); FIRMWARE_2016 sets them all. */
#ifndef QUIRKS_H
#define QUIRKS_H

#ifdef FIRMWARE_2016
#define PROPORTIONAL_CURRENT_CONTROL 0
#define SPEED_LIMITER 0
#define THERMAL_DERATING 0
#define PEAK_CURRENT_LIMITER 0
#define ALTERNATING_OFFSET_COUNTS 14
#define GAINS_LATCH_WITH_CURRENT 1
#define HIP_MOTOR_ENCODER_PRESET 0
#define WARN_NEAR_SLOT_LIMIT 0
#define ERRORS_COUNTED_PER_EVENT 0
#define NEW_ERRORS_LOST_AFTER_REPEAT 1
#define FULL_QUEUES_REPORTED 0
#endif

#ifndef COMPLIANT_GAIN_SIGN
#define COMPLIANT_GAIN_SIGN (-1) /* of both gain terms */
#endif
#ifndef PROPORTIONAL_CURRENT_CONTROL
#define PROPORTIONAL_CURRENT_CONTROL 1
#endif
#ifndef SPEED_LIMITER
#define SPEED_LIMITER 1
#endif
#ifndef THERMAL_DERATING
#define THERMAL_DERATING 1
#endif
#ifndef PEAK_CURRENT_LIMITER
#define PEAK_CURRENT_LIMITER 1
#endif
#ifndef ALTERNATING_OFFSET_COUNTS
#define ALTERNATING_OFFSET_COUNTS 0 /* that the second pattern of the PWM leads drives more */
#endif
#ifndef GAINS_LATCH_WITH_CURRENT
#define GAINS_LATCH_WITH_CURRENT 0
#endif
#ifndef RATE_FILTER_EXPONENT
#define RATE_FILTER_EXPONENT 4 /* 1/2^n of the difference per slot; 1 ... 14 */
#endif
#ifndef HIP_REZERO
#define HIP_REZERO 1
#endif
#ifndef HIP_MOTOR_ENCODER_PRESET
#define HIP_MOTOR_ENCODER_PRESET 1
#endif
#ifndef OCCASIONAL_IDLE_CALL
#define OCCASIONAL_IDLE_CALL 1
#endif
#ifndef WARN_NEAR_SLOT_LIMIT
#define WARN_NEAR_SLOT_LIMIT 1
#endif
#ifndef ERRORS_COUNTED_PER_EVENT
#define ERRORS_COUNTED_PER_EVENT 1
#endif
#ifndef NEW_ERRORS_LOST_AFTER_REPEAT
#define NEW_ERRORS_LOST_AFTER_REPEAT 0
#endif
#ifndef FULL_QUEUES_REPORTED
#define FULL_QUEUES_REPORTED 1
#endif
#ifndef FULL_RECEIVE_RING_KILLS
#define FULL_RECEIVE_RING_KILLS 1
#endif
#ifndef ACCEPTANCE_FILTER
#define ACCEPTANCE_FILTER 0 /* 1: frames that the receive list has not cost no interrupt */
#endif

#endif
