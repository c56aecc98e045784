/* Even whole powers of a cosine from its square, a block at a time: the squares go into squares, and no logarithm is
 * taken. An error of cos^2 grows in proportion to the power; range.h counts that, step by step.
 */
#ifndef SYMRENDER_WHOLE_POWER_H
#define SYMRENDER_WHOLE_POWER_H

#include "inline.h"
#include "pair.h"

/* square[]^h for a whole h >= 1, by squaring; what is in `square` is used up. */
SYMRENDER_INLINE void whole_powers_of_square(double *restrict square, double *restrict power, int h, int count)
{
    for (; h % 4 == 0; h /= 4)
        for (int i = 0; i < count; ++i) {
            const double doubled = square[i] * square[i];
            square[i] = doubled * doubled;
        }
    if (h % 2 == 0) {
        h /= 2;
        for (int i = 0; i < count; ++i)
            square[i] = square[i] * square[i];
    }
    for (int i = 0; i < count; ++i)
        power[i] = square[i];
    while ((h /= 2) > 0) {
        for (int i = 0; i < count; ++i)
            square[i] = square[i] * square[i];
        if (h % 2 == 1)
            for (int i = 0; i < count; ++i)
                power[i] = power[i] * square[i];
    }
}

/* The same in pairs, each array with that of its low words. */
SYMRENDER_INLINE void whole_powers_of_pair(double *restrict square, double *restrict square_lo,
    double *restrict power, double *restrict power_lo, int h, int count)
{
    for (; h % 4 == 0; h /= 4)
        for (int i = 0; i < count; ++i) {
            const double_double s = {square[i], square_lo[i]};
            const double_double next = pair_square(pair_square(s));
            square[i] = next.hi;
            square_lo[i] = next.lo;
        }
    if (h % 2 == 0) {
        h /= 2;
        for (int i = 0; i < count; ++i) {
            const double_double s = {square[i], square_lo[i]};
            const double_double next = pair_square(s);
            square[i] = next.hi;
            square_lo[i] = next.lo;
        }
    }
    for (int i = 0; i < count; ++i) {
        power[i] = square[i];
        power_lo[i] = square_lo[i];
    }
    while ((h /= 2) > 0) {
        for (int i = 0; i < count; ++i) {
            const double_double s = {square[i], square_lo[i]};
            const double_double next = pair_square(s);
            square[i] = next.hi;
            square_lo[i] = next.lo;
        }
        if (h % 2 == 1)
            for (int i = 0; i < count; ++i) {
                const double_double p = {power[i], power_lo[i]}, s = {square[i], square_lo[i]};
                const double_double more = pair_mul(p, s);
                power[i] = more.hi;
                power_lo[i] = more.lo;
            }
    }
}

#endif
