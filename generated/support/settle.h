/* Settling: a value that is known up to a bound is settled where both ends of the bound round alike. */
#ifndef SYMRENDER_SETTLE_H
#define SYMRENDER_SETTLE_H

#include "double_double.h"

/* floor(255 v + 1/2) for v cut to [0, 1], without rounding, and how far 255 v is from where that jumps: 255 v = p + e
 * exactly (fma), p - floor(p) - 1/2 is exact, and so is the sign of a sum of two numbers. */
typedef struct {
    double level, distance;   /* distance: rounded, off by less than 2^-45 */
} grey;

static inline grey grey_level(double v)
{
    const double cut = v > 0.0 ? (v < 1.0 ? v : 1.0) : 0.0;
    const double p = 255.0 * cut, e = fma(255.0, cut, -p);
    const double whole = floor(p), beyond = (p - whole) - 0.5;
    const grey found = {beyond + e >= 0.0 ? whole + 1.0 : whole, fabs(beyond)};
    return found;
}

/* Whether every number within `error` of hi + lo rounds to hi, which is the float64 nearest to hi + lo (Ziv 1991). */
static inline int rounds_to_high(double_double v, double error)
{
    const double room = error * (1.0 + 0x1p-40) + 0x1p-52 * fabs(v.lo);
    return (v.hi + (v.lo + (error > 0.0 ? room : 0.0)) == v.hi) & (v.hi + (v.lo - (error > 0.0 ? room : 0.0)) == v.hi);
}

/* Whether hi, the float64 nearest to hi + lo, is within 4 ulp of every number within `error` of hi + lo: within 3/2 of
 * |hi| 2^-52, for |hi| 2^-53 <= ulp(hi). */
static inline int is_within_four_ulp(double_double v, double error)
{
    return error <= 0x1p-52 * fabs(v.hi);
}

#endif
