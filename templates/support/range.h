/* Ranges: what is known of a quantity before a frame is drawn. A kernel evaluates its own steps once in ranges, over
 * all the pixels that hit, and so learns how far any pixel's computed value can be from the true one.
 *
 * Of the true value v, and of the number c that the kernel computes for it (for double-doubles and pairs c = hi + lo):
 *     least <= v <= most
 *     |c - v| <= relative |v| + 2 root sqrt|v| + root^2 + absolute
 *     |lo| <= low_relative |c| + low
 * The relative part survives products, quotients and roots, so that a root near 0 is not drowned; the part of `root`
 * comes from squares: (b + d)^2 = b^2 + 2 d b + d^2 with |d| <= root. Whatever cannot be bounded is infinite.
 *
 * All of this is computed in float64, each operation with at most 2^-53 relative error; nothing here subtracts, but for
 * the ends of ranges, which are moved outwards by 2^-50 of their size. range_error, the end of it all, adds one part in
 * 256 for the rest, and 2^-900 for underflow. u = 2^-53.
 */
#ifndef SYMRENDER_RANGE_H
#define SYMRENDER_RANGE_H

#include "double_double.h"
#include <math.h>

typedef struct {
    double least, most;
    double relative, root, absolute;
    double low_relative, low;
} range;

/* In which numbers the kernel carries out an operation. */
typedef enum { FLOAT64, PAIR, DOUBLE_DOUBLE } number_format;

#define POWER_ERROR 0x1.2p-52   /* of power_of_cosine, absolute: power.h has 2.46e-16 */
#define PRECISE_POWER_FLOOR 0x1p-1000   /* powers below it are 0 in precise_power.h */
#define RANGE_U 0x1p-53
#define RANGE_DD 0x1p-100   /* relative error of a double-double operation: at most 15 u^2, u^2 = 2^-106 */

static inline double range_larger(double a, double b)
{
    return a > b ? a : b;
}

static inline double range_smaller(double a, double b)
{
    return a < b ? a : b;
}

/* a b, and 0 where a factor is 0: no error times an infinite size is no error */
static inline double range_times(double a, double b)
{
    return a == 0.0 || b == 0.0 ? 0.0 : a * b;
}

/* A number that the kernel has exactly. */
static inline range range_exact(double v)
{
    const range r = {.least = v, .most = v};
    return r;
}

/* A number c that the kernel has rounded once. */
static inline range range_known(double c)
{
    const double room = 0x1p-50 * fabs(c);
    const range r = {.least = c - room, .most = c + room, .relative = 0x1.01p-53};
    return r;
}

/* A number that the kernel has as a double-double, with a relative error of at most RANGE_DD. */
static inline range range_known_wide(double_double c)
{
    const double room = 0x1p-50 * fabs(c.hi);
    const range r = {.least = c.hi - room, .most = c.hi + room, .relative = RANGE_DD, .low_relative = RANGE_U};
    return r;
}

/* Numbers from least to most, each of which the kernel has exactly. */
static inline range range_between(double least, double most)
{
    const range r = {.least = least, .most = most};
    return r;
}

/* The same, if it is known besides that least <= v <= most. */
static inline range range_within(range a, double least, double most)
{
    a.least = range_larger(a.least, least);
    a.most = range_smaller(a.most, most);
    return a;
}

/* The same, if the true value may besides be off by that part of itself. */
static inline range range_blurred(range a, double relative)
{
    a.relative += relative;
    return a;
}

/* The largest |v|. */
static inline double range_size(range a)
{
    return range_larger(fabs(a.least), fabs(a.most));
}

/* The least |v|. */
static inline double range_least_size(range a)
{
    return range_larger(0.0, range_larger(a.least, -a.most));
}

/* The bound without its relative part. */
static inline double range_rest(range a)
{
    return range_times(2.0 * a.root, sqrt(range_size(a))) + a.root * a.root + a.absolute;
}

/* The bound for every v of the range. */
static inline double range_bound(range a)
{
    return range_times(a.relative, range_size(a)) + range_rest(a);
}

/* The largest |c|. */
static inline double range_computed(range a)
{
    return range_size(a) + range_bound(a);
}

/* The largest |lo|. */
static inline double range_low(range a)
{
    return range_times(a.low_relative, range_computed(a)) + a.low;
}

