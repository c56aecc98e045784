/* Powers of a cosine to 69 and to 90 bits, results in two doubles, in loops that vectorise.
 * generated from precise_power.h.j2; do not edit: python -m symrender_cg.functions --write
 *
 * cos^n = 2^(n/2 log2 cos^2). The logarithm and 2^y are polynomials whose leading terms are sums hi + lo of two doubles
 * and whose tails are doubles. Nothing branches and nothing is looked up: what differs between arguments is a select.
 *
 *                              arguments                          error, relative to the result     0 below
 * precise_power_of_cosine      |lo| <= 2^-40 |hi|                 2^-69.6                           2^-1000
 * dd_power_of_cosine           normalised: hi = RN(hi + lo)       2^-90.1                           2^-900
 *
 * Laws      x^0 = 1, also for x = 0; 0^n = 0 for n > 0; 0 <= x^n <= 1; never NaN. 0 <= n <= 2^200.
 * Error     for the arguments as given: what they err by is the caller's to add. With s = sin^2 < 1/2 a small ds moves
 *           the power by its (n/2) ds / (1 - s); from s = 1/2 up, dc moves it by its (n/2) dc / cos^2. Proved:
 *           polynomials and roundings are bounded in ball arithmetic. The bound is that of the smallest results, where
 *           the error of y = log2 of the power counts most; near 1 it is 2^-71.1 and 2^-97.6.
 * Results   are normalised, hi = RN(hi + lo), except for what underflows: lo is a multiple of 2^-1074.
 */
#ifndef SYMRENDER_PRECISE_POWER_H
#define SYMRENDER_PRECISE_POWER_H

#include "double_double.h"
#include "inline.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

/* |computed - true| <= PRECISE_POWER_ERROR true + 2^-1000, and likewise with DD_POWER_ERROR and 2^-900. */
#define PRECISE_POWER_ERROR 0x1p-69
#define DD_POWER_ERROR 0x1p-90

