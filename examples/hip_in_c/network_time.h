/* The robot's time as this board last heard it: the router's millisecond count. The board has no other clock. */
#ifndef NETWORK_TIME_H
#define NETWORK_TIME_H

#include <stdint.h>

/* The last count received, ms. */
uint32_t network_time_ms(void);
/* A sync frame: both its words hold the count, the second one is used. */
void network_time_receive(uint32_t value_word, uint32_t time_word);

#endif
