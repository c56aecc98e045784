/* a^2 for an operand that has no name of its own. */
#ifndef SYMRENDER_SQUARE_H
#define SYMRENDER_SQUARE_H

static inline double square(double a)
{
    return a * a;
}

static inline float squaref(float a)
{
    return a * a;
}

#endif
