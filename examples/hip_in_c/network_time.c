#include "network_time.h"

static uint32_t ms;

uint32_t network_time_ms(void) { return ms; }

void network_time_receive(uint32_t value_word, uint32_t time_word)
{
    (void)value_word;
    ms = time_word;
}
