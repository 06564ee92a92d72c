#include "encoder_capture.h"

#define LONGEST_TIME 0x7F000000u /* cycles, about 35 s: longer silences count as this */
#define LONGEST_WRAPS (LONGEST_TIME / CAPTURE_PERIOD + 2u)
#define EARLY (CAPTURE_PERIOD / 2u) /* a capture below this is of after the wrap */
#define BOTH_EDGES(channel) (FW_CCR_RISING(channel) | FW_CCR_FALLING(channel))

static uint32_t wraps; /* of the capture timer */
static uint32_t CCR;   /* as last written: only this file writes it */

void capture_start(const struct capture *capture)
{
    fw_capture_connect(CAPTURE_TIMER, capture->channel, capture->pin);
    CCR |= FW_CCR_RISING(capture->channel) | FW_CCR_INTERRUPT(capture->channel);
    fw_timer_write_CCR(CAPTURE_TIMER, CCR);
}

int32_t capture_wrap(void)
{
    fw_timer_clear_IR(CAPTURE_TIMER, FW_IR_MR0);
    wraps++;
    return 0;
}

void capture_edge(struct capture *capture)
{
    const uint32_t level = fw_pin(capture->pin);
    const uint32_t count = fw_timer_CR(CAPTURE_TIMER, capture->channel);
    uint32_t wraps_now = wraps;
    uint32_t wraps_since;
    uint32_t elapsed;
    fw_timer_clear_IR(CAPTURE_TIMER, FW_IR_CR(capture->channel));
    /* a wrap that is not counted yet came before this capture if the capture is a small number */
    if (count < EARLY && (fw_timer_IR(CAPTURE_TIMER) & FW_IR_MR0) != 0)
        wraps_now++;
    wraps_since = wraps_now - capture->last_wraps;
    elapsed = LONGEST_TIME;
    if (wraps_since < LONGEST_WRAPS)
        elapsed = wraps_since * CAPTURE_PERIOD + count - capture->last_capture;
    if (elapsed > LONGEST_TIME)
        elapsed = LONGEST_TIME;
    capture->last_wraps = wraps_now;
    capture->last_capture = count;
    if (level != capture->armed_level) {
        decoder_glitch(capture->decoder); /* the edge that would leave the other level stays armed */
        return;
    }
    capture->armed_level = 1u - level;
    CCR ^= BOTH_EDGES(capture->channel); /* from one of the two to the other */
    fw_timer_write_CCR(CAPTURE_TIMER, CCR);
    /* rising with B low counts up */
    decoder_edge(capture->decoder, level != fw_pin(capture->partner_pin) ? 1 : -1, (int32_t)elapsed);
}