SYMRENDER_INLINE uint64_t precise_bits(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

SYMRENDER_INLINE double precise_from_bits(uint64_t bits)
{
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* A positive number 2^k (1 - g). */
typedef struct {
    double k;
    double_double g;
} precise_parts;

/* x = 2^k (1 - g), 45/64 <= 1 - g.hi < 45/32, exactly, for 0 < x.hi < 2^1023. A subnormal x is scaled first.
 * k becomes a double as the low bits of 2^52 + k: vectors before AVX-512 cannot convert 64 bit integers. */
SYMRENDER_INLINE precise_parts precise_split(double_double x)
{
    const int is_subnormal = x.hi < 0x1p-1022;
    const double scale = is_subnormal ? 0x1p54 : 1.0;
    const double hi = x.hi * scale, lo = x.lo * scale;
    const uint64_t exponent = (precise_bits(hi) - UINT64_C(0x3fe6800000000000) + UINT64_C(0x3ff0000000000000)) >> 52;
    const double unscale = precise_from_bits((UINT64_C(2046) - exponent) << 52);   /* 2^-k */
    const precise_parts parts = {
        precise_from_bits(exponent | UINT64_C(0x4330000000000000)) - (is_subnormal ? 0x1p52 + 1077.0 : 0x1p52 + 1023.0),
        {1.0 - hi * unscale, -(lo * unscale)},
    };
    return parts;
}

/* cos^2 = 2^k (1 - g), from sin^2 where that is below 1/2: as it is up to 19/64, then by 1 - sin^2. A cos^2 of 0
 * gives finite parts of no meaning. 1 - sin^2 keeps what its subtraction drops. */
SYMRENDER_INLINE precise_parts precise_split_of_cosine(double_double cos2, double_double sin2)
{
    const int is_near = sin2.hi < 0.5, is_direct = sin2.hi <= 0.296875;
    const double hi = 1.0 - sin2.hi;
    const double lo = ((1.0 - hi) - sin2.hi) - sin2.lo;
    const double_double x = {is_near ? hi : cos2.hi, is_near ? lo : cos2.lo};
    const precise_parts split = precise_split(x);
    const precise_parts parts = {
        split.k,
        {is_direct ? sin2.hi : split.g.hi, is_direct ? sin2.lo : split.g.lo},
    };
    return parts;
}

/* c + z x, |z x| < |c| / 2. What hi = RN(c.hi + z.hi x.hi) drops is z.hi x.hi + (c.hi - hi), the difference exact
 * (Sterbenz 1974). Left out: z.lo x.lo. */
SYMRENDER_INLINE double_double precise_step(double_double c, double_double z, double_double x)
{
    const double hi = fma(z.hi, x.hi, c.hi);
    const double dropped = fma(z.hi, x.hi, c.hi - hi);
    const double_double sum = {hi, dropped + fma(z.lo, x.hi, fma(z.hi, x.lo, c.lo))};
    return sum;
}

/* c + z x for a double z, |z x| < |c| / 2 */
SYMRENDER_INLINE double_double precise_step_by_double(double_double c, double z, double_double x)
{
    const double hi = fma(z, x.hi, c.hi);
    const double dropped = fma(z, x.hi, c.hi - hi);
    const double_double sum = {hi, dropped + fma(z, x.lo, c.lo)};
    return sum;
}

/* c + z x for doubles z and x, |z x| < |c| / 2 */
SYMRENDER_INLINE double_double precise_step_of_doubles(double_double c, double z, double x)
{
    const double hi = fma(z, x, c.hi);
    const double_double sum = {hi, fma(z, x, c.hi - hi) + c.lo};
    return sum;
}

/* x^2 without x.lo^2 */
SYMRENDER_INLINE double_double precise_square(double_double x)
{
    const double hi = x.hi * x.hi;
    const double_double square = {hi, fma(2.0 * x.hi, x.lo, fma(x.hi, x.hi, -hi))};
    return square;
}

/* f / (2 + f): the quotient of the high parts, and the remainder f - s.hi (2 + f) divided too */
SYMRENDER_INLINE double_double precise_atanh_argument(double_double f)
{
    const double d = 2.0 + f.hi;
    const double d_lo = ((2.0 - d) + f.hi) + f.lo;
    const double inverse = 1.0 / d;
    const double hi = f.hi * inverse;
    const double remainder = fma(-hi, d_lo, fma(-hi, d, f.hi) + f.lo);
    const double_double s = {hi, remainder * inverse};
    return s;
}

/* n log2 x = k + r, |r| <= 1/2, with k the integer nearest to it: the low bits of shifted = k + 1.5 2^52 hold k. */
typedef struct {
    double y, shifted;
    double_double r;
} precise_exponent;

SYMRENDER_INLINE precise_exponent precise_exponent_of(double_double log2_x, double n)
{
    const double y = n * log2_x.hi;
    const double y_lo = fma(n, log2_x.lo, fma(n, log2_x.hi, -y));
    const double shifted = y + 0x1.8p52;
    const precise_exponent exponent = {y, shifted, dd_ordered_sum(y - (shifted - 0x1.8p52), y_lo)};
    return exponent;
}

/* log2 of 2^k (1 - g)                                error <= 2^-79.8 relative to the logarithm
 * 1 - g = (1 + f) / c with c in {5/4, 1, 13/16} and |f| <= 0.149: g c is exact in two doubles, and (c - 1) - g c of its
 * high part too (Sterbenz). With s = f / (2 + f) and z = s^2 < 0.00506
 *     log2(1 + f) = 2 / ln 2 atanh(s) = s (c0 + c1 z + ... + c7 z^7),
 * c0 to c3 in two doubles; the polynomial alone errs by 2^-80.0. */
SYMRENDER_INLINE double_double precise_log2_of_parts(precise_parts x)
{
    const int is_low = x.g.hi > 0.1328125, is_high = x.g.hi < -0.1484375;
    const double c = is_low ? 1.25 : is_high ? 0.8125 : 1.0;
    const double_double minus_log2_c = {
        is_low ? -0.32192809488736235 : is_high ? 0.29956028185890782 : 0.0,
        is_low ? 3.7170199641426819e-19 : is_high ? 2.2038346320583612e-17 : 0.0,
    };
    const double_double g_c = dd_product(x.g.hi, c);
    const double_double f = dd_ordered_sum((c - 1.0) - g_c.hi, fma(-x.g.lo, c, -g_c.lo));
    const double_double s = precise_atanh_argument(f), z = precise_square(s);
    double t = 0.19583201083486035;
    t = fma(t, z.hi, 0.22192442677435692);
    t = fma(t, z.hi, 0.26230831216591377);
    t = fma(t, z.hi, 0.32059889768347322);
    double_double e = precise_step_of_doubles((double_double){0.41219858311150859, 1.7146130676376968e-18}, z.hi, t);
    e = precise_step((double_double){0.57707801635558509, 3.6520429458030238e-17}, z, e);
    e = precise_step((double_double){0.96179669392597555, 5.063500967273306e-17}, z, e);
    e = precise_step((double_double){2.8853900817779268, 4.0710545211953182e-17}, z, e);
    const double_double whole = dd_ordered_sum(x.k, minus_log2_c.hi);
    return precise_step((double_double){whole.hi, whole.lo + minus_log2_c.lo}, s, e);
}

/* (2^(x/8) - 1) / x for |x| <= 1/2
 * d1 + d2 x + ... + d9 x^8, d1 to d3 in two doubles; with it 2^(x/8) errs by 2^-74.8. */
SYMRENDER_INLINE double_double precise_exp2_quotient(double x)
{
    double t = 7.5836211239520907e-16;
    t = fma(t, x, 7.8774135473230433e-14);
    t = fma(t, x, 7.273070233246802e-12);
    t = fma(t, x, 5.8759805203306169e-10);
    t = fma(t, x, 4.0690790241786908e-08);
    t = fma(t, x, 2.3481760516671569e-06);
    double_double e = precise_step_of_doubles((double_double){0.00010840646223597965, -6.2157948330051971e-21}, x, t);
    e = precise_step_by_double((double_double){0.0037535391712359488, -1.4924500099490436e-19}, x, e);
    e = precise_step_by_double((double_double){0.086643397569993161, 2.8988087197002631e-18}, x, e);
    return e;
}

/* 2^r for |r| <= 1/2, r.lo at most 2^-53             error <= 2^-71.1
 * 2^r = (2^(r/8))^8, and 2^(r.lo / 8) is 1 + r.lo ln 2 / 8. */
SYMRENDER_INLINE double_double precise_exp2_of_fraction(double_double r)
{
    const double_double e = precise_step_by_double(dd_from(1.0), r.hi, precise_exp2_quotient(r.hi));
    const double_double power = {e.hi, fma(e.hi, r.lo * 0.086643397569993161, e.lo)};
    const double_double to_the_8th = precise_square(precise_square(precise_square(power)));
    return dd_ordered_sum(to_the_8th.hi, to_the_8th.lo);
}

/* (cos a)^exponent from cos2 = cos^2 a and sin2 = sin^2 a, 0 <= a <= 90 degrees, for 0 <= exponent <= 2^200
 * Error at most 2^-69.6 of the result, PRECISE_POWER_ERROR; 0 below 2^-1000.
 * Where sin2 < 1/2, cos2 is not used: the power is that of 1 - sin2. Far below the range what is scaled is arbitrary:
 * the select discards it. */
SYMRENDER_INLINE double_double precise_power_of_cosine(double_double cos2, double_double sin2, double exponent)
{
    const double_double log2_cos2 = precise_log2_of_parts(precise_split_of_cosine(cos2, sin2));
    const precise_exponent y = precise_exponent_of(log2_cos2, 0.5 * exponent);
    const double_double power = precise_exp2_of_fraction(y.r);
    const double scale = precise_from_bits((precise_bits(y.shifted) << 52) + UINT64_C(0x3ff0000000000000));   /* 2^k */
    const int is_one = !(y.y < 0.0);
    const int is_zero = (y.y < -1000.0) | ((exponent > 0.0) & (sin2.hi >= 0.5) & (cos2.hi <= 0.0));
    const double_double result = {
        is_zero ? 0.0 : is_one ? 1.0 : power.hi * scale,
        is_zero | is_one ? 0.0 : power.lo * scale,
    };
    return result;
}

/* log2 of 2^k (1 - g)                                error <= 2^-100.0 relative to the logarithm
 * 1 - g = (1 + f) / c with c in {5/4, 1, 13/16} and |f| <= 0.149: g c is exact in two doubles, and (c - 1) - g c of its
 * high part too (Sterbenz). With s = f / (2 + f) and z = s^2 < 0.00506
 *     log2(1 + f) = 2 / ln 2 atanh(s) = s (c0 + c1 z + ... + c10 z^10),
 * c0 to c6 in two doubles; the polynomial alone errs by 2^-108.9. */
SYMRENDER_INLINE double_double dd_log2_of_parts(precise_parts x)
{
    const int is_low = x.g.hi > 0.1328125, is_high = x.g.hi < -0.1484375;
    const double c = is_low ? 1.25 : is_high ? 0.8125 : 1.0;
    const double_double minus_log2_c = {
        is_low ? -0.32192809488736235 : is_high ? 0.29956028185890782 : 0.0,
        is_low ? 3.7170199641426819e-19 : is_high ? 2.2038346320583612e-17 : 0.0,
    };
    const double_double g_c = dd_product(x.g.hi, c);
    const double_double f = dd_ordered_sum((c - 1.0) - g_c.hi, fma(-x.g.lo, c, -g_c.lo));
    const double_double s = precise_atanh_argument(f), z = precise_square(s);
    double t = 0.14094218335875056;
    t = fma(t, z.hi, 0.15181985666366585);
    t = fma(t, z.hi, 0.16972911954976191);
    t = fma(t, z.hi, 0.19235933755551296);
    double_double e = precise_step_of_doubles((double_double){0.22195308321702054, -4.3362055118004783e-18}, z.hi, t);
    e = precise_step((double_double){0.26230818925253302, -2.0857110158491065e-17}, z, e);
    e = precise_step((double_double){0.3205988979753252, 4.650622027817719e-18}, z, e);
    e = precise_step((double_double){0.41219858311113239, 1.3741973594453313e-17}, z, e);
    e = precise_step((double_double){0.57707801635558531, 5.2551031773901766e-17}, z, e);
    e = precise_step((double_double){0.96179669392597555, 5.0577616647962341e-17}, z, e);
    e = precise_step((double_double){2.8853900817779268, 4.0710547481862066e-17}, z, e);
    const double_double whole = dd_ordered_sum(x.k, minus_log2_c.hi);
    return precise_step((double_double){whole.hi, whole.lo + minus_log2_c.lo}, s, e);
}

/* (2^(x/8) - 1) / x for |x| <= 1/2
 * d1 + d2 x + ... + d12 x^11, d1 to d7 in two doubles; with it 2^(x/8) errs by 2^-102.1. */
SYMRENDER_INLINE double_double dd_exp2_quotient(double x)
{
    double t = 3.7368391026336936e-22;
    t = fma(t, x, 5.1754744743640618e-20);
    t = fma(t, x, 6.5703984497934169e-18);
    t = fma(t, x, 7.5832650081728709e-16);
    t = fma(t, x, 7.8770439566042641e-14);
    double_double e = precise_step_of_doubles((double_double){7.2730702419567029e-12, -1.3703755056646306e-28}, x, t);
    e = precise_step_by_double((double_double){5.8759805272604404e-10, 4.4890021437213231e-26}, x, e);
    e = precise_step_by_double((double_double){4.0690790241786021e-08, 4.2106036511842382e-25}, x, e);
    e = precise_step_by_double((double_double){2.3481760516671086e-06, 6.9151874179763565e-23}, x, e);
    e = precise_step_by_double((double_double){0.00010840646223597965, -6.1832465754096291e-21}, x, e);
    e = precise_step_by_double((double_double){0.0037535391712359488, -1.4834267583100463e-19}, x, e);
    e = precise_step_by_double((double_double){0.086643397569993161, 2.8988085173075775e-18}, x, e);
    return e;
}

/* 2^r for |r| <= 1/2, r.lo at most 2^-53             error <= 2^-97.6
 * 2^r = (2^(r/8))^8, and 2^(r.lo / 8) is 1 + r.lo ln 2 / 8. */
SYMRENDER_INLINE double_double dd_exp2_of_fraction(double_double r)
{
    const double_double e = precise_step_by_double(dd_from(1.0), r.hi, dd_exp2_quotient(r.hi));
    const double_double power = {e.hi, fma(e.hi, r.lo * 0.086643397569993161, e.lo)};
    const double_double to_the_8th = precise_square(precise_square(precise_square(power)));
    return dd_ordered_sum(to_the_8th.hi, to_the_8th.lo);
}

/* (cos a)^exponent from cos2 = cos^2 a and sin2 = sin^2 a, 0 <= a <= 90 degrees, for 0 <= exponent <= 2^200
 * Error at most 2^-90.1 of the result, DD_POWER_ERROR; 0 below 2^-900.
 * Where sin2 < 1/2, cos2 is not used: the power is that of 1 - sin2. Far below the range what is scaled is arbitrary:
 * the select discards it. */
SYMRENDER_INLINE double_double dd_power_of_cosine(double_double cos2, double_double sin2, double exponent)
{
    const double_double log2_cos2 = dd_log2_of_parts(precise_split_of_cosine(cos2, sin2));
    const precise_exponent y = precise_exponent_of(log2_cos2, 0.5 * exponent);
    const double_double power = dd_exp2_of_fraction(y.r);
    const double scale = precise_from_bits((precise_bits(y.shifted) << 52) + UINT64_C(0x3ff0000000000000));   /* 2^k */
    const int is_one = !(y.y < 0.0);
    const int is_zero = (y.y < -900.0) | ((exponent > 0.0) & (sin2.hi >= 0.5) & (cos2.hi <= 0.0));
    const double_double result = {
        is_zero ? 0.0 : is_one ? 1.0 : power.hi * scale,
        is_zero | is_one ? 0.0 : power.lo * scale,
    };
    return result;
}

#endif
