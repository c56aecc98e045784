/* exp2, log2, expm1, log1p and pow in float, double and double-double, for all arguments, in loops that vectorise.
 * generated from elementary.h.j2; do not edit: python -m symrender_cg.functions --write
 *
 * The polynomials have one home each: float and double in power.h, double-double in precise_power.h. Here is what leads
 * any argument to them. Relative errors, proved in ball arithmetic with every rounding:
 *
 *                   float, u = 2^-24     double, u = 2^-53     double-double, normalised
 *   exp2            1.77 u               1.82 u                2^-97.6
 *   log2            3.61 u               3.53 u                2^-100.0
 *   expm1           5.59 u               5.85 u                2^-94.1
 *   log1p           2.94 u               2.97 u                2^-99.7
 *   pow             1.00000089 u         1.0000095 u           2^-89.9
 *
 * An error of 1 u is at most one of half an ulp. The bounds hold where the result is a normal number; below, half of
 * the smallest subnormal number comes to it. A double-double result keeps its accuracy from 2^-900 up. NaN comes from
 * NaN and from what has no real value; exact cases such as 2^3, log2 8, x^1 are not promised to be exact.
 *
 * The square root is an instruction, sqrt: half an ulp; in double-double dd_sqrt of double_double.h: 25/8 u^2.
 */
#ifndef SYMRENDER_ELEMENTARY_H
#define SYMRENDER_ELEMENTARY_H

#include "inline.h"
#include "power.h"
#include "precise_power.h"

/* double */

/* 2^k for the integer k of shifted = k + 1.5 2^52 */
SYMRENDER_INLINE double elementary_power_of_two(double shifted)
{
    return power_from_bits((power_bits(shifted) << 52) + UINT64_C(0x3ff0000000000000));
}

/* x 2^k in two steps, for k that no single power of two holds */
SYMRENDER_INLINE double elementary_scaled(double x, double k)
{
    const double half = 0.5 * k + 0x1.8p52;
    const double rest = (k - (half - 0x1.8p52)) + 0x1.8p52;
    return x * elementary_power_of_two(half) * elementary_power_of_two(rest);
}

/* 2^y; 0 and INFINITY beyond the range               error <= 1.82 u */
SYMRENDER_INLINE double exp2_double(double y)
{
    const double from_below = y > -1079.0 ? y : -1079.0;
    const double bounded = from_below < 1030.0 ? from_below : 1030.0;
    const double k = (bounded + 0x1.8p52) - 0x1.8p52;
    const double two_to_y = elementary_scaled(1.0 + power_exp2_minus_one(bounded - k), k);
    return y == y ? two_to_y : y;
}

/* log2(x); -INFINITY for 0, NaN below                error <= 3.53 u */
SYMRENDER_INLINE double log2_double(double x)
{
    const double log2_x = power_log2_of_parts(power_split(x));
    const double finite = x < (double)INFINITY ? log2_x : x;
    const double positive = x > 0.0 ? finite : -(double)INFINITY;
    return x >= 0.0 ? positive : (double)NAN;
}

/* e^x - 1                                            error <= 5.85 u
 * x / ln 2 = k + r + rest, with the product's remainder in rest: 2^k (2^r - 1 + rest ln 2 2^r) + (2^k - 1), halved so
 * that 2^k does not overflow before the sum does. Below u, x itself: the next term is x^2 / 2. */
SYMRENDER_INLINE double expm1_double(double x)
{
    const double from_below = x > -61.0 ? x : -61.0;
    const double bounded = from_below < 709.7935433180802 ? from_below : 709.7935433180802;
    const double y = bounded * 1.4426950408889634;
    const double rest = fma(bounded, 2.0355273740931033e-17, fma(bounded, 1.4426950408889634, -y));
    const double shifted = y + 0x1.8p52;
    const double exp2_r = power_exp2_minus_one(y - (shifted - 0x1.8p52));
    const double e = exp2_r + (rest * 0.69314718055994529) * (1.0 + exp2_r);
    const double half = elementary_power_of_two(shifted - 1.0);
    const double expm1_x = 2.0 * (e * half + (half - 0.5));
    const int is_itself = ((x < 0x1p-54) & (x > -0x1p-54)) | (x != x);
    return is_itself ? x : expm1_x;
}

