/* The absolute encoder of the joint: 13 bits per turn on SPI 0, its spike limiter, zero and sign. */
#ifndef ABSOLUTE_ENCODER_H
#define ABSOLUTE_ENCODER_H

#include <stdint.h>

/* sign x (value - zero), without wrap-around. */
int32_t absolute_encoder_counts(void);
/* The joint's angle: rad, and rad x 65536. */
float absolute_encoder_rad(void);
int32_t absolute_encoder_angle(void);
/* Task of every slot: begin a transfer; its interrupt 14 us later has the result for this slot's control. */
int32_t absolute_encoder_start(void);
/* Interrupt: the transfer is complete. */
int32_t absolute_encoder_accept(void);

#endif
