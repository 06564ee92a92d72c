/* An incremental encoder: position from both edges of channel A (2X), rate from the time between edges.
 *
 * The edge's part runs in the fast interrupt, the update part once per slot. */
#ifndef QUADRATURE_DECODER_H
#define QUADRATURE_DECODER_H

#include <stdint.h>

#define DECODER_RING 64u /* edge times that wait for the next slot; one place stays empty */

/* From counts to the joint's angle (rad x 65536) and from counts per cycle to its rate: whole numbers over powers of
 * two, chosen so that as many of their bits count as 32-bit products leave room for. */
struct decoder_gains {
    int32_t position_gain; /* rad x 65536 per count = position_gain / 2^position_shift */
    int32_t position_shift;
    int32_t rate_gain; /* rad/s per count per cycle of 60 MHz = rate_gain / 2^(rate_bits - 31) */
    int32_t rate_bits;
    uint32_t glitch_code;
    uint32_t full_code;
};

struct decoder {
    const struct decoder_gains *gains;
    /* the interrupt's side */
    volatile int32_t count;
    volatile uint32_t write;
    volatile int32_t ring[DECODER_RING]; /* cycles since the edge before, with the sign of the step */
    /* the slot's side */
    volatile uint32_t read;
    int32_t position; /* rad x 65536 at the joint */
    int32_t rate;     /* rad/s x 65536 */
    int32_t sign;     /* of the times that are believed; none before the first two */
    int after_glitch;
    int32_t mean; /* cycles between counts; the longest: standing still */
    int32_t idle;
    int64_t filtered; /* counts per cycle x 2^31 x 65536 */
};

#define DECODER_LARGEST INT32_MAX
/* A decoder at power-up, standing still. */
#define DECODER(of_gains) { .gains = (of_gains), .mean = DECODER_LARGEST }

/* Fast interrupt: an edge, `step` 1 or -1, `elapsed` cycles after the one before. */
void decoder_edge(struct decoder *decoder, int32_t step, int32_t elapsed);
/* Fast interrupt: the pin's level did not agree with the armed edge. */
void decoder_glitch(struct decoder *decoder);
/* Task of every slot: the position. */
void decoder_update_angle(struct decoder *decoder);
/* Task of every slot: the rate. Returns how many edge times it took. */
int32_t decoder_update_rate(struct decoder *decoder);
/* The count at a position (rad x 65536). */
int32_t decoder_count_at(const struct decoder *decoder, int32_t position);

#endif
