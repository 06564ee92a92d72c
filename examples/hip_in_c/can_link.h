/* The board's end of its CAN bus: frames to setters by identifier, values to frames.
 *
 * Receiving: the interrupt copies the frame into a ring, a task delivers what waits. Sending: frames wait in a ring of 8
 * and go into transmit buffers 1 and 2 as these fall free: whenever a frame is queued, and in every slot. */
#ifndef CAN_LINK_H
#define CAN_LINK_H

#include <stdint.h>

typedef void (*can_setter)(uint32_t value_word, uint32_t time_word);

/* A place of the receive list, which is searched from its first one on. `cycles`: what the setter takes. */
struct can_receiver {
    uint32_t identifier;
    can_setter setter;
    uint32_t cycles;
};

/* On the bus, with this receive list. */
void can_link_start(const struct can_receiver *list, uint32_t count);
/* Interrupts. */
int32_t can_link_receive(void);
int32_t can_link_error(void);
/* Task of every slot: deliver what waits; returns how many frames there were. */
int32_t can_link_receive_all(void);
/* A line of the schedule makes a frame, which can_link_transmit sends when the line's cycles are over. */
void can_link_build(uint32_t identifier, uint32_t value_word, uint32_t time_word);
/* Task of every slot: put the frame that the row made, if it made one, into the ring. */
void can_link_transmit(void);
/* Task of every slot: fill free transmit buffers; returns how many frames went there. */
int32_t can_link_feed(void);

#endif
