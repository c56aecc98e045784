/* Balls: a real number known to lie within `error` of a double-double centre, |true - (hi + lo)| <= error.
 *
 * Every operation encloses its result for all numbers that its operands enclose: the operands' radii are carried along
 * by the inequality in its comment, and the rounding of the centre, by the bound that double_double.h proves for it, is
 * added. What a ball cannot decide is told as BALL_UNKNOWN, and a choice made on it gives the hull of both outcomes.
 *
 * u = 2^-53. The centre is normalised, hi = RN(hi + lo), so that |hi + lo| <= (1 + u) |hi|.
 * A radius is computed in rounding to nearest: at most 8 operations, all of terms that are not negative, so that it is
 * less than 2^-49 of itself too small; the factor BALL_WIDER = 1 + 2^-40 makes up for that, and for the (1 + u) above.
 * Products and quotients of tiny numbers lose bits below 2^-1074; each adds BALL_FLOOR = 2^-1000, which is more.
 * What overflows has an infinite or a NaN radius: it says nothing, decides nothing, and stays so to the end.
 */
#ifndef SYMRENDER_BALL_H
#define SYMRENDER_BALL_H

#include "double_double.h"
#include "inline.h"

#define BALL_WIDER (1.0 + 0x1p-40)
#define BALL_FLOOR 0x1p-1000

typedef struct {
    double hi, lo, error;
} ball;

typedef enum { BALL_NO, BALL_YES, BALL_UNKNOWN } ball_truth;

/* ---- to and from numbers ---- */

SYMRENDER_INLINE ball ball_of(double_double centre, double error)
{
    const ball x = {centre.hi, centre.lo, error};
    return x;
}

SYMRENDER_INLINE double_double ball_centre(ball x)
{
    const double_double centre = {x.hi, x.lo};
    return centre;
}

/* The number a itself. */
SYMRENDER_INLINE ball ball_from(double a)
{
    const ball x = {a, 0.0, 0.0};
    return x;
}

/* Any number at all. */
SYMRENDER_INLINE ball ball_unknown(void)
{
    const ball x = {0.0, 0.0, (double)INFINITY};
    return x;
}

/* a 2^k, where bits may be lost below 2^-1074 only */
SYMRENDER_INLINE ball ball_ldexp(double a, int k)
{
    const double scaled = ldexp(a, k);
    const ball x = {scaled, 0.0, a != 0.0 && fabs(scaled) < 0x1p-1000 ? BALL_FLOOR : 0.0};
    return x;
}

/* x 2^k: the low part and the radius may lose bits below 2^-1074 */
SYMRENDER_INLINE ball ball_scaled(ball x, int k)
{
    const ball scaled = {ldexp(x.hi, k), ldexp(x.lo, k), (ldexp(x.error, k) + BALL_FLOOR) * BALL_WIDER};
    return scaled;
}

/* At most, and at least, the true number. */
SYMRENDER_INLINE double ball_lower(ball x)
{
    return x.hi - (x.error + fabs(x.hi) * 0x1p-50) * BALL_WIDER;
}

SYMRENDER_INLINE double ball_upper(ball x)
{
    return x.hi + (x.error + fabs(x.hi) * 0x1p-50) * BALL_WIDER;
}

/* ---- sums: without loss below 2^-1074, where every number is a multiple of it ---- */

/* a + b = hi + lo exactly; the radius is NaN where that overflows */
SYMRENDER_INLINE ball ball_sum(double a, double b)
{
    const double_double z = dd_sum(a, b);
    return ball_of(z, 0.0 * z.hi);
}

/* a - b = hi + lo exactly */
SYMRENDER_INLINE ball ball_difference(double a, double b)
{
    return ball_sum(a, -b);
}

/* -x */
SYMRENDER_INLINE ball ball_neg(ball x)
{
    const ball negative = {-x.hi, -x.lo, x.error};
    return negative;
}

/* |(x' + y') - (x + y)| <= r_x + r_y;  rounding 3 u^2 (|x| + |y|) + ... < 4 u^2 (|x.hi| + |y.hi|)
 * With s + t = x.hi + y.hi exactly, |t| <= u |s|, the low parts l = RN(x.lo + y.lo) and m = RN(t + l) are rounded by at
 * most u^2 (|x.hi| + |y.hi|) and u (|t| + |l|) <= (2 u^2 + O(u^3)) (|x.hi| + |y.hi|); s + m is then exact. */