/* ln(1 + x); -INFINITY for -1, NaN below             error <= 2.97 u
 * 1 + x = u + c exactly, u = 2^k (1 + f): ln(1 + x) = k ln 2 + ln(1 + f) + c / u. Near 0 f is x itself. */
SYMRENDER_INLINE double log1p_double(double x)
{
    const double u = 1.0 + x;
    const double larger = x > 1.0 ? x : 1.0, smaller = x > 1.0 ? 1.0 : x;
    const double c = smaller - (u - larger);
    const int is_direct = (x >= -0.3125) & (x < 0.375);
    const power_parts sum = power_split(u);
    const double k = is_direct ? 0.0 : sum.k, rest = is_direct ? 0.0 : c / u;
    const double ln = power_ln_of_sum(is_direct ? x : sum.f);
    const double log1p_x = k * 0.69314718055989033 + (ln + (k * 5.4979230187083712e-14 + rest));
    const double finite = x < (double)INFINITY ? log1p_x : x;
    const double positive = u > 0.0 ? finite : -(double)INFINITY;
    return u >= 0.0 ? positive : (double)NAN;
}

/* float */

/* 2^k for the integer k of shifted = k + 1.5 2^23 */
SYMRENDER_INLINE float elementary_power_of_twof(float shifted)
{
    return power_from_bitsf((power_bitsf(shifted) << 23) + UINT32_C(0x3f800000));
}

/* x 2^k in two steps, for k that no single power of two holds */
SYMRENDER_INLINE float elementary_scaledf(float x, float k)
{
    const float half = 0.5f * k + 0x1.8p23f;
    const float rest = (k - (half - 0x1.8p23f)) + 0x1.8p23f;
    return x * elementary_power_of_twof(half) * elementary_power_of_twof(rest);
}

/* 2^y; 0 and INFINITY beyond the range               error <= 1.77 u */
SYMRENDER_INLINE float exp2_single(float y)
{
    const float from_below = y > -154.0f ? y : -154.0f;
    const float bounded = from_below < 134.0f ? from_below : 134.0f;
    const float k = (bounded + 0x1.8p23f) - 0x1.8p23f;
    const float two_to_y = elementary_scaledf(1.0f + power_exp2_minus_onef(bounded - k), k);
    return y == y ? two_to_y : y;
}

/* log2(x); -INFINITY for 0, NaN below                error <= 3.61 u */
SYMRENDER_INLINE float log2_single(float x)
{
    const float log2_x = power_log2_of_partsf(power_splitf(x));
    const float finite = x < (float)INFINITY ? log2_x : x;
    const float positive = x > 0.0f ? finite : -(float)INFINITY;
    return x >= 0.0f ? positive : (float)NAN;
}

/* e^x - 1                                            error <= 5.59 u
 * x / ln 2 = k + r + rest, with the product's remainder in rest: 2^k (2^r - 1 + rest ln 2 2^r) + (2^k - 1), halved so
 * that 2^k does not overflow before the sum does. Below u, x itself: the next term is x^2 / 2. */
SYMRENDER_INLINE float expm1_single(float x)
{
    const float from_below = x > -32.0f ? x : -32.0f;
    const float bounded = from_below < 88.7241898f ? from_below : 88.7241898f;
    const float y = bounded * 1.44269502f;
    const float rest = fmaf(bounded, 1.92596303e-08f, fmaf(bounded, 1.44269502f, -y));
    const float shifted = y + 0x1.8p23f;
    const float exp2_r = power_exp2_minus_onef(y - (shifted - 0x1.8p23f));
    const float e = exp2_r + (rest * 0.693147182f) * (1.0f + exp2_r);
    const float half = elementary_power_of_twof(shifted - 1.0f);
    const float expm1_x = 2.0f * (e * half + (half - 0.5f));
    const int is_itself = ((x < 0x1p-24f) & (x > -0x1p-24f)) | (x != x);
    return is_itself ? x : expm1_x;
}

