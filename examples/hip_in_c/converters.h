/* The external converter's sequence and the internal converter, and what their counts mean.
 *
 * What is published are products of single floats; inside the control loop the gain is truncated to 16.16 (100 for
 * 100.9), as on the robot. */
#ifndef CONVERTERS_H
#define CONVERTERS_H

#include <stdint.h>

void converters_start(void);
/* Tasks of every slot: begin. An unfinished conversion is an error, and goes on. */
int32_t adcx_convert_all(void);
int32_t adci_convert_all(void);
/* Not 0 when no sequence runs: the condition of a wait. */
int32_t adcx_sequence_done(void);
/* Interrupts: store the result and begin the next one; the internal converter's stays in its register. */
int32_t adcx_busy_fell(void);
int32_t adci_done(void);

int32_t motor_current_fixed(void); /* A x 65536 */
float motor_current(void);         /* A */
float battery_current(void);       /* A, into the motor stage */
float battery_voltage(void);       /* V */
float battery_power(void);         /* W */

#endif
