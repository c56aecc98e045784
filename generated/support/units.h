/* Units of length that are powers of two: changing to them is exact, and in them no square overflows. */
#ifndef SYMRENDER_UNITS_H
#define SYMRENDER_UNITS_H

#include <math.h>

/* The k for which length 2^k lies in [1, 2); length > 0. */
static inline int unit_exponent(double length)
{
    return -ilogb(length);
}

/* The factor that brings a point (x, y) of the image plane into the kernel's unit. Only its ray's direction counts:
 * a point farther than `farthest` units is brought to about that distance; its ray turns by less than 1 / farthest. */
static inline double point_unit(double unit, double x, double y, double farthest)
{
    const double across = fabs(x), up = fabs(y);
    const double nearer = farthest / (across > up ? across : up);
    return nearer < unit ? nearer : unit;
}

/* The k by which a light at (x, y, z) from the centre is scaled: the scene's own, unless the light is then still
 * farther than 2^farthest radii. Such a light shines in parallel to the last bit and is brought to about that
 * distance. */
static inline int light_exponent(int scene, double radius, double x, double y, double z, int farthest)
{
    const double longest = fmax(fmax(fabs(x), fabs(y)), fmax(fabs(z), radius));
    const int nearer = farthest - ilogb(longest);
    return nearer < scene ? nearer : scene;
}

#endif
