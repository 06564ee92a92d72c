/* Joint limits that close one direction of the motor. */
#ifndef JOINT_SAFETY_H
#define JOINT_SAFETY_H

#include <stdint.h>

/* Task of every slot: beyond +800 counts positive current is blocked (red LED), beyond -800 negative (green LED). */
int32_t joint_safety_check(void);

#endif
