/* Pairs: double-doubles that nobody renormalises. A pair is the unevaluated sum hi + lo where lo collects what the
 * operations on hi rounded away, to first order. A pair costs half of a double-double and vectorises as well.
 *
 * hi is computed as plain float64 would; each lo is that operation's exact rounding error, plus the operands' lo
 * carried along, in float64. What is lost is of second order: with u = 2^-53 and L a bound on |lo| of an operand,
 * each comment states a bound of the loss. range.h counts it, once a frame, so that a kernel knows how good its pairs
 * are.
 * Nothing is assumed of the operands but that |lo| is small beside the largest |hi| that led to it; after a
 * cancellation lo may be larger than hi, and the pair is still right. Underflow aside, as in double_double.h.
 *
 * Source   Lange, Rump, "Faithfully rounded floating-point computations", ACM TOMS 46(3), 2020 (pair arithmetic)
 */
#ifndef SYMRENDER_PAIR_H
#define SYMRENDER_PAIR_H

#include "double_double.h"
#include "inline.h"

/* a + b        hi + e = a.hi + b.hi exactly (TwoSum)              loss <= u (2 L_a + 2 L_b + u |a + b|) */
SYMRENDER_INLINE double_double pair_add(double_double a, double_double b)
{
    const double_double s = dd_sum(a.hi, b.hi);
    const double_double sum = {s.hi, (a.lo + b.lo) + s.lo};
    return sum;
}

/* a + b                                                           loss <= u (L_a + u |a + b|) */
SYMRENDER_INLINE double_double pair_add_double(double_double a, double b)
{
    const double_double s = dd_sum(a.hi, b);
    const double_double sum = {s.hi, a.lo + s.lo};
    return sum;
}

/* a - b, as a sum */
SYMRENDER_INLINE double_double pair_sub(double_double a, double_double b)
{
    return pair_add(a, dd_neg(b));
}

/* a b          hi + e = a.hi b.hi exactly (TwoProd); lo = a.hi b.lo + a.lo b.hi + e
 *                                                  loss <= L_a L_b + u (2 |a| L_b + 3 |b| L_a + 3 u |a b|) */
SYMRENDER_INLINE double_double pair_mul(double_double a, double_double b)
{
    const double_double p = dd_product(a.hi, b.hi);
    const double_double product = {p.hi, fma(a.hi, b.lo, fma(a.lo, b.hi, p.lo))};
    return product;
}

/* a b                                                             loss <= u (|b| L_a + u |a b|) */
SYMRENDER_INLINE double_double pair_mul_double(double_double a, double b)
{
    const double_double p = dd_product(a.hi, b);
    const double_double product = {p.hi, fma(a.lo, b, p.lo)};
    return product;
}

/* a^2          lo = 2 a.hi a.lo + e                               loss <= L_a^2 + u (2 |a| L_a + u a^2) */
SYMRENDER_INLINE double_double pair_square(double_double a)
{
    const double_double p = dd_product(a.hi, a.hi);
    const double_double square = {p.hi, fma(2.0 * a.hi, a.lo, p.lo)};
    return square;
}

/* 1 / a        q = RN(1 / a.hi), 1 - q a.hi exactly (fma); 1 / a = q + (1 - q a.hi - q a.lo) / a
 *                                                  loss <= (L_a / |a| + 5 u) (L_a / |a| + u) / |a| */
SYMRENDER_INLINE double_double pair_inverse(double_double a)
{
    const double q = 1.0 / a.hi;
    const double_double inverse = {q, (fma(-q, a.hi, 1.0) - q * a.lo) * q};
    return inverse;
}

/* a / b        q = RN(a.hi / b.hi), a.hi - q b.hi exactly; a / b = q + (a.hi - q b.hi + a.lo - q b.lo) / b */
SYMRENDER_INLINE double_double pair_div(double_double a, double_double b)
{
    const double q = a.hi / b.hi;
    const double_double quotient = {q, (fma(-q, b.hi, a.hi) + (a.lo - q * b.lo)) / b.hi};
    return quotient;
}

/* sqrt(a)      r = RN(sqrt(a.hi)), a.hi - r^2 exactly (fma); sqrt(a) = r + (a - r^2) / (r + sqrt(a))
 *                                                  loss <= (L_a / a + 5 u) (L_a / a + u) sqrt(a); 0 for a.hi = 0 */
SYMRENDER_INLINE double_double pair_sqrt(double_double a)
{
    const double r = sqrt(a.hi);
    const double divisor = r > 0.0 ? 2.0 * r : 1.0;
    const double_double root = {r, r > 0.0 ? (fma(-r, r, a.hi) + a.lo) / divisor : 0.0};
    return root;
}

/* max(0, a)    by the sign of hi + lo */
SYMRENDER_INLINE double_double pair_positive_part(double_double a)
{
    const int is_positive = a.hi + a.lo > 0.0;
    const double_double part = {is_positive ? a.hi : 0.0, is_positive ? a.lo : 0.0};
    return part;
}

/* The same number with hi = RN(hi + lo), exactly (TwoSum) */
SYMRENDER_INLINE double_double pair_normalised(double_double a)
{
    return dd_sum(a.hi, a.lo);
}

/* condition ? a : b, word by word: selects, where a condition on structures would be a jump */
SYMRENDER_INLINE double_double pair_select(int condition, double_double a, double_double b)
{
    const double_double chosen = {condition ? a.hi : b.hi, condition ? a.lo : b.lo};
    return chosen;
}

#endif