/* ln(1 + x); -INFINITY for -1, NaN below             error <= 2.94 u
 * 1 + x = u + c exactly, u = 2^k (1 + f): ln(1 + x) = k ln 2 + ln(1 + f) + c / u. Near 0 f is x itself. */
SYMRENDER_INLINE float log1p_single(float x)
{
    const float u = 1.0f + x;
    const float larger = x > 1.0f ? x : 1.0f, smaller = x > 1.0f ? 1.0f : x;
    const float c = smaller - (u - larger);
    const int is_direct = (x >= -0.3125f) & (x < 0.375f);
    const power_partsf sum = power_splitf(u);
    const float k = is_direct ? 0.0f : sum.k, rest = is_direct ? 0.0f : c / u;
    const float ln = power_ln_of_sumf(is_direct ? x : sum.f);
    const float log1p_x = k * 0.693145752f + (ln + (k * 1.42860677e-06f + rest));
    const float finite = x < (float)INFINITY ? log1p_x : x;
    const float positive = u > 0.0f ? finite : -(float)INFINITY;
    return u >= 0.0f ? positive : (float)NAN;
}

/* double-double */

/* x = 2^k (1 - g) for any positive x; see precise_split */
SYMRENDER_INLINE precise_parts elementary_split(double_double x)
{
    const int is_large = x.hi >= 0x1p1000;
    precise_parts parts = precise_split(dd_scale(x, is_large ? 0x1p-54 : 1.0));
    parts.k = parts.k + (is_large ? 54.0 : 0.0);
    return parts;
}

/* x 2^k, k the integer of shifted; 0 and INFINITY where y, which k is near, is beyond the range */
SYMRENDER_INLINE double_double elementary_dd_scaled(double_double x, double y, double shifted)
{
    const double k = shifted - 0x1.8p52;
    const int is_large = y >= 1024.0, is_small = y < -1080.0;
    const int is_outside = is_large | is_small;
    const double bounded = is_outside ? 0.0 : k;
    const double hi = elementary_scaled(x.hi, bounded), lo = elementary_scaled(x.lo, bounded);
    const double above = is_large ? (double)INFINITY : hi;
    const int is_alone = is_outside | !(hi < (double)INFINITY);
    const double_double scaled = {is_small ? 0.0 : above, is_alone ? 0.0 : lo};
    return scaled;
}

/* 2^y                                                error <= 2^-97.6 */
SYMRENDER_INLINE double_double dd_exp2(double_double y)
{
    const double shifted = y.hi + 0x1.8p52;
    const double_double r = dd_sum(y.hi - (shifted - 0x1.8p52), y.lo);
    return elementary_dd_scaled(dd_exp2_of_fraction(r), y.hi, shifted);
}

/* log2(x), x > 0                                     error <= 2^-100.0 */
SYMRENDER_INLINE double_double dd_log2(double_double x)
{
    const double_double log2_x = dd_log2_of_parts(elementary_split(x));
    return dd_ordered_sum(log2_x.hi, log2_x.lo);
}

/* ln(1 + x), x > -1                                  error <= 2^-99.7
 * log2(1 + x) ln 2; near 0 from x itself, elsewhere from the rounded sum, whose logarithm is then at least 0.49. */
SYMRENDER_INLINE double_double dd_log1p(double_double x)
{
    const int is_direct = (x.hi > -0.296875) & (x.hi < 0.40625);
    const precise_parts sum = elementary_split(dd_add_double(x, 1.0));
    const precise_parts parts = {
        is_direct ? 0.0 : sum.k,
        {is_direct ? -x.hi : sum.g.hi, is_direct ? -x.lo : sum.g.lo},
    };
    const double_double log2_x = dd_log2_of_parts(parts);
    const double_double ln2 = (double_double){0.69314718055994529, 2.3190468138462996e-17};
    return dd_mul(dd_ordered_sum(log2_x.hi, log2_x.lo), ln2);
}

