/* The power of a cosine in two halves, its logarithm and 2^y, in loops that vectorise.
 * generated from lobe_power.h.j2; do not edit: python -m symrender_cg.functions --write
 *
 * cos^n = 2^(n/2 log2 cos^2). A loop of either half is so short that a processor works on several vectors at once.
 * Where power.h is as accurate as it can be, these save operations: the leading term of the logarithm is rounded too,
 * and a polynomial is summed four terms at a time (Estrin 1960).
 *
 * Error     of the power, absolute, for the arguments as given: at most 2.74e-16 (float 1.47e-07),
 *           proved in ball arithmetic, roundings included.
 * Laws      x^0 = 1, also for x = 0; 0 <= x^n <= 1; never NaN for 0 <= cos2, 0 <= sin2 and n >= 0. A cos2 below the
 *           smallest normal number counts as that; powers below it are 0.
 */
#ifndef SYMRENDER_LOBE_POWER_H
#define SYMRENDER_LOBE_POWER_H

#include "inline.h"
#include "power.h"

/* x = 2^k (1 + f), 11/16 <= 1 + f < 11/8, exactly, for a normal number x: as power_split, which takes others too. */
static inline power_parts lobe_split(double x)
{
    const uint64_t from_lowest = power_bits(x) - UINT64_C(0x3fe6000000000000) + UINT64_C(0x3ff0000000000000);
    const uint64_t mantissa = (from_lowest & UINT64_C(0x000fffffffffffff)) + UINT64_C(0x3fe6000000000000);
    const power_parts parts = {
        power_from_bits((from_lowest >> 52) | UINT64_C(0x4330000000000000)) - (0x1p52 + 1023.0),
        power_from_bits(mantissa) - 1.0,
    };
    return parts;
}

/* log2 of 2^k (1 + f) <= 1                           error <= 3.67 u relative to the logarithm
 * log2(1 + f) = 2 / ln 2 atanh(s) = s (2 / ln 2 + z p(z)), s = f / (2 + f), z = s^2 */
static inline double lobe_log2_of_parts(power_parts x)
{
    const double s = x.f / (2.0 + x.f);
    const double z = s * s, z2 = z * z, z4 = z2 * z2;
    double p = (0.26234866566541687 + 0.22055152647376594 * z)
        + 0.2172083453057887 * z2;
    p = p * z4
        + ((0.96179669392600464 + 0.57707801633407818 * z)
        + (0.41219858849990398 + 0.32059825861776137 * z) * z2);
    return x.k + s * (2.8853900817779268 + z * p);
}

/* log2 (cos a)^2 from cos2 = cos^2 a and sin2 = sin^2 a, 0 <= a <= 90 degrees; always finite. Where sin2 < 1/2 it is
 * log2(1 - sin2), whose error is in proportion to sin2. */
static inline double log2_of_lobe(double cos2, double sin2)
{
    const int is_near = sin2 < 0.5;
    const power_parts near = power_split_one_minus(sin2);
    const power_parts elsewhere = lobe_split(cos2 > 0x1p-1022 ? cos2 : 0x1p-1022);
    const power_parts parts = {is_near ? near.k : elsewhere.k, is_near ? near.f : elsewhere.f};
    return lobe_log2_of_parts(parts);
}

/* (cos a)^exponent = 2^y, y = exponent/2 log2_cos2; 1 for an exponent of 0          error of 2^y <= 1.86 u
 * y = k + r with k the integer nearest to y, as in power_exp2. */
static inline double power_of_lobe(double log2_cos2, double exponent)
{
    const double y = 0.5 * exponent * log2_cos2;
    const double shifted = y + 0x1.8p52;
    const double r = y - (shifted - 0x1.8p52);
    const double r2 = r * r, r4 = r2 * r2;
    double q = 7.0725860902877691e-09 + 4.4566762559169464e-10 * r;
    q = q * r4
        + ((0.00015403530441737793 + 1.5252733853288374e-05 * r)
        + (1.3215442587050853e-06 + 1.0178051723566915e-07 * r) * r2);
    q = q * r4
        + ((0.24022650695910097 + 0.055504108664821659 * r)
        + (0.0096181291076068865 + 0.0013333558146395997 * r) * r2);
    const double two_to_r = 1.0 + (0.69314718055994529 * r + r2 * q);
    const uint64_t bits = power_bits(two_to_r) + (power_bits(shifted) << 52);
    return y < -1022.0 ? 0.0 : power_from_bits(bits);
}

/* (1 - sin2)^h for a block of points and a whole h >= 1, by squaring: where g is 1 - p, g (2 - g) is 1 - p^2, and its
 * relative error grows by less than 2 u a step, however close p is to 1. `g` is room for as many numbers. */
