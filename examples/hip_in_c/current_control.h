/* The inner loop: proportional-integral control of the motor current, 2 kHz, duty in counts of 600. */
#ifndef CURRENT_CONTROL_H
#define CURRENT_CONTROL_H

#include <stdint.h>

/* Directions closed by the joint's safety check. */
void current_control_block(int positive, int negative);
/* One sample: drive the measured current towards the target (A x 65536, the latter already limited). */
void current_control_update(int32_t target, int32_t current);

#endif
