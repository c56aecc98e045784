/* base^exponent for 0 <= base <= 1 and exponent >= 0, in loops that vectorise.
 * generated from power.h.j2; do not edit: python -m symrender_cg.functions --write
 *
 * base^exponent = 2^(exponent log2 base). Nothing branches and nothing is looked up: what differs between arguments is
 * a select. The polynomials are plain * and + in the order written, so that the bits are the same on every machine as
 * long as contraction is off.
 *
 * Laws      x^0 = 1, also for x = 0; 0^n = 0 for n > 0; 1^n = 1; 0 <= x^n <= 1; never NaN. Powers below the smallest
 *           normal number, 2^-1022 (float 2^-126), are 0.
 * Error     of x^n, absolute, for the arguments as given: at most 2.46e-16 (float 1.32e-07), for n
 *           up to 2^1000 (float 2^100). With v = x^n it is v (|ln v| (error of log2 x + u) + error of 2^y), and
 *           v |ln v| <= 1/e, so a logarithm to a few u is enough for every n. u is the unit roundoff, 2^-53 (float
 *           2^-24). Proved: the polynomials and the roundings are bounded in ball arithmetic.
 *
 * unit_power(x, n)                      if x is all that is known. A relative error of x counts n x^n times.
 * unit_power_with_complement(x, g, n)   if g = 1 - x^2 is known too, with a small error relative to g itself. Where
 *                                       g < 1/2, x^n is (1 - g)^(n/2): an error of x is gone, and a relative error of
 *                                       g counts at most 0.54 times, whatever n. Elsewhere g is not used.
 * unit_power_from_log2(log2_x, n)       if one logarithm serves several exponents: log2_unit, log2_one_minus,
 *                                       log2_unit_with_complement.
 * A name that ends in f is the same in float.
 *
 * All of them share one logarithm, that of 1 + f. Both x = 2^k (1 + f) and 1 - g = 2^k (1 + f) are split without error,
 * so the complement costs a few selects; carrying 1 - g as a sum of two numbers would cost more and gain nothing.
 */
#ifndef SYMRENDER_POWER_H
#define SYMRENDER_POWER_H

#include <math.h>
#include <stdint.h>
#include <string.h>

/* double */

