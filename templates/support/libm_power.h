/* Powers by the C library's own pow: what the powers of power.h are compared with. One call a pixel: no loop that
 * holds it is vectorised, and how accurate it is differs from system to system.
 */
#ifndef SYMRENDER_LIBM_POWER_H
#define SYMRENDER_LIBM_POWER_H

#include <math.h>

/* (cos a)^exponent from cos2 = cos^2 a, as cos2^(exponent / 2); sin2 = sin^2 a is not needed. */
static inline double libm_power_of_cosine(double cos2, double sin2, double exponent)
{
    (void)sin2;
    return pow(cos2, 0.5 * exponent);
}

/* base^exponent for any base >= 0. */
static inline double libm_power(double base, double exponent)
{
    return pow(base, exponent);
}

/* (cos a)^exponent in float. */
static inline float libm_power_of_cosinef(float cos2, float sin2, float exponent)
{
    (void)sin2;
    return powf(cos2, 0.5f * exponent);
}

/* base^exponent for any base >= 0, in float. */
static inline float libm_powerf(float base, float exponent)
{
    return powf(base, exponent);
}

#endif
