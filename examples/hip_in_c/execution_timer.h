/* How long the slots take: the variables EXECUTION_TIME and MAX_EXECUTION_TIME. */
#ifndef EXECUTION_TIMER_H
#define EXECUTION_TIMER_H

#include <stdint.h>

/* Last task of every slot: read the slot timer's count. */
int32_t execution_time_record(void);
/* The longest slot of about the last quarter second, and of all: s. */
float execution_seconds(void);
float execution_longest_seconds(void);

#endif