static inline range range_outward(range a)
{
    a.least -= 0x1p-50 * fabs(a.least);
    a.most += 0x1p-50 * fabs(a.most);
    return a;
}

/* After an operation: RN adds a relative u, a double-double operation RANGE_DD. Pairs count their own loss. */
static inline range range_rounded(number_format format, range a)
{
    if (format == PAIR)
        return a;
    const double unit = format == FLOAT64 ? RANGE_U : RANGE_DD;
    a.absolute += unit * range_rest(a);
    a.relative += unit * (1.0 + a.relative);
    a.low_relative = format == FLOAT64 ? 0.0 : RANGE_U;
    a.low = 0.0;
    return a;
}

/* The high word of a double-double or pair as a float64. */
static inline range range_high(range a)
{
    a.absolute += a.low + a.low_relative * range_rest(a);
    a.relative += a.low_relative * (1.0 + a.relative);
    a.low_relative = a.low = 0.0;
    return a;
}

static inline range range_neg(range a)
{
    const double least = a.least;
    a.least = -a.most;
    a.most = -least;
    return a;
}

/* a times a power of two, exactly: `factor` > 0 */
static inline range range_scaled(range a, double factor)
{
    a.least *= factor;
    a.most *= factor;
    a.root *= sqrt(factor);
    a.absolute *= factor;
    a.low *= factor;
    return a;
}

static inline range range_ldexp(range a, int k)
{
    return range_scaled(a, ldexp(1.0, k));
}

/* The least |w|^2 of w = lamp - n with |n| = 1: (|lamp| - 1)^2. */
static inline double range_light_gap2(range x, range y, range z)
{
    const double a = range_least_size(x), b = range_least_size(y), c = range_least_size(z);
    const double least = sqrt(a * a + b * b + c * c) * (1.0 - 0x1p-48);
    const double d = range_size(x), e = range_size(y), f = range_size(z);
    const double most = sqrt(d * d + e * e + f * f) * (1.0 + 0x1p-48);
    const double gap = range_larger(0.0, range_larger(least - 1.0, 1.0 - most)) * (1.0 - 0x1p-48);
    return gap * gap;
}

/* The largest |v| of a vector. */
static inline double range_length(range x, range y, range z)
{
    const double a = range_size(x), b = range_size(y), c = range_size(z);
    return sqrt(a * a + b * b + c * c) * (1.0 + 0x1p-48);
}

/* a + b. Terms of one sign keep their relative errors; others may cancel. Of squares, the roots add as in
 * |sqrt((p + d)^2 + (q + e)^2) - sqrt(p^2 + q^2)| <= sqrt(d^2 + e^2) (Minkowski). */
static inline range range_sum(number_format format, range a, range b)
{
    const int same = (a.least >= 0.0 && b.least >= 0.0) || (a.most <= 0.0 && b.most <= 0.0);
    range sum = {.least = a.least + b.least, .most = a.most + b.most};
    if (same) {
        sum.relative = range_larger(a.relative, b.relative);
        sum.root = sqrt(a.root * a.root + b.root * b.root);
        sum.absolute = a.absolute + b.absolute;
    } else {
        sum.absolute = range_bound(a) + range_bound(b);
    }
    sum = range_outward(sum);
    if (format == PAIR) {
        if (same) {
            sum.low_relative = range_larger(a.low_relative, b.low_relative) + RANGE_U;
            sum.low = a.low + b.low
                      + 2.0 * range_larger(a.low_relative, b.low_relative) * (range_bound(a) + range_bound(b));
        } else {
            sum.low_relative = RANGE_U;
            sum.low = range_low(a) + range_low(b);
        }
        /* loss <= u (2 L_a + 2 L_b + u |a + b|), see pair.h; what is relative stays relative */
        sum.relative += RANGE_U * RANGE_U;
        if (same) {
            sum.relative += 2.0 * RANGE_U * range_larger(a.low_relative, b.low_relative) * (1.0 + sum.relative);
            const double low_relative = range_larger(a.low_relative, b.low_relative);
            sum.absolute += 2.0 * RANGE_U * (a.low + b.low + low_relative * (range_bound(a) + range_bound(b)));
        } else {
            sum.absolute += RANGE_U * (2.0 * range_low(a) + 2.0 * range_low(b) + RANGE_U * range_bound(sum));
        }
    }
    return range_rounded(format, sum);
}

