#include "quadrature_decoder.h"

#include "error_module.h"
#include "quirks.h"

#define RING_MASK (DECODER_RING - 1u)
#define SLOT_CYCLES 30000

void decoder_edge(struct decoder *decoder, int32_t step, int32_t elapsed)
{
    const uint32_t write = decoder->write;
    const uint32_t after = (write + 1u) & RING_MASK;
    decoder->count += step;
    if (after == decoder->read) {
        error_report(decoder->gains->full_code); /* the time is lost, the count is not */
        return;
    }
    decoder->ring[write] = step * elapsed;
    decoder->write = after;
}

void decoder_glitch(struct decoder *decoder)
{
    decoder_edge(decoder, 0, 0);
}

void decoder_update_angle(struct decoder *decoder)
{
    const struct decoder_gains *gains = decoder->gains;
    decoder->position = (int32_t)((int64_t)decoder->count * gains->position_gain >> gains->position_shift);
}

/* Follow `times` edge times whose sum is `total` cycles, in the direction of `sign`. */
static void follow(struct decoder *decoder, int32_t times, uint32_t total, int32_t sign)
{
    const int32_t speed = sign * times * (int32_t)((uint32_t)DECODER_LARGEST / total); /* counts per cycle x 2^31 */
    decoder->mean = sign * (int32_t)(times == 1 ? total : total / (uint32_t)times);
    decoder->filtered += (int64_t)speed * (65536 >> RATE_FILTER_EXPONENT) - (decoder->filtered >> RATE_FILTER_EXPONENT);
    decoder->rate = (int32_t)(decoder->gains->rate_gain * decoder->filtered >> decoder->gains->rate_bits);
}

/* A slot without a valid time: the longer the silence, the slower it must be. */
static void be_silent(struct decoder *decoder)
{
    const int32_t sign = decoder->mean > 0 ? 1 : -1;
    const int32_t mean = sign * decoder->mean;
    if (decoder->idle < DECODER_LARGEST - SLOT_CYCLES)
        decoder->idle += SLOT_CYCLES;
    follow(decoder, 1, (uint32_t)(decoder->idle > mean ? decoder->idle : mean), sign);
}

/* What was in the ring cannot be: an error, and the next time is not used. */
static void note_glitch(struct decoder *decoder)
{
    error_report(decoder->gains->glitch_code);
    decoder->after_glitch = 1;
}

static int32_t sign_of(int32_t value)
{
    return (value > 0) - (value < 0);
}

int32_t decoder_update_rate(struct decoder *decoder)
{
    const uint32_t write = decoder->write;
    uint32_t here = decoder->read;
    uint32_t total = 0; /* at most twice the longest time and a slot's edges: below 2^32 */
    int32_t valid = 0;
    int32_t seen = 0;
    while (here != write) {
        const int32_t elapsed = decoder->ring[here];
        const uint32_t after = (here + 1u) & RING_MASK;
        if (elapsed != 0 && sign_of(elapsed) == decoder->sign) {
            if (!decoder->after_glitch) {
                decoder->idle = 0;
                total += (uint32_t)(decoder->sign * elapsed);
                valid++;
            }
            decoder->after_glitch = 0;
        } else if (elapsed == 0) {
            note_glitch(decoder);
        } else if (after == write) {
            break; /* alone at the end: judged when its successor is here */
        } else if (sign_of(decoder->ring[after]) == sign_of(elapsed)) {
            decoder->sign = sign_of(elapsed); /* two in a row: the direction has changed */
            total = 0;
            valid = 0;
            continue; /* the same time again, which now has the right sign */
        } else {
            note_glitch(decoder);
        }
        seen++;
        here = after;
    }
    if (valid == 0)
        be_silent(decoder);
    else
        follow(decoder, valid, total, decoder->sign);
    decoder->read = here;
    return seen;
}

int32_t decoder_count_at(const struct decoder *decoder, int32_t position)
{
    const struct decoder_gains *gains = decoder->gains;
    return (int32_t)((int64_t)position * ((int64_t)1 << gains->position_shift) / gains->position_gain);
}