static inline uint64_t power_bits(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static inline double power_from_bits(uint64_t bits)
{
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* A positive number 2^k (1 + f), 11/16 <= 1 + f < 11/8. */
typedef struct {
    double k, f;
} power_parts;

/* x = 2^k (1 + f), exactly, for 0 < x <= 1. A subnormal x is scaled to a normal one first.
 * k becomes a double as the low bits of 2^52 + k: vectors before AVX-512 cannot convert 64 bit
 * integers. */
static inline power_parts power_split(double x)
{
    const int is_subnormal = x < 0x1p-1022;
    const uint64_t bits = power_bits(is_subnormal ? x * 0x1p54 : x);
    const uint64_t from_lowest = bits - UINT64_C(0x3fe6000000000000) + UINT64_C(0x3ff0000000000000);
    const uint64_t exponent = from_lowest >> 52;
    const uint64_t mantissa = (from_lowest & UINT64_C(0x000fffffffffffff)) + UINT64_C(0x3fe6000000000000);
    const power_parts parts = {
        power_from_bits(exponent | UINT64_C(0x4330000000000000))
            - (is_subnormal ? 0x1p52 + 1077.0 : 0x1p52 + 1023.0),
        power_from_bits(mantissa) - 1.0,
    };
    return parts;
}

/* 1 - g = 2^k (1 + f), exactly, for 0 <= g < 1/2: f = -g up to 5/16, else 1 - 2 g (exact: Sterbenz 1974). */
static inline power_parts power_split_one_minus(double g)
{
    const int is_direct = g <= 0.3125;
    const power_parts parts = {
        is_direct ? 0.0 : -1.0,
        is_direct ? -g : 1.0 - 2.0 * g,
    };
    return parts;
}

/* ln(1 + f), 11/16 <= 1 + f < 11/8
 * s = f / (2 + f) and z = s^2 give ln(1 + f) = 2 atanh(s) = 2 s + s z p(z) = f - (f^2/2 - s (f^2/2 + z p(z))): the
 * leading term is exact, and the others, with their errors, are smaller (the form of fdlibm's log, Sun 1993).
 * p alone: <= 0.0468 u */
static inline double power_ln_of_sum(double x)
{
    const double s = x / (2.0 + x);
    const double z = s * s, z2 = z * z;
    const double half_square = 0.5 * x * x;
    double p = 0.15055735214279847;
    p = p * z2 + (0.18184623792964741 + 0.15287466874348299 * z);
    p = p * z2 + (0.2857142894494975 + 0.22222177905332949 * z);
    p = p * z2 + (0.66666666666668672 + 0.39999999998509234 * z);
    return x - (half_square - s * (half_square + z * p));
}

/* log2 of 2^k (1 + f) <= 1                           error <= 2.78 u relative to the logarithm
 * log2(1 + f) alone: <= 2.49 u */
static inline double power_log2_of_parts(power_parts x)
{
    return x.k + power_ln_of_sum(x.f) * 1.4426950408889634;
}

/* log2(x), 0 <= x <= 1; -infinity for 0 */
static inline double log2_unit(double x)
{
    const double log2_x = power_log2_of_parts(power_split(x));
    return x > 0.0 ? log2_x : -(double)INFINITY;
}

/* log2(1 - g), 0 <= g <= 1, with a small relative error however small g is; -infinity for 1
 * From g = 1/2 up, where |log2(1 - g)| >= 1, 1 - g is rounded once: at most 0.8 u more. */
static inline double log2_one_minus(double g)
{
    const int is_below_half = g < 0.5;
    const power_parts exact = power_split_one_minus(g), rounded = power_split(1.0 - g);
    const power_parts parts = {is_below_half ? exact.k : rounded.k, is_below_half ? exact.f : rounded.f};
    const double log2_x = power_log2_of_parts(parts);
    return g < 1.0 ? log2_x : -(double)INFINITY;
}

/* log2(x), 0 <= x <= 1, where g = 1 - x^2 is known too: log2(1 - g) / 2 where g < 1/2, from x elsewhere */
static inline double log2_unit_with_complement(double x, double g)
{
    const int is_below_half = g < 0.5;
    const power_parts of_x = power_split(x), of_square = power_split_one_minus(g);
    const power_parts parts = {is_below_half ? of_square.k : of_x.k, is_below_half ? of_square.f : of_x.f};
    const double log2_parts = power_log2_of_parts(parts);
    const double log2_x = is_below_half ? 0.5 * log2_parts : log2_parts;
    return x > 0.0 ? log2_x : -(double)INFINITY;
}

/* 2^r - 1 = r ln 2 + r^2 q(r), |r| <= 1/2; of 2^r the polynomial alone errs by <= 0.182 u */
static inline double power_exp2_minus_one(double r)
{
    const double r2 = r * r;
    double q = 7.0725860902877691e-09 + 4.4566762559169464e-10 * r;
    q = q * r2 + (1.3215442587050853e-06 + 1.0178051723566915e-07 * r);
    q = q * r2 + (0.00015403530441737793 + 1.5252733853288374e-05 * r);
    q = q * r2 + (0.0096181291076068865 + 0.0013333558146395997 * r);
    q = q * r2 + (0.24022650695910097 + 0.055504108664821659 * r);
    return 0.69314718055994529 * r + r2 * q;
}

/* 2^y, y <= 0; 0 for y < -1022                         error <= 1.82 u
 * y = k + r with k the integer nearest to y, read off the low bits of y + 1.5 2^52, and added to the bits of
 * the exponent of 2^r. For y below the range all of this is arbitrary: the select discards it. */
static inline double power_exp2(double y)
{
    const double shifted = y + 0x1.8p52;
    const double r = y - (shifted - 0x1.8p52);
    const double two_to_r = 1.0 + power_exp2_minus_one(r);
    const uint64_t bits = power_bits(two_to_r) + (power_bits(shifted) << 52);
    return y < -1022.0 ? 0.0 : power_from_bits(bits);
}

/* x^exponent = 2^(exponent log2_x), for log2_x <= 0 or -infinity */
static inline double unit_power_from_log2(double log2_x, double exponent)
{
    return power_exp2(exponent > 0.0 ? exponent * log2_x : 0.0);
}

/* base^exponent */
static inline double unit_power(double base, double exponent)
{
    return unit_power_from_log2(log2_unit(base), exponent);
}

/* base^exponent, complement = 1 - base^2 */
static inline double unit_power_with_complement(double base, double complement, double exponent)
{
    return unit_power_from_log2(log2_unit_with_complement(base, complement), exponent);
}

/* float */

static inline uint32_t power_bitsf(float x)
{
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static inline float power_from_bitsf(uint32_t bits)
{
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* A positive number 2^k (1 + f), 11/16 <= 1 + f < 11/8. */
typedef struct {
    float k, f;
} power_partsf;

/* x = 2^k (1 + f), exactly, for 0 < x <= 1. A subnormal x is scaled to a normal one first.
 * k becomes a float as the low bits of 2^23 + k: vectors before AVX-512 cannot convert 64 bit
 * integers. */
static inline power_partsf power_splitf(float x)
{
    const int is_subnormal = x < 0x1p-126f;
    const uint32_t bits = power_bitsf(is_subnormal ? x * 0x1p25f : x);
    const uint32_t from_lowest = bits - UINT32_C(0x3f300000) + UINT32_C(0x3f800000);
    const uint32_t exponent = from_lowest >> 23;
    const uint32_t mantissa = (from_lowest & UINT32_C(0x007fffff)) + UINT32_C(0x3f300000);
    const power_partsf parts = {
        power_from_bitsf(exponent | UINT32_C(0x4b000000))
            - (is_subnormal ? 0x1p23f + 152.0f : 0x1p23f + 127.0f),
        power_from_bitsf(mantissa) - 1.0f,
    };
    return parts;
}

/* 1 - g = 2^k (1 + f), exactly, for 0 <= g < 1/2: f = -g up to 5/16, else 1 - 2 g (exact: Sterbenz 1974). */
static inline power_partsf power_split_one_minusf(float g)
{
    const int is_direct = g <= 0.3125f;
    const power_partsf parts = {
        is_direct ? 0.0f : -1.0f,
        is_direct ? -g : 1.0f - 2.0f * g,
    };
    return parts;
}

/* ln(1 + f), 11/16 <= 1 + f < 11/8
 * s = f / (2 + f) and z = s^2 give ln(1 + f) = 2 atanh(s) = 2 s + s z p(z) = f - (f^2/2 - s (f^2/2 + z p(z))): the
 * leading term is exact, and the others, with their errors, are smaller (the form of fdlibm's log, Sun 1993).
 * p alone: <= 0.0258 u */
static inline float power_ln_of_sumf(float x)
{
    const float s = x / (2.0f + x);
    const float z = s * s, z2 = z * z;
    const float half_square = 0.5f * x * x;
    float p = 0.300949514f;
    p = p * z2 + (0.666668415f + 0.399692833f * z);
    return x - (half_square - s * (half_square + z * p));
}

/* log2 of 2^k (1 + f) <= 1                           error <= 2.85 u relative to the logarithm
 * log2(1 + f) alone: <= 2.57 u */
static inline float power_log2_of_partsf(power_partsf x)
{
    return x.k + power_ln_of_sumf(x.f) * 1.44269502f;
}

/* log2(x), 0 <= x <= 1; -infinity for 0 */
static inline float log2_unitf(float x)
{
    const float log2_x = power_log2_of_partsf(power_splitf(x));
    return x > 0.0f ? log2_x : -(float)INFINITY;
}

/* log2(1 - g), 0 <= g <= 1, with a small relative error however small g is; -infinity for 1
 * From g = 1/2 up, where |log2(1 - g)| >= 1, 1 - g is rounded once: at most 0.8 u more. */
static inline float log2_one_minusf(float g)
{
    const int is_below_half = g < 0.5f;
    const power_partsf exact = power_split_one_minusf(g), rounded = power_splitf(1.0f - g);
    const power_partsf parts = {is_below_half ? exact.k : rounded.k, is_below_half ? exact.f : rounded.f};
    const float log2_x = power_log2_of_partsf(parts);
    return g < 1.0f ? log2_x : -(float)INFINITY;
}

/* log2(x), 0 <= x <= 1, where g = 1 - x^2 is known too: log2(1 - g) / 2 where g < 1/2, from x elsewhere */
static inline float log2_unit_with_complementf(float x, float g)
{
    const int is_below_half = g < 0.5f;
    const power_partsf of_x = power_splitf(x), of_square = power_split_one_minusf(g);
    const power_partsf parts = {is_below_half ? of_square.k : of_x.k, is_below_half ? of_square.f : of_x.f};
    const float log2_parts = power_log2_of_partsf(parts);
    const float log2_x = is_below_half ? 0.5f * log2_parts : log2_parts;
    return x > 0.0f ? log2_x : -(float)INFINITY;
}

/* 2^r - 1 = r ln 2 + r^2 q(r), |r| <= 1/2; of 2^r the polynomial alone errs by <= 0.138 u */
static inline float power_exp2_minus_onef(float r)
{
    const float r2 = r * r;
    float q = 0.000154697511f;
    q = q * r2 + (0.00961803086f + 0.00133908668f * r);
    q = q * r2 + (0.240226507f + 0.0555035695f * r);
    return 0.693147182f * r + r2 * q;
}

/* 2^y, y <= 0; 0 for y < -126                         error <= 1.77 u
 * y = k + r with k the integer nearest to y, read off the low bits of y + 1.5 2^23, and added to the bits of
 * the exponent of 2^r. For y below the range all of this is arbitrary: the select discards it. */
static inline float power_exp2f(float y)
{
    const float shifted = y + 0x1.8p23f;
    const float r = y - (shifted - 0x1.8p23f);
    const float two_to_r = 1.0f + power_exp2_minus_onef(r);
    const uint32_t bits = power_bitsf(two_to_r) + (power_bitsf(shifted) << 23);
    return y < -126.0f ? 0.0f : power_from_bitsf(bits);
}

/* x^exponent = 2^(exponent log2_x), for log2_x <= 0 or -infinity */
static inline float unit_power_from_log2f(float log2_x, float exponent)
{
    return power_exp2f(exponent > 0.0f ? exponent * log2_x : 0.0f);
}

/* base^exponent */
static inline float unit_powerf(float base, float exponent)
{
    return unit_power_from_log2f(log2_unitf(base), exponent);
}

/* base^exponent, complement = 1 - base^2 */
static inline float unit_power_with_complementf(float base, float complement, float exponent)
{
    return unit_power_from_log2f(log2_unit_with_complementf(base, complement), exponent);
}

#endif