static inline range range_difference(number_format format, range a, range b)
{
    return range_sum(format, a, range_neg(b));
}

/* a - b in float64 where one of them is a double-double w: first its hi, then its lo, so that what cancels in the first
 * step is exact. The steps round |a - b| + |w.lo| and |a - b| by u each. */
static inline range range_difference_in_order(range a, range b)
{
    const double low = range_low(a) + range_low(b);
    a.low_relative = a.low = b.low_relative = b.low = 0.0;
    range c = range_rounded(FLOAT64, range_sum(FLOAT64, a, range_neg(b)));
    c.absolute += 2.0 * RANGE_U * low;
    return c;
}

/* What pair_mul loses: L_a L_b + u (3 |a.hi| L_b + 3 |b.hi| L_a + 3 u |a.hi b.hi|) at most, and the lo that it leaves,
 * a.hi b.lo + a.lo b.hi and a rounding; |a.hi| <= |a| + L_a, and |a b| is less than |c| by no more than the losses. */
static inline range range_pair_product(range product, range a, range b)
{
    const double la = a.low_relative, lb = b.low_relative, u = RANGE_U;
    const double high_a = range_computed(a) + range_low(a), high_b = range_computed(b) + range_low(b);
    const double relative = (la * lb + 3.0 * u * (lb + la + u)) * (1.0 + la) * (1.0 + lb);
    const double rest = range_rest(product) + range_times(product.relative, range_size(product));
    product.relative += relative;
    product.absolute += relative * rest + range_times(a.low, range_low(b)) + range_times(b.low, range_times(la, high_a))
                        + 3.0 * u * (1.0 + u) * (range_times(high_a, b.low) + range_times(high_b, a.low));
    const double apart = (1.0 + la) * (1.0 + la) * (1.0 + lb) * (1.0 + lb) * (1.0 + 8.0 * u);
    product.low_relative = (la * (1.0 + lb) + lb * (1.0 + la) + u) * apart;
    product.low = (range_times(high_a, b.low) + range_times(high_b, a.low)) * apart;
    return product;
}

/* a b. What multiplies a square keeps its root: sqrt(s (b + d)^2) = sqrt(s) b + sqrt(s) d. */
static inline range range_product(number_format format, range a, range b)
{
    if (a.root == 0.0 && b.root != 0.0) {
        const range first = a;
        a = b;
        b = first;
    }
    const double corners[4] = {
        range_times(a.least, b.least), range_times(a.least, b.most),
        range_times(a.most, b.least), range_times(a.most, b.most),
    };
    range product = {.least = corners[0], .most = corners[0]};
    for (int k = 1; k < 4; ++k) {
        product.least = range_smaller(product.least, corners[k]);
        product.most = range_larger(product.most, corners[k]);
    }
    const double size_a = range_size(a), size_b = range_size(b);
    product.relative = a.relative + b.relative + a.relative * b.relative;
    if (b.root == 0.0) {
        product.root = range_times(a.root, sqrt(size_b) * (1.0 + b.relative));
        const double square = range_times(2.0 * a.root, sqrt(size_a)) + a.root * a.root + a.absolute;
        product.absolute = range_times(a.absolute, size_b * (1.0 + b.relative))
                           + range_times(b.absolute, size_a * (1.0 + a.relative) + square);
    } else {
        product.absolute = range_times(range_rest(a), size_b * (1.0 + b.relative) + range_rest(b))
                           + range_times(range_rest(b), size_a * (1.0 + a.relative));
    }
    product = range_outward(product);
    return range_rounded(format, format == PAIR ? range_pair_product(product, a, b) : product);
}

/* a^2 */
static inline range range_square(number_format format, range a)
{
    const double least = range_least_size(a), size = range_size(a), rest = range_rest(a);
    range square = {.least = least * least, .most = size * size};
    square.relative = 2.0 * a.relative + a.relative * a.relative;
    square.root = rest * (1.0 + a.relative);
    square = range_outward(square);
    return range_rounded(format, format == PAIR ? range_pair_product(square, a, a) : square);
}

