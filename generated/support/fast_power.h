/* Powers in float good for grey levels: absolute error below 0.00018, in loops that vectorise.
 * generated from fast_power.h.j2; do not edit: python -m symrender_cg.functions --write
 *
 * base^exponent = 2^(exponent log2 base), with log2(1 + f) = f p(f), p of degree 3, and 2^r = 1 + r q(r), q of
 * degree 2: the lowest degrees that stay below 2^-11, a quarter of half a grey level in 255. No division, no table,
 * no branch, no fma.
 *
 * Laws      x^0 = 1, also for x = 0; 0^n = 0 for n >= 2^-119; 1^n = 1; never NaN; a power of a cosine is in [0, 1].
 * Error     of the power, absolute, for the arguments as given: at most 0.00018, FAST_POWER_ERROR, for bases of at
 *           least 2^-126 or n >= 1/5; a smaller base counts as 2^-126. Of it the logarithm takes 0.000136 (relative
 *           error 0.00037, and v |ln v| <= 1/e), 2^y 0.000102. Proved in ball arithmetic, roundings included.
 */
#ifndef SYMRENDER_FAST_POWER_H
#define SYMRENDER_FAST_POWER_H

#include "inline.h"
#include "power.h"

#define FAST_POWER_ERROR 0x1p-12f

/* x = 2^k (1 + f), 11/16 <= 1 + f < 11/8, exactly, for x >= 2^-126; a smaller one counts as that, and
 * 0 has the lowest k there is: -infinity times 0 would be no number. */
SYMRENDER_INLINE power_partsf fast_splitf(float x)
{
    const uint32_t bits = power_bitsf(x > 0x1p-126f ? x : 0x1p-126f);
    const uint32_t from_lowest = bits - UINT32_C(0x3f300000) + UINT32_C(0x3f800000);
    const uint32_t mantissa = (from_lowest & UINT32_C(0x007fffff)) + UINT32_C(0x3f300000);
    const float k = power_from_bitsf((from_lowest >> 23) | UINT32_C(0x4b000000)) - (0x1p23f + 127.0f);
    const power_partsf parts = {x > 0.0f ? k : -0x1.fffffep127f, power_from_bitsf(mantissa) - 1.0f};
    return parts;
}

/* log2 of 2^k (1 + f)                                error <= 0.00037 relative to the logarithm */
SYMRENDER_INLINE float fast_log2_of_partsf(power_partsf x)
{
    const float f = x.f, f2 = f * f;
    const float p = (1.44220924f + -0.722546756f * f) + (0.514735699f + -0.358659536f * f) * f2;
    return x.k + f * p;
}

/* 2^y for y < 127, 0 below -126                      error <= 0.000102 relative */
SYMRENDER_INLINE float fast_exp2f(float y)
{
    const float shifted = y + 0x1.8p23f;
    const float r = y - (shifted - 0x1.8p23f);
    const float q = 0.693282902f + r * (0.24221094f + r * 0.0550089851f);
    const float two_to_y = power_from_bitsf(power_bitsf(1.0f + r * q) + (power_bitsf(shifted) << 23));
    return y < -126.0f ? 0.0f : two_to_y;
}

/* log2 (cos a)^2 from cos2 = cos^2 a and sin2 = sin^2 a, 0 <= a <= 90 degrees; from 1 - sin2 where
 * sin2 <= 5/16, so that a highlight of a large exponent keeps its shape. */
SYMRENDER_INLINE float fast_log2_of_lobef(float cos2, float sin2)
{
    const int is_near = sin2 <= 0.3125f;
    const power_partsf elsewhere = fast_splitf(cos2);
    const power_partsf parts = {is_near ? 0.0f : elsewhere.k, is_near ? -sin2 : elsewhere.f};
    return fast_log2_of_partsf(parts);
}

/* The same where sin2 is 1 - cos2 and no more accurate: splitting cos2 gives 1 - sin2 then. */
SYMRENDER_INLINE float fast_log2_of_squaref(float cos2)
{
    return fast_log2_of_partsf(fast_splitf(cos2));
}

/* (cos a)^exponent = 2^(exponent/2 log2_cos2) */
SYMRENDER_INLINE float fast_power_of_lobef(float log2_cos2, float exponent)
{
    const float n = exponent < 0x1p100f ? exponent : 0x1p100f;   /* INFINITY times 0 is no number */
    const float log2_power = 0.5f * (n * log2_cos2);
    return fast_exp2f(log2_power < 0.0f ? log2_power : 0.0f);   /* a sin2 below 0 by rounding is 0 */
}

/* n / 2 for n from 32 on, else 0 */
static inline float half_of_large(float n)
{
    return n >= 32.0f ? 0.5f * (n < 0x1p100f ? n : 0x1p100f) : 0.0f;
}

/* cos2^h for a block of points and h of at least 16: 2^(h log2(1 - g)), g = 1 - cos2, with log2(1 - g) = -g s(g), s of
 * degree 3. It is good where g <= 7/16; beyond, the power is below 1.1e-4 and comes out so. `y` is room for as many.
 * Error: at most 0.000112, of y relative 0.000162. */
SYMRENDER_INLINE void fast_powers_of_lobef(
    const float *restrict cos2, float *restrict y, float *restrict power, float h, int count)
{
    for (int i = 0; i < count; ++i) {
        const float g = cos2[i] < 1.0f ? 1.0f - cos2[i] : 0.0f, g2 = g * g;
        const float s = (1.44247496f + 0.736635625f * g) + (0.321448207f + 0.844810069f * g) * g2;
        y[i] = -(h * g) * s;
    }
    for (int i = 0; i < count; ++i)
        power[i] = fast_exp2f(y[i]);
}

/* (cos a)^exponent from both squares, as cos2^(exponent / 2) */
SYMRENDER_INLINE float fast_power_of_cosinef(float cos2, float sin2, float exponent)
{
    return fast_power_of_lobef(fast_log2_of_lobef(cos2, sin2), exponent);
}

/* base^exponent for any base >= 0; INFINITY from 2^127 up. */
SYMRENDER_INLINE float fast_powerf(float base, float exponent)
{
    const float n = exponent < 0x1p100f ? exponent : 0x1p100f;
    const float log2_power = n * fast_log2_of_partsf(fast_splitf(base));
    const float power = fast_exp2f(log2_power);
    return log2_power < 127.0f ? power : (float)INFINITY;
}

#endif
