#include "compliant_control.h"

#include "fixed.h"
#include "quirks.h"

static int32_t command;
static int32_t stiffness;
static int32_t dampness;
static int32_t received_stiffness;
static int32_t received_dampness;

static int32_t fixed_of_word(uint32_t word) { return fixed_of_float(float_of_word(word)); }

void compliant_receive_command(uint32_t value_word, uint32_t time_word)
{
    (void)time_word;
    command = fixed_of_word(value_word);
    stiffness = received_stiffness; /* the gains received so far come into force */
    dampness = received_dampness;
}

void compliant_receive_stiffness(uint32_t value_word, uint32_t time_word)
{
    (void)time_word;
    received_stiffness = fixed_of_word(value_word);
    if (!GAINS_LATCH_WITH_CURRENT)
        stiffness = received_stiffness;
}

void compliant_receive_dampness(uint32_t value_word, uint32_t time_word)
{
    (void)time_word;
    received_dampness = fixed_of_word(value_word);
    if (!GAINS_LATCH_WITH_CURRENT)
        dampness = received_dampness;
}

void compliant_receive_target(uint32_t value_word, uint32_t time_word)
{
    (void)value_word; /* the law overwrites it before anybody looks, as on the robot */
    (void)time_word;
}

int64_t compliant_current(int32_t position, int32_t velocity)
{
    const int64_t spring = fixed_multiply(stiffness, position);
    const int64_t damper = fixed_multiply(dampness, velocity);
    return command + COMPLIANT_GAIN_SIGN * (spring + damper);
}