/* 1 / a: 1 / (v + d) - 1 / v = -(d / v) / (v + d), and |v| is at least the range's least size. */
static inline range range_inverse(number_format format, range a)
{
    const double least = range_least_size(a), rest = range_rest(a);
    const double part = a.relative + rest / least;   /* |d / v| */
    if (!(part < 0.5) || !(least > 0.0)) {
        const range unknown = {.least = -INFINITY, .most = INFINITY, .absolute = INFINITY};
        return unknown;
    }
    range inverse = {.least = 1.0 / a.most, .most = 1.0 / a.least};
    inverse.relative = part / (1.0 - part);
    inverse = range_outward(inverse);
    if (format == PAIR) {
        /* loss <= (t + u) (t + 5 u) / |a.hi| with t = L_a / |a|, see pair.h; |a.hi| >= (1 - t) |a| */
        const double t = (a.low_relative * (1.0 + part) + a.low / least) / (1.0 - part);
        if (!(t < 0.25)) {
            const range unknown = {.least = -INFINITY, .most = INFINITY, .absolute = INFINITY};
            return unknown;
        }
        inverse.relative += (t + RANGE_U) * (t + 5.0 * RANGE_U) / ((1.0 - t) * (1.0 - t)) * (1.0 + inverse.relative);
        inverse.low_relative = t / (1.0 - 2.0 * t) + 2.0 * RANGE_U;
    }
    return range_rounded(format, inverse);
}

/* a / b in one rounding: the error of a (1 / b), with 1 / b unrounded */
static inline range range_quotient(number_format format, range a, range b)
{
    if (format == PAIR)
        return range_product(PAIR, a, range_inverse(PAIR, b));
    range inverse = range_inverse(DOUBLE_DOUBLE, b);
    return range_product(format, a, inverse);
}

/* sqrt(a), a >= 0. With e = relative and d = absolute, sqrt(v (1 + e) + d) differs from sqrt(v) by less than
 * e (1/2 + e) sqrt(v) and sqrt(d), or, where v is clear of 0, d / sqrt(v (1 - e)); and sqrt(v) less the root of
 * v - 2 r sqrt(v) - r^2 is at most (1 + sqrt(2)) r, which it is where that is 0. */
static inline range range_root(number_format format, range a)
{
    const double least = range_larger(0.0, a.least), rest = range_rest(a);
    range root = {.least = sqrt(least), .most = sqrt(range_larger(0.0, a.most))};
    root.relative = a.relative < 0.5 ? a.relative * (0.5 + a.relative) : INFINITY;
    const double from_least = least > 0.0 && a.root == 0.0 ? 1.42 * a.absolute / sqrt(least) : INFINITY;
    root.absolute = 2.42 * a.root * (1.0 + a.relative) + range_smaller(from_least, sqrt(a.absolute));
    root = range_outward(root);
    if (format == PAIR) {
        const double part = a.relative + (rest == 0.0 ? 0.0 : (least > 0.0 ? rest / least : INFINITY));
        const double t = part < 0.5 ? (a.low_relative + (a.low > 0.0 ? a.low / least : 0.0)) / (1.0 - part) : INFINITY;
        if (!(t < 0.25)) {
            const range unknown = {.least = 0.0, .most = INFINITY, .absolute = INFINITY};
            return unknown;
        }
        root.relative += (t + RANGE_U) * (t + 5.0 * RANGE_U) / ((1.0 - t) * (1.0 - t)) * (1.0 + root.relative);
        root.low_relative = t / (1.0 - 2.0 * t) + 2.0 * RANGE_U;
    }
    return range_rounded(format, root);
}

/* max(0, a): the error does not grow, but where v < 0 nothing is left for it to be a part of. */
static inline range range_positive_part(range a)
{
    if (a.least < 0.0) {
        a.absolute = a.relative < 0.5 ? a.absolute + 2.0 * a.root * a.root : INFINITY;
    }
    a.least = range_larger(0.0, a.least);
    a.most = range_larger(0.0, a.most);
    return a;
}

