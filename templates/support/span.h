/* The pixels of a row whose centres lie between two points. */
#ifndef SYMRENDER_SPAN_H
#define SYMRENDER_SPAN_H

#include <math.h>

typedef struct {
    int first, last;   /* last < first: none */
} pixel_span;

/* index, brought into [-1, width]; a NaN becomes -1 */
static inline int span_index(double index, int width)
{
    return index < (double)width ? (index > -1.0 ? (int)index : -1) : width;
}

/* Pixels 0 <= i < width with left <= i <= right. The ends are floating point: what lies within rounding of one of them
 * is for an exact test to settle. */
static inline pixel_span span_between(double left, double right, int width)
{
    pixel_span span = {span_index(ceil(left), width), span_index(floor(right), width)};
    if (span.first < 0)
        span.first = 0;
    if (span.last >= width)
        span.last = width - 1;
    return span;
}

#endif