SYMRENDER_INLINE void whole_powers_of_lobe(
    const double *restrict sin2, double *restrict g, double *restrict power, int h, int count)
{
    if (h % 4 == 0)
        for (int i = 0; i < count; ++i) {
            const double g2 = sin2[i] * (2.0 - sin2[i]);
            g[i] = g2 * (2.0 - g2);
        }
    else
        for (int i = 0; i < count; ++i)
            g[i] = sin2[i];
    for (h = h % 4 == 0 ? h / 4 : h; h % 2 == 0; h /= 2)
        for (int i = 0; i < count; ++i)
            g[i] = g[i] * (2.0 - g[i]);
    for (int i = 0; i < count; ++i)
        power[i] = g[i] < 1.0 ? 1.0 - g[i] : 0.0;
    while ((h /= 2) > 0) {
        for (int i = 0; i < count; ++i)
            g[i] = g[i] * (2.0 - g[i]);
        if (h % 2 == 1)
            for (int i = 0; i < count; ++i)
                power[i] = power[i] * (1.0 - g[i]);
    }
}

/* x = 2^k (1 + f), 11/16 <= 1 + f < 11/8, exactly, for a normal number x: as power_splitf, which takes others too. */
static inline power_partsf lobe_splitf(float x)
{
    const uint32_t from_lowest = power_bitsf(x) - UINT32_C(0x3f300000) + UINT32_C(0x3f800000);
    const uint32_t mantissa = (from_lowest & UINT32_C(0x007fffff)) + UINT32_C(0x3f300000);
    const power_partsf parts = {
        power_from_bitsf((from_lowest >> 23) | UINT32_C(0x4b000000)) - (0x1p23f + 127.0f),
        power_from_bitsf(mantissa) - 1.0f,
    };
    return parts;
}

/* log2 of 2^k (1 + f) <= 1                           error <= 3.76 u relative to the logarithm
 * log2(1 + f) = 2 / ln 2 atanh(s) = s (2 / ln 2 + z p(z)), s = f / (2 + f), z = s^2 */
static inline float lobe_log2_of_partsf(power_partsf x)
{
    const float s = x.f / (2.0f + x.f);
    const float z = s * s, z2 = z * z;
    float p = (0.961799204f + 0.576634884f * z)
        + 0.434178352f * z2;
    return x.k + s * (2.88539004f + z * p);
}

/* log2 (cos a)^2 from cos2 = cos^2 a and sin2 = sin^2 a, 0 <= a <= 90 degrees; always finite. Where sin2 < 1/2 it is
 * log2(1 - sin2), whose error is in proportion to sin2. */
static inline float log2_of_lobef(float cos2, float sin2)
{
    const int is_near = sin2 < 0.5f;
    const power_partsf near = power_split_one_minusf(sin2);
    const power_partsf elsewhere = lobe_splitf(cos2 > 0x1p-126f ? cos2 : 0x1p-126f);
    const power_partsf parts = {is_near ? near.k : elsewhere.k, is_near ? near.f : elsewhere.f};
    return lobe_log2_of_partsf(parts);
}

/* (cos a)^exponent = 2^y, y = exponent/2 log2_cos2; 1 for an exponent of 0          error of 2^y <= 1.82 u
 * y = k + r with k the integer nearest to y, as in power_exp2f. */
static inline float power_of_lobef(float log2_cos2, float exponent)
{
    const float n = exponent < 0x1p100f ? exponent : 0x1p100f;   /* a double's exponent may have become INFINITY */
    const float y = 0.5f * n * log2_cos2;
    const float shifted = y + 0x1.8p23f;
    const float r = y - (shifted - 0x1.8p23f);
    const float r2 = r * r, r4 = r2 * r2;
    float q = 0.000154697511f;
    q = q * r4
        + ((0.240226507f + 0.0555035695f * r)
        + (0.00961803086f + 0.00133908668f * r) * r2);
    const float two_to_r = 1.0f + (0.693147182f * r + r2 * q);
    const uint32_t bits = power_bitsf(two_to_r) + (power_bitsf(shifted) << 23);
    return y < -126.0f ? 0.0f : power_from_bitsf(bits);
}

/* (1 - sin2)^h for a block of points and a whole h >= 1, by squaring: where g is 1 - p, g (2 - g) is 1 - p^2, and its
 * relative error grows by less than 2 u a step, however close p is to 1. `g` is room for as many numbers. */
SYMRENDER_INLINE void whole_powers_of_lobef(
    const float *restrict sin2, float *restrict g, float *restrict power, int h, int count)
{
    if (h % 4 == 0)
        for (int i = 0; i < count; ++i) {
            const float g2 = sin2[i] * (2.0f - sin2[i]);
            g[i] = g2 * (2.0f - g2);
        }
    else
        for (int i = 0; i < count; ++i)
            g[i] = sin2[i];
    for (h = h % 4 == 0 ? h / 4 : h; h % 2 == 0; h /= 2)
        for (int i = 0; i < count; ++i)
            g[i] = g[i] * (2.0f - g[i]);
    for (int i = 0; i < count; ++i)
        power[i] = g[i] < 1.0f ? 1.0f - g[i] : 0.0f;
    while ((h /= 2) > 0) {
        for (int i = 0; i < count; ++i)
            g[i] = g[i] * (2.0f - g[i]);
        if (h % 2 == 1)
            for (int i = 0; i < count; ++i)
                power[i] = power[i] * (1.0f - g[i]);
    }
}

#endif