SYMRENDER_INLINE ball ball_add(ball x, ball y)
{
    const double_double s = dd_sum(x.hi, y.hi);
    const double low = s.lo + (x.lo + y.lo);
    const double size = fabs(x.hi) + fabs(y.hi);
    return ball_of(dd_sum(s.hi, low), fma(size, 0x1p-104, x.error + y.error) * BALL_WIDER);
}

/* x - y, as the sum */
SYMRENDER_INLINE ball ball_sub(ball x, ball y)
{
    return ball_add(x, ball_neg(y));
}

/* |(x' + a) - (x + a)| <= r_x;  rounding 2 u^2 |x + a| */
SYMRENDER_INLINE ball ball_add_double(ball x, double a)
{
    const double_double z = dd_add_double(ball_centre(x), a);
    return ball_of(z, fma(fabs(z.hi), 0x1p-105, x.error) * BALL_WIDER);
}

/* ---- products ---- */

/* a b = hi + lo exactly, but for what is lost below 2^-1074; the radius is NaN where it overflows */
SYMRENDER_INLINE ball ball_product(double a, double b)
{
    const double_double z = dd_product(a, b);
    return ball_of(z, fma(z.hi, 0.0, BALL_FLOOR));
}

/* |x' a - x a| <= r_x |a|;  rounding 2 u^2 |x a| */
SYMRENDER_INLINE ball ball_mul_double(ball x, double a)
{
    const double_double z = dd_mul_double(ball_centre(x), a);
    return ball_of(z, fma(x.error, fabs(a), fma(fabs(z.hi), 0x1p-104, BALL_FLOOR)) * BALL_WIDER);
}

/* |x' y' - x y| <= |x| r_y + (|y| + r_y) r_x;  rounding 4 u^2 |x y| */
SYMRENDER_INLINE ball ball_mul(ball x, ball y)
{
    const double_double z = dd_mul(ball_centre(x), ball_centre(y));
    const double rounding = fma(fabs(z.hi), 0x1p-103, BALL_FLOOR);
    const double error = fma(fabs(x.hi), y.error, fma(fabs(y.hi) + y.error, x.error, rounding));
    return ball_of(z, error * BALL_WIDER);
}

/* |x'^2 - x^2| <= (2 |x| + r_x) r_x;  rounding 4 u^2 x^2 */
SYMRENDER_INLINE ball ball_square(ball x)
{
    const double_double z = dd_mul(ball_centre(x), ball_centre(x));
    const double rounding = fma(fabs(z.hi), 0x1p-103, BALL_FLOOR);
    return ball_of(z, fma(2.0 * fabs(x.hi) + x.error, x.error, rounding) * BALL_WIDER);
}

/* |x' / y' - x / y| <= (r_x + |x / y| r_y) / (|y| - r_y), infinite where y' may be 0;  rounding (15 u^2 + ...) |x / y|,
 * and bits below 2^-1074 lost in the remainder x - q y, which is divided by y */
SYMRENDER_INLINE ball ball_div(ball x, ball y)
{
    const double least = (fabs(y.hi) - y.error * BALL_WIDER) * (1.0 - 0x1p-40);
    const double_double z = dd_div(ball_centre(x), ball_centre(y));
    const double error = fma(fabs(z.hi), y.error, x.error + BALL_FLOOR) / least;
    const double rounding = fma(fabs(z.hi), 0x1p-101, BALL_FLOOR);
    return ball_of(z, least > 0.0 ? (error + rounding) * BALL_WIDER : (double)INFINITY);
}

/* ---- roots: of a number that is not negative, whatever its ball reaches to ---- */

/* With t = r_x / x <= 1:  |sqrt(x') - sqrt(x)| <= sqrt(x) t / (1 + sqrt(1 - t)) <= sqrt(x) (t + t^2) / 2;
 * rounding 25/8 u^2 sqrt(x), and below 2^-900, where low parts lose bits, 2 u sqrt(x) < 2^-502.
 * Where t > 1, 0 <= sqrt(x') <= sqrt(x + r_x): the ball about half of it. */
