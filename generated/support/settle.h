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

/* ---- one number by any rule ---- */

typedef enum { FOUR_ULP, NEAREST_FLOAT64, NEAREST_FLOAT32, GREY_LEVEL } settling_rule;

/* What is written, as the double that it is: each float32 and each level is one. */
typedef struct {
    double value;
    int is_settled;
} settled_value;

/* Both ends of the enclosure, moved outwards by more than double rounds here, round to one float32. */
static inline settled_value float_by_ends(double_double v, double error)
{
    const int is_exact = (error == 0.0) & (v.lo == 0.0);
    const double room = is_exact ? 0.0 : error + fabs(v.lo) + 0x1p-50 * fabs(v.hi);
    const float low = (float)(v.hi - room), high = (float)(v.hi + room);
    const settled_value found = {(double)high, low == high};   /* of -0 and 0 the latter */
    return found;
}

/* floor(255 v + 1/2), where 255 v is farther from a jump than the enclosure is wide: `grey_level` of hi, to whose
 * distance lo and what rounds are added. */
static inline settled_value grey_by_distance(double_double v, double error)
{
    const double reach = fabs(v.lo) + error;
    const int is_above = v.hi - reach >= 1.0, is_below = v.hi + reach <= 0.0;
    const double p = 255.0 * v.hi, e = fma(255.0, v.hi, -p), tail = 255.0 * v.lo;
    const double whole = floor(p), beyond = ((p - whole) - 0.5) + (e + tail);
    const double level = beyond >= 0.0 ? whole + 1.0 : whole;
    const double room = 255.0 * error * (1.0 + 0x1p-40) + 0x1p-50 * (fabs(e) + fabs(tail));
    const int is_far = ((error == 0.0) & (v.lo == 0.0)) | (fabs(beyond) > room);
    const settled_value found = {
        is_above ? 255.0 : (is_below ? 0.0 : fmin(fmax(level, 0.0), 255.0)),
        is_above | is_below | is_far,
    };
    return found;
}

/* What |true - (hi + lo)| <= error settles, hi being the float64 nearest to hi + lo. */
static inline settled_value settled_by(settling_rule rule, double_double v, double error)
{
    settled_value found = {v.hi, 0};
    switch (rule) {
    case FOUR_ULP:
        found.is_settled = is_within_four_ulp(v, error);
        break;
    case NEAREST_FLOAT64:
        found.is_settled = rounds_to_high(v, error);
        break;
    case NEAREST_FLOAT32:
        found = float_by_ends(v, error);
        break;
    case GREY_LEVEL:
        found = grey_by_distance(v, error);
        break;
    }
    return found;
}

#endif