/* c^p, p = n / 2, for c = cos2 and from s = sin2 = 1 - c where that is computed as less than 1/2; n is known exactly.
 * The power's own error is given; what the arguments' errors do to it, for p (error of s) <= 1/10:
 *   s < 0.51    |d (1 - s)^p| <= K p e^(-p s) |ds|, K = 1.85, or 3.5 where p < 1; and p s e^(-p s) <= 0.37,
 *               2 p sqrt(s) e^(-p s) <= 0.86 sqrt(p)
 *   c < 0.52    n >= 2: a relative error r counts p 0.52^p r <= 0.63 r; one of sqrt(c) 1.9 times, an absolute one
 *               1.2 times; and where r.v < 0 the same power stands for 0, from which it differs by the errors squared
 *               n < 2: by the mean value, as c >= cos2.least > 0, r.v is clear of 0, and c moves by less than 1/4 c */
static inline range range_power_of_cosine(number_format format, range cos2, range sin2, range exponent,
    double own_relative, double own_absolute)
{
    const double n = exponent.most, p = 0.5 * n;
    range power = {.least = 0.0, .most = 1.0};
    if (n == 0.0)
        return range_exact(1.0);
    const double shift = range_bound(sin2);
    const double factor = p < 1.0 ? 3.5 : 1.85;
    const double near_one = factor
                            * (range_smaller(0.37, 0.51 * p) * sin2.relative
                               + range_smaller(0.86 * sqrt(p), 1.44 * p) * sin2.root
                               + p * (sin2.root * sin2.root + sin2.absolute));
    double elsewhere = 0.63 * cos2.relative;
    if (n >= 2.0) {
        const double at_zero = 2.0 * (cos2.root + sqrt(cos2.absolute));
        elsewhere += 1.9 * cos2.root + 1.2 * cos2.absolute + at_zero * at_zero;
    } else {
        const double slope = n < 1.0 ? pow(0.5 * cos2.least, p - 0.5) : 1.0;
        elsewhere += 1.2 * (n * slope * cos2.root + p * pow(0.5 * cos2.least, p - 1.0) * cos2.absolute);
    }
    const double most_shift = n < 2.0 ? 0.25 * cos2.least : 0.01;
    const int is_near = shift < 0.01 && p * shift <= 0.1 && range_bound(cos2) <= most_shift;
    power.absolute = is_near ? range_larger(near_one, elsewhere) + own_absolute : INFINITY;
    power.relative = own_relative;
    power.low_relative = format == FLOAT64 ? 0.0 : 0x1p-50;
    return power;
}

/* cos2^h by squaring, step by step as whole_power.h computes it, h >= 4. Where r.v < 0 the same power stands for 0: there
 * cos2 is computed as less than its errors squared. */
static inline range range_whole_power(number_format format, range cos2, int h)
{
    const double at_zero = 2.0 * (cos2.root + sqrt(cos2.absolute));
    range square = cos2;
    for (; h % 2 == 0; h /= 2)
        square = range_within(range_square(format, square), 0.0, 1.0);
    range power = square;
    while ((h /= 2) > 0) {
        square = range_within(range_square(format, square), 0.0, 1.0);
        if (h % 2 == 1)
            power = range_within(range_product(format, power, square), 0.0, 1.0);
    }
    power.absolute += at_zero < 1.0 ? at_zero * at_zero : INFINITY;
    return power;
}

/* The power of a cosine, by squaring where `half` is not 0. */
static inline range range_lobe(number_format format, range cos2, range sin2, range exponent, int half,
    double own_relative, double own_absolute)
{
    return half > 0 ? range_whole_power(format, cos2, half)
                    : range_power_of_cosine(format, cos2, sin2, exponent, own_relative, own_absolute);
}

/* One of the two. That it is the right one is not counted here: a pixel where it may not be asks for more. */
static inline range range_either(range a, range b)
{
    range either = {
        .least = range_smaller(a.least, b.least),
        .most = range_larger(a.most, b.most),
        .relative = range_larger(a.relative, b.relative),
        .root = range_larger(a.root, b.root),
        .absolute = range_larger(a.absolute, b.absolute),
        .low_relative = range_larger(a.low_relative, b.low_relative),
        .low = range_larger(a.low, b.low),
    };
    return either;
}

/* The bound, with room for its own rounding. */
static inline double range_error(range a)
{
    const double bound = range_bound(a) * (1.0 + 0x1p-8) + 0x1p-900;
    return bound >= 0.0 ? bound : INFINITY;   /* NaN: nothing is known */
}

#endif
