/* The outer loop: a motor current that makes the joint behave like a spring and a damper. */
#ifndef COMPLIANT_CONTROL_H
#define COMPLIANT_CONTROL_H

#include <stdint.h>

/* What the main brain sends: floats in A, A/rad, A s/rad. A target that is sent is overwritten in the same slot. */
void compliant_receive_command(uint32_t value_word, uint32_t time_word);
void compliant_receive_stiffness(uint32_t value_word, uint32_t time_word);
void compliant_receive_dampness(uint32_t value_word, uint32_t time_word);
void compliant_receive_target(uint32_t value_word, uint32_t time_word);

/* The current wanted now (A x 65536) at `position` (rad x 65536) and `velocity` (rad/s x 65536), not limited. */
int64_t compliant_current(int32_t position, int32_t velocity);

#endif
