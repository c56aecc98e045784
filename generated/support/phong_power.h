/* The powers that a Phong highlight takes, on top of power.h; they vectorise as it does. */
#ifndef SYMRENDER_PHONG_POWER_H
#define SYMRENDER_PHONG_POWER_H

#include "power.h"

/* (cos a)^exponent from cos2 = cos^2 a and sin2 = sin^2 a, for 0 <= a <= 90 degrees, as cos2^(exponent / 2).
 * Where sin2 < 1/2 the logarithm is that of 1 - sin2: its error is then in proportion to sin2, and the error of the
 * power does not grow with the exponent as it would from a rounded cos2 near 1. */
static inline double power_of_cosine(double cos2, double sin2, double exponent)
{
    const int is_near = sin2 < 0.5;
    const power_parts near_one = power_split_one_minus(sin2), elsewhere = power_split(cos2);
    const power_parts parts = {is_near ? near_one.k : elsewhere.k, is_near ? near_one.f : elsewhere.f};
    const double log2_cos2 = power_log2_of_parts(parts);
    const int is_positive = is_near | (cos2 > 0.0);
    return unit_power_from_log2(is_positive ? log2_cos2 : -(double)INFINITY, 0.5 * exponent);
}

/* base^exponent for any base >= 0: rounding may carry a cosine beyond 1. INFINITY from 2^1023 up. */
static inline double power(double base, double exponent)
{
    const double log2_power = exponent > 0.0 ? exponent * log2_unit(base) : 0.0;
    const double power = power_exp2(log2_power);
    return log2_power < 1023.0 ? power : (double)INFINITY;
}

/* (cos a)^exponent from cos2 = cos^2 a and sin2 = sin^2 a, for 0 <= a <= 90 degrees, as cos2^(exponent / 2).
 * Where sin2 < 1/2 the logarithm is that of 1 - sin2: its error is then in proportion to sin2, and the error of the
 * power does not grow with the exponent as it would from a rounded cos2 near 1. */
static inline float power_of_cosinef(float cos2, float sin2, float exponent)
{
    const float n = exponent < 0x1p100f ? exponent : 0x1p100f;   /* a double's exponent may have become INFINITY */
    const int is_near = sin2 < 0.5f;
    const power_partsf near_one = power_split_one_minusf(sin2), elsewhere = power_splitf(cos2);
    const power_partsf parts = {is_near ? near_one.k : elsewhere.k, is_near ? near_one.f : elsewhere.f};
    const float log2_cos2 = power_log2_of_partsf(parts);
    const int is_positive = is_near | (cos2 > 0.0f);
    return unit_power_from_log2f(is_positive ? log2_cos2 : -(float)INFINITY, 0.5f * n);
}

/* base^exponent for any base >= 0: rounding may carry a cosine beyond 1. INFINITY from 2^127 up. */
static inline float powerf(float base, float exponent)
{
    const float n = exponent < 0x1p100f ? exponent : 0x1p100f;
    const float log2_power = n > 0.0f ? n * log2_unitf(base) : 0.0f;
    const float power = power_exp2f(log2_power);
    return log2_power < 127.0f ? power : (float)INFINITY;
}

#endif
