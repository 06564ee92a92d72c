/* 16.16 fixed point, as foundation/numbers.py has it: products are floored, floats truncated toward zero.
 *
 * A shift to the right of a negative number is one of the compiler's choices in C99; gcc and clang keep the sign. One
 * that did not would stop here. */
#ifndef FIXED_H
#define FIXED_H

#include <stdint.h>

#define FIXED_ONE 65536

/* A constant in 16.16, truncated toward zero by the compiler. */
#define FIXED(number) ((int32_t)((number) * 65536.0))

typedef char shifts_must_keep_the_sign[(-3 >> 1) == -2 ? 1 : -1];

/* a * b, floored, wrapped to 32 bits. */
static inline int32_t fixed_multiply(int32_t a, int32_t b)
{
    return (int32_t)((int64_t)a * b >> 16);
}

/* Truncated toward zero, saturated at 32 bits; NaN is 0. */
static inline int32_t fixed_of_float(float value)
{
    const float scaled = value * 65536.0f;
    if (scaled >= 2147483648.0f)
        return INT32_MAX;
    if (scaled <= -2147483648.0f)
        return INT32_MIN;
    if (scaled != scaled)
        return 0;
    return (int32_t)scaled;
}

static inline float float_of_fixed(int32_t value)
{
    return (float)value / 65536.0f;
}

/* The 32 bits of a float, and back. */
static inline uint32_t word_of_float(float value)
{
    union { float value; uint32_t word; } both;
    both.value = value;
    return both.word;
}

static inline float float_of_word(uint32_t word)
{
    union { uint32_t word; float value; } both;
    both.word = word;
    return both.value;
}

#endif
