/* Double-double arithmetic: a number is the unevaluated sum hi + lo of two doubles with hi = RN(hi + lo).
 *
 * RN is rounding to nearest even, u = 2^-53 the unit roundoff. Every bound is on the relative error of one operation,
 * for operands that are themselves normalised and as long as nothing overflows and no low part falls below 2^-1074
 * (magnitudes between 2^-960 and 2^1020 are always safe; a factor of a product may come from 2^-480 to 2^510).
 * Where no bound is stated the operation is exact.
 *
 * fma stands where its single rounding is what the algorithm needs; the text is meant for -ffp-contract=off, and never
 * for -ffast-math, which would cancel the error terms to 0. Nothing branches, so loops over these functions vectorise.
 *
 * Sources
 *   TwoSum      Moller 1965, Knuth 1969        Fast2Sum   Dekker 1971
 *   operations  Joldes, Muller, Popescu, "Tight and rigorous error bounds for basic building blocks of double-word
 *               arithmetic", ACM TOMS 44(2), 2017; the bound of the product as sharpened by Muller, Rideau,
 *               "Formalization of double-word arithmetic, and comments on [the above]", ACM TOMS 48(1), 2022
 *   root        Lefevre, Louvet, Muller, Picot, Rideau, "Accurate calculation of Euclidean norms using double-word
 *               arithmetic", ACM TOMS 49(1), 2023
 */
#ifndef SYMRENDER_DOUBLE_DOUBLE_H
#define SYMRENDER_DOUBLE_DOUBLE_H

#include <math.h>

typedef struct {
    double hi, lo;
} double_double;

/* hi + lo = a + b exactly, if |a| >= |b| or a = 0.  Fast2Sum */
static inline double_double dd_ordered_sum(double a, double b)
{
    const double hi = a + b;
    const double_double sum = {hi, b - (hi - a)};
    return sum;
}

/* The number a itself. */
static inline double_double dd_from(double a)
{
    const double_double same = {a, 0.0};
    return same;
}

/* hi + lo = a + b exactly.  TwoSum */
static inline double_double dd_sum(double a, double b)
{
    const double hi = a + b;
    const double b_seen = hi - a;
    const double a_seen = hi - b_seen;
    const double_double sum = {hi, (a - a_seen) + (b - b_seen)};
    return sum;
}

/* hi + lo = a - b exactly. */
static inline double_double dd_difference(double a, double b)
{
    return dd_sum(a, -b);
}

/* hi + lo = a b exactly.  TwoProd */
static inline double_double dd_product(double a, double b)
{
    const double hi = a * b;
    const double_double product = {hi, fma(a, b, -hi)};
    return product;
}

/* -x */
static inline double_double dd_neg(double_double x)
{
    const double_double negative = {-x.hi, -x.lo};
    return negative;
}

/* x times a power of two (of either sign), which the caller vouches for. */
static inline double_double dd_scale(double_double x, double power_of_two)
{
    const double_double scaled = {x.hi * power_of_two, x.lo * power_of_two};
    return scaled;
}

/* x 2^k */
static inline double_double dd_ldexp(double_double x, int k)
{
    const double_double scaled = {ldexp(x.hi, k), ldexp(x.lo, k)};
    return scaled;
}

/* The double nearest to x: hi alone, because hi = RN(hi + lo). */
static inline double dd_to_double(double_double x)
{
    return x.hi;
}

/* 1 if x < 0, else 0. The sign of a normalised number is the sign of its high part. */
static inline int dd_is_negative(double_double x)
{
    return x.hi < 0.0;
}

/* max(0, x) */
static inline double_double dd_positive_part(double_double x)
{
    const double_double part = {x.hi > 0.0 ? x.hi : 0.0, x.hi > 0.0 ? x.lo : 0.0};
    return part;
}

/* x + y                                              error <= 2 u^2                  Joldes et al., DWPlusFP */
static inline double_double dd_add_double(double_double x, double y)
{
    const double_double s = dd_sum(x.hi, y);
    return dd_ordered_sum(s.hi, x.lo + s.lo);
}

/* x + y                                              error <= 3 u^2 / (1 - 4 u)      Joldes et al., AccurateDWPlusDW
 * The bound holds for operands of opposite sign too: cancellation costs nothing. */
static inline double_double dd_add(double_double x, double_double y)
{
    const double_double s = dd_sum(x.hi, y.hi);
    const double_double t = dd_sum(x.lo, y.lo);
    const double_double v = dd_ordered_sum(s.hi, s.lo + t.hi);
    return dd_ordered_sum(v.hi, t.lo + v.lo);
}

/* x - y                                              error <= 3 u^2 / (1 - 4 u), as for the sum */
static inline double_double dd_sub(double_double x, double_double y)
{
    return dd_add(x, dd_neg(y));
}

/* x y                                                error <= 2 u^2                  Joldes et al., DWTimesFP3 */
static inline double_double dd_mul_double(double_double x, double y)
{
    const double_double c = dd_product(x.hi, y);
    return dd_ordered_sum(c.hi, fma(x.lo, y, c.lo));
}

/* x y                                                error <= 4 u^2                  Joldes et al., DWTimesDW3 */
static inline double_double dd_mul(double_double x, double_double y)
{
    const double_double c = dd_product(x.hi, y.hi);
    const double cross = fma(x.lo, y.hi, fma(x.hi, y.lo, x.lo * y.lo));
    return dd_ordered_sum(c.hi, c.lo + cross);
}

/* x / y, y not 0                                     error <= 15 u^2 + 56 u^3        Joldes et al., DWDivDW2
 * One Newton step on the quotient of the high parts: q + (x - q y) / y.hi, where x.hi - (q y).hi is exact. The product
 * q y is DWTimesFP1 of the same paper (error <= 3/2 u^2 + 4 u^3), which the bound rests on. */
static inline double_double dd_div(double_double x, double_double y)
{
    const double q = x.hi / y.hi;
    const double_double c = dd_product(y.hi, q);
    const double_double t = dd_ordered_sum(c.hi, y.lo * q);
    const double_double q_y = dd_ordered_sum(t.hi, t.lo + c.lo);
    const double remainder = (x.hi - q_y.hi) + (x.lo - q_y.lo);
    return dd_ordered_sum(q, remainder / y.hi);
}

/* sqrt(x), x >= 0                                    error <= 25/8 u^2               Lefevre et al., SQRTDWtoDW
 * One Newton step on r = sqrt(x.hi): r + (x - r^2) / (2 r). The square root of 0 is 0: its remainder 0 is divided by 1.
 * Tiny x stays safe and loses accuracy gracefully: below 2^-960 the remainder may round to a multiple of 2^-1074, which
 * adds at most min(2 u, 2^-1075 / x). */
static inline double_double dd_sqrt(double_double x)
{
    const double r = sqrt(x.hi);
    const double remainder = fma(-r, r, x.hi) + x.lo;
    const double divisor = r > 0.0 ? 2.0 * r : 1.0;
    return dd_ordered_sum(r, remainder / divisor);
}

#endif
