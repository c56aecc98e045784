/* The exact sign of a polynomial in doubles.
 *
 * A sum of products  coefficient * a * b * c * d  of small integers and finite doubles is accumulated without any
 * rounding: in fixed point, wide enough for every such product (Kulisch 1971). No input overflows it, and subnormal
 * numbers and zeros need no special case. The sign of the sum is then a fact, not an estimate.
 *
 * Fixed point: a finite double is an integer below 2^53 times 2^(p - 1074), 0 <= p <= 2045. A product of four is an
 * integer times 2^(p - 4296), and is below 2^4096. In units of 2^-4296 it is below 2^8392; times a 32 bit coefficient,
 * 2^8424. The 266 limbs of 32 bits hold 2^8512: room for 2^88 such products.
 *
 * Positive and negative products are summed apart, so no carry runs further than it must, no number is ever negative,
 * and the sign is one comparison. It is meant for decisions that are rare: some 50 ns a product.
 *
 *     exact_sum sum;
 *     exact_sum_clear(&sum);
 *     exact_sum_add_product(&sum,  1, e, e, r, r);       for the sign of  e^2 r^2 - 2 x y
 *     exact_sum_add_product(&sum, -2, x, y, 1.0, 1.0);
 *     sign = exact_sum_sign(&sum);
 */
#ifndef SYMRENDER_EXACT_SIGN_H
#define SYMRENDER_EXACT_SIGN_H

#include <stdint.h>
#include <string.h>

enum {
    EXACT_SUM_LIMBS = 266,
    EXACT_PRODUCT_LIMBS = 9 /* 32 + 4 * 53 = 244 bits, and a shift by at most 31 */
};

typedef struct {
    uint32_t positive[EXACT_SUM_LIMBS]; /* least significant limb first, in units of 2^-4296 */
    uint32_t negative[EXACT_SUM_LIMBS];
} exact_sum;

/* |value| = mantissa 2^(position - 1074), as binary64 stores it: a subnormal has position 0 and no hidden bit. */
typedef struct {
    uint64_t mantissa;
    int position;
    int is_negative;
} exact_parts;

static inline exact_parts exact_parts_of(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    const uint64_t fraction = bits & ((UINT64_C(1) << 52) - 1);
    const int exponent = (int)((bits >> 52) & 0x7FF);
    const exact_parts parts = {
        exponent > 0 ? (fraction | UINT64_C(1) << 52) : fraction,
        exponent > 0 ? exponent - 1 : 0,
        (int)(bits >> 63),
    };
    return parts;
}

/* product *= 2^32 high + low, where the result fits in so many limbs */
static inline void exact_multiply(uint32_t product[EXACT_PRODUCT_LIMBS], int limbs, uint32_t high, uint32_t low)
{
    uint64_t low_carry = 0, high_carry = 0;
    uint32_t limb_below = 0;
    for (int i = 0; i < limbs; ++i) {
        /* no carry overflows: (2^32 - 1)^2 + 2 (2^32 - 1) = 2^64 - 1 */
        low_carry += (uint64_t)product[i] * low;
        high_carry += (uint64_t)limb_below * high + (uint32_t)low_carry;
        limb_below = product[i];
        product[i] = (uint32_t)high_carry;
        low_carry >>= 32;
        high_carry >>= 32;
    }
}

/* sum = 0 */
static inline void exact_sum_clear(exact_sum *sum)
{
    memset(sum, 0, sizeof *sum);
}

/* sum += coefficient a b c d, exactly, for finite a, b, c, d; a missing factor is 1.0 */
static inline void exact_sum_add_product(exact_sum *sum, int coefficient, double a, double b, double c, double d)
{
    const double factors[4] = {a, b, c, d};
    const uint32_t magnitude = coefficient < 0 ? 0u - (uint32_t)coefficient : (uint32_t)coefficient;
    uint32_t product[EXACT_PRODUCT_LIMBS] = {magnitude};
    int is_negative = coefficient < 0;
    int position = 0;
    for (int i = 0; i < 4; ++i) { /* after factor i: at most 32 + 53 (i + 1) bits, or 3 + 2 i limbs */
        const exact_parts parts = exact_parts_of(factors[i]);
        exact_multiply(product, 3 + 2 * i, (uint32_t)(parts.mantissa >> 32), (uint32_t)parts.mantissa);
        position += parts.position;
        is_negative ^= parts.is_negative;
    }
    exact_multiply(product, EXACT_PRODUCT_LIMBS, 0, UINT32_C(1) << (position % 32));

    uint32_t *limbs = is_negative ? sum->negative : sum->positive;
    uint64_t carry = 0;
    int limb = position / 32;
    for (int i = 0; i < EXACT_PRODUCT_LIMBS; ++i, ++limb) {
        carry += (uint64_t)limbs[limb] + product[i];
        limbs[limb] = (uint32_t)carry;
        carry >>= 32;
    }
    for (; carry != 0 && limb < EXACT_SUM_LIMBS; ++limb) {
        carry += limbs[limb];
        limbs[limb] = (uint32_t)carry;
        carry >>= 32;
    }
}

/* -1, 0 or 1: the sign of the sum */
static inline int exact_sum_sign(const exact_sum *sum)
{
    for (int limb = EXACT_SUM_LIMBS - 1; limb >= 0; --limb)
        if (sum->positive[limb] != sum->negative[limb]) return sum->positive[limb] > sum->negative[limb] ? 1 : -1;
    return 0;
}

#endif
