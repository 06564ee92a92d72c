/* The fast interrupt of an incremental encoder: from a timer capture to a count and a time.
 *
 * The channel is armed for one edge of channel A at a time; the handler compares the pin's level with what that edge
 * leaves, looks at channel B for the direction, and arms the other edge. */
#ifndef ENCODER_CAPTURE_H
#define ENCODER_CAPTURE_H

#include <ranger_sim/firmware.h>

#include "quadrature_decoder.h"

#define CAPTURE_TIMER 0u
#define CAPTURE_PERIOD 30000u /* cycles: it wraps every 0.5 ms */

struct capture {
    const uint32_t channel;
    const uint32_t pin;
    const uint32_t partner_pin;
    struct decoder *const decoder;
    uint32_t armed_level; /* which the edge that the channel waits for leaves */
    uint32_t last_wraps;  /* at the edge before */
    uint32_t last_capture;
};

/* One encoder on a capture channel: A on `pin`, B on `partner_pin`. */
#define CAPTURE(on_channel, a_pin, b_pin, its_decoder) \
    { .channel = (on_channel), .pin = (a_pin), .partner_pin = (b_pin), .decoder = (its_decoder), .armed_level = 1 }

/* Connect the pin and arm the rising edge. */
void capture_start(const struct capture *capture);
/* Fast interrupt: an edge was captured. */
void capture_edge(struct capture *capture);
/* Fast interrupt: the timer restarted at 0. */
int32_t capture_wrap(void);

#endif
