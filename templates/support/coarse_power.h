/* Powers in float one degree below those of fast_power.h in both polynomials: absolute error below 0.003, seen and not
 * proved (tests/test_cost_choices.py). They are one end of the chart of what accuracy costs.
 *
 * log2(1 + f) = f p(f), p of degree 2, relative error 0.0026; 2^r = 1 + r q(r), q of degree 1, relative error 0.0020;
 * both fitted as those of fast_power.h are. The laws at 0, at 1 and for n = 0 are the same.
 */
#ifndef SYMRENDER_COARSE_POWER_H
#define SYMRENDER_COARSE_POWER_H

#include "fast_power.h"

/* log2 of 2^k (1 + f) */
SYMRENDER_INLINE float coarse_log2_of_partsf(power_partsf x)
{
    const float f = x.f;
    const float p = 1.44331169f + f * (-0.753121674f + f * 0.479009777f);
    return x.k + f * p;
}

/* 2^y for y < 127, 0 below -126 */
SYMRENDER_INLINE float coarse_exp2f(float y)
{
    const float shifted = y + 0x1.8p23f;
    const float r = y - (shifted - 0x1.8p23f);
    const float q = 0.702941656f + r * 0.239864036f;
    const float two_to_y = power_from_bitsf(power_bitsf(1.0f + r * q) + (power_bitsf(shifted) << 23));
    return y < -126.0f ? 0.0f : two_to_y;
}

/* (cos a)^exponent from cos2 = cos^2 a and sin2 = sin^2 a, 0 <= a <= 90 degrees, as cos2^(exponent / 2). */
SYMRENDER_INLINE float coarse_power_of_cosinef(float cos2, float sin2, float exponent)
{
    const float n = exponent < 0x1p100f ? exponent : 0x1p100f;   /* INFINITY times 0 is no number */
    const int is_near = sin2 <= 0.3125f;
    const power_partsf elsewhere = fast_splitf(cos2);
    const power_partsf parts = {is_near ? 0.0f : elsewhere.k, is_near ? -sin2 : elsewhere.f};
    const float log2_power = 0.5f * (n * coarse_log2_of_partsf(parts));
    return coarse_exp2f(log2_power < 0.0f ? log2_power : 0.0f);
}

/* base^exponent for any base >= 0; INFINITY from 2^127 up. */
SYMRENDER_INLINE float coarse_powerf(float base, float exponent)
{
    const float n = exponent < 0x1p100f ? exponent : 0x1p100f;
    const float log2_power = n * coarse_log2_of_partsf(fast_splitf(base));
    const float power = coarse_exp2f(log2_power);
    return log2_power < 127.0f ? power : (float)INFINITY;
}

#endif
