/* The power that a Phong highlight takes, of balls. */
#ifndef SYMRENDER_BALL_POWER_H
#define SYMRENDER_BALL_POWER_H

#include "ball.h"
#include "precise_power.h"

/* c^p, p = exponent / 2 >= 0, for numbers 0 <= c, s <= 1 with c + s = 1 that lie in the balls cos2 and sin2
 *
 * At the centres the power is taken of c, or of 1 - s where sin2.hi < 1/2. With x the one that is taken, r its radius
 * and x' the true one, |ln x' - ln x| <= r / (x - r), and so for t = p r / (x - r) <= 1/4
 *     |x'^p - x^p| <= x^p (e^t - 1) <= x^p (t + t^2)
 * To that comes the error of dd_power_of_cosine: |computed - x^p| <= DD_POWER_ERROR x^p + 2^-900.
 * Elsewhere x' is at most x + r, and the ball is all from 0 to (x + r)^p or to 1. */
static inline ball ball_power_of_cosine(ball cos2, ball sin2, double exponent)
{
    const int is_near = sin2.hi < 0.5;
    const double x = is_near ? 1.0 - sin2.hi : cos2.hi, r = is_near ? sin2.error : cos2.error;
    const double t = 0.5 * exponent * (r / (x * (1.0 - 0x1p-40) - r * BALL_WIDER)) * BALL_WIDER;
    if (!(exponent <= 0x1p200))
        return ball_of(dd_from(0.5), 0.5);
    if (t >= 0.0 && t <= 0.25) {
        const double_double z = dd_power_of_cosine(ball_centre(cos2), ball_centre(sin2), exponent);
        return ball_of(z, fma(z.hi, (t + t * t) + DD_POWER_ERROR, 0x1p-898) * BALL_WIDER);
    }
    const double most = is_near ? 1.0 - ball_lower(sin2) * (1.0 - 0x1p-40) + 0x1p-40 : ball_upper(cos2);
    if (!(most < 1.0))   /* also where nothing is known: c^p is in [0, 1] all the same */
        return ball_of(dd_from(0.5), 0.5);
    const double_double base = dd_from(most), rest = dd_difference(1.0, most);
    const double half = 0.5 * BALL_WIDER * (dd_power_of_cosine(base, rest, exponent).hi + 0x1p-898);
    return ball_of(dd_from(half), half);
}

#endif
