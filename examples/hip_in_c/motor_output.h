/* The H-bridge seen from the processor: two PWM leads, two low-side enables, the watchdog pin. */
#ifndef MOTOR_OUTPUT_H
#define MOTOR_OUTPUT_H

#include <stdint.h>

#define LARGEST_DUTY 250 /* counts of 600 */

/* Why the motor may not be driven, bits. SLEEP: the bridge is open, the watchdog stays fed; SHUTDOWN: a duty of 0, and
 * the watchdog starves; STOPPED, by the limits: the same. */
enum off { OFF_SLEEP = 1, OFF_SHUTDOWN = 2, OFF_STOPPED = 4 };

void motor_output_start(void);
uint32_t motor_output_off(void);
/* Set or clear a reason. */
void motor_output_set_off(enum off reason, int set);
/* SLEEP and SHUTDOWN as the main brain sent them last. */
void motor_output_receive_sleep(uint32_t value_word, uint32_t time_word);
void motor_output_receive_shutdown(uint32_t value_word, uint32_t time_word);
void motor_output_enable_low_side(int on);
/* Toggle the watchdog pin, unless the motor is stopped or shut down. */
void motor_output_feed_watchdog(void);
/* Drive with `duty` counts, positive forward; the leads take turns at every call. */
void motor_output_write(int32_t duty);

#endif