SYMRENDER_INLINE ball ball_sqrt(ball x)
{
    const double most = ball_upper(x);
    if (x.hi > x.error) {
        const double_double z = dd_sqrt(ball_centre(x));
        const double t = x.error / x.hi, rounding = x.hi < 0x1p-900 ? 0x1p-500 : z.hi * 0x1p-103;
        return ball_of(z, fma(0.5 * z.hi, t + t * t, rounding) * BALL_WIDER);
    }
    const double half = most > 0.0 ? 0.5 * BALL_WIDER * sqrt(most) : most <= 0.0 ? 0.0 : most;
    return ball_of(dd_from(half), half);
}

/* ---- decisions ---- */

/* true > 0?  |true - x.hi| <= u |x.hi| + r_x, so that (1 - 2^-40) |x.hi| > r_x settles the sign. Strictly: an infinite
 * centre has an infinite radius. */
SYMRENDER_INLINE ball_truth ball_positive(ball x)
{
    const double sure = x.hi * (1.0 - 0x1p-40);
    return sure > x.error ? BALL_YES
        : (sure < -x.error || (x.hi == 0.0 && x.error == 0.0)) ? BALL_NO : BALL_UNKNOWN;
}

/* true >= 0? */
SYMRENDER_INLINE ball_truth ball_not_negative(ball x)
{
    const double sure = x.hi * (1.0 - 0x1p-40);
    return (sure > x.error || (x.hi == 0.0 && x.error == 0.0)) ? BALL_YES
        : sure < -x.error ? BALL_NO : BALL_UNKNOWN;
}

/* true = 0? */
SYMRENDER_INLINE ball_truth ball_zero(ball x)
{
    return (x.hi == 0.0 && x.error == 0.0) ? BALL_YES
        : fabs(x.hi) * (1.0 - 0x1p-40) > x.error ? BALL_NO : BALL_UNKNOWN;
}

/* x < y? */
SYMRENDER_INLINE ball_truth ball_less(ball x, ball y)
{
    return ball_positive(ball_sub(y, x));
}

SYMRENDER_INLINE ball_truth ball_both(ball_truth a, ball_truth b)
{
    return a == BALL_NO || b == BALL_NO ? BALL_NO : a == BALL_YES && b == BALL_YES ? BALL_YES : BALL_UNKNOWN;
}

SYMRENDER_INLINE ball_truth ball_either(ball_truth a, ball_truth b)
{
    return a == BALL_YES || b == BALL_YES ? BALL_YES : a == BALL_NO && b == BALL_NO ? BALL_NO : BALL_UNKNOWN;
}

/* What encloses all that x and y enclose: c half way between the centres, |x' - c| <= |x.hi - c| + |x.lo| + r_x.
 * 0 to_x is 0, or NaN: a comparison would forget it. */
SYMRENDER_INLINE ball ball_hull(ball x, ball y)
{
    const double c = 0.5 * x.hi + 0.5 * y.hi;
    const double to_x = fabs(x.hi - c) + fabs(x.lo) + x.error, to_y = fabs(y.hi - c) + fabs(y.lo) + y.error;
    return ball_of(dd_from(c), ((to_x > to_y ? to_x : to_y) + 0.0 * to_x) * BALL_WIDER);
}

/* condition ? x : y */
SYMRENDER_INLINE ball ball_select(ball_truth condition, ball x, ball y)
{
    return condition == BALL_YES ? x : condition == BALL_NO ? y : ball_hull(x, y);
}

/* max(0, x), which is no farther from max(0, x.hi + x.lo) than x from its centre */
SYMRENDER_INLINE ball ball_positive_part(ball x)
{
    if (x.hi * (1.0 - 0x1p-40) < -x.error)
        return ball_from(0.0);
    return x.hi > 0.0 ? x : ball_of(dd_from(0.0), x.error);
}

/* floor(x) where the ball tells it, else NaN. For |x| < 2^52 the differences to whole numbers are exact in the high
 * part, and their sum with the low part is rounded by 2 u of itself. */
static inline double ball_floor(ball x)
{
    double whole = floor(x.hi);
    whole -= x.hi == whole && x.lo < 0.0 ? 1.0 : 0.0;
    const double below = (x.hi - whole) + x.lo, above = (whole + 1.0 - x.hi) - x.lo;
    const double beyond = x.error * BALL_WIDER;
    return fabs(x.hi) < 0x1p51 && below >= beyond && above > beyond ? whole : (double)NAN;
}

#endif