/* e^x - 1, x < 709; a smaller x counts as -700       error <= 2^-94.1
 * x / ln 2 = k + r, and from e = 2^(r/8) - 1 three times e (2 + e) to 2^r - 1; then 2^k of it and 2^k - 1. */
SYMRENDER_INLINE double_double dd_expm1(double_double x)
{
    const double_double inverse_ln2 = (double_double){1.4426950408889634, 2.0355273740931033e-17};
    const double_double bounded = {x.hi > -700.0 ? x.hi : -700.0, x.hi > -700.0 ? x.lo : 0.0};
    const double_double y = dd_mul(bounded, inverse_ln2);
    const double shifted = y.hi + 0x1.8p52;
    const double_double r = dd_sum(y.hi - (shifted - 0x1.8p52), y.lo);
    const double_double d = dd_exp2_quotient(r.hi);
    const double_double product = dd_product(r.hi, d.hi);
    const double e_lo = fma(r.hi, d.lo, product.lo) + (r.lo * 0.086643397569993161) * (1.0 + product.hi);
    double_double e = dd_ordered_sum(product.hi, e_lo);
    e = dd_mul(e, dd_add_double(e, 2.0));
    e = dd_mul(e, dd_add_double(e, 2.0));
    e = dd_mul(e, dd_add_double(e, 2.0));
    const double two_to_k = elementary_power_of_two(shifted);
    return dd_add(dd_scale(e, two_to_k), dd_difference(two_to_k, 1.0));
}

/* x^y, x >= 0; x^0 = 1                               error <= 2^-89.9 for results from 2^-900 */
SYMRENDER_INLINE double_double dd_pow(double_double x, double y)
{
    const precise_exponent exponent = precise_exponent_of(dd_log2_of_parts(elementary_split(x)), y);
    const double_double power = elementary_dd_scaled(dd_exp2_of_fraction(exponent.r), exponent.y, exponent.shifted);
    const int is_zero = (x.hi <= 0.0) & (y > 0.0), is_pole = (x.hi <= 0.0) & (y < 0.0), is_one = y == 0.0;
    const double of_zero = is_zero ? 0.0 : is_pole ? (double)INFINITY : 1.0;
    const int is_special = is_zero | is_pole | is_one;
    const double_double result = {is_special ? of_zero : power.hi, is_special ? 0.0 : power.lo};
    return result;
}

/* x^y, x >= 0, y finite; x^0 = 1                     error <= 1.0000095 u: rounded once, from 69 bits */
SYMRENDER_INLINE double pow_double(double x, double y)
{
    const precise_exponent exponent = precise_exponent_of(precise_log2_of_parts(elementary_split(dd_from(x))), y);
    const double_double power = precise_exp2_of_fraction(exponent.r);
    const double bounded = elementary_dd_scaled(power, exponent.y, exponent.shifted).hi;
    const double of_zero = y > 0.0 ? 0.0 : (double)INFINITY, of_infinity = y > 0.0 ? (double)INFINITY : 0.0;
    const double from_zero = x > 0.0 ? bounded : of_zero;
    const double positive = x < (double)INFINITY ? from_zero : of_infinity;
    const double real = x >= 0.0 ? positive : (double)NAN;
    return y == 0.0 ? 1.0 : real;
}

/* x^y, x >= 0, y finite; x^0 = 1                     error <= 1.00000089 u: rounded once, from double */
SYMRENDER_INLINE float pow_single(float x, float y)
{
    const double log2_x = log2_double((double)x);
    return (float)exp2_double(y == 0.0f ? 0.0 : (double)y * log2_x);
}

#endif
