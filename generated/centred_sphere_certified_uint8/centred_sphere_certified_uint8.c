/* centred_sphere_certified_uint8: one Phong sphere, one point light
 * Accuracy "certified_uint8" (symrender_cg 0.1.0)
 * Generated from the formula; do not edit. Regenerate with:
 *     python -m symrender_cg build chapter1 --accuracy certified --target uint8
 *
 * promise  the grey level floor(255 I + 1/2) of the true intensity I, cut to [0, 1]; pixels whose own bound does
 *          not show that are reported
 * in       diffuse term
 *          specular term
 * out      sphere off the axis: the centre is the point looked at: disc depends on x^2 + y^2 alone
 *          sphere at the plane of the eye: the sphere lies wholly before the eye: depth of its centre 4 > R 1
 *          gated specular: the material asks for the specular term as Phong wrote it, not gated by n.l > 0
 *          shadow of the sphere on itself: a sphere is convex: where n.l > 0 the way to the light leaves it; where
 *          not, diffuse is 0
 *          numbers above are those of the scene it was written for; any scene with the same effects may call it
 * ops      once: frame 11 mul 3 add 3 div 1 sqrt 1 max 1 select 21 call
 *          a row: 3 mul 1 add 5 call
 *          a pixel: 16 mul 17 add 2 div 2 sqrt 2 max 2 select 1 call
 */
#include "centred_sphere_certified_uint8.h"

#include "inline.h"
#include "span.h"
#include "units.h"
#include "block.h"
#include "phong_power.h"
#include "double_double.h"
#include "whole_power.h"
#include "exact_sign.h"
#include "range.h"
#include "settle.h"
#include <math.h>

enum { POINTS = 128 };   /* pixels of a block: its arrays fit into the first level cache */

/* What does not change within a frame. */
typedef struct {
    int half_exponent;
    double zero_power, specular_gain, plane_unit, lamp_x, lamp_y, lamp2, extent_x, extent_y, focal2, slope, bend,
        base_frame, row_dot_lamp_frame, diffuse_gain, k_ambient, shininess;
    double_double alpha, rho2;
} frame;

static frame frame_of(const centred_sphere_certified_uint8_scene *scene)
{
    /* specular [1 mul 1 select 1 call] */
    const int half_exponent = half_of_whole(scene->shininess);   /* n / 2 where n is an even whole number, else 0 */
    const double zero_power = scene->shininess == 0.0 ? 1.0 : 0.0;   /* 0^n: 1 for n = 0 */
    const double specular_gain = scene->k_specular * scene->light_intensity;   /* I_L k_s */

    /* units of length, powers of two [5 call] */
    const int plane_exponent = unit_exponent(scene->eye);   /* f = e 2^k in [1, 2) */
    const double plane_unit = ldexp(1, plane_exponent);
    const int world_exponent = unit_exponent(scene->radius);   /* R 2^k in [1, 2) */
    const double eye = ldexp(scene->eye, world_exponent);
    const double radius = ldexp(scene->radius, world_exponent);

    /* light [3 mul 3 add 3 div 4 call] */
    const double from_center_x = scene->light_x;   /* L - C */
    const double from_center_y = scene->light_y;
    const double from_center_z = scene->light_z;
    /* farther than 2^60 R a light shines in parallel */
    const int lamp_exponent = light_exponent(world_exponent, scene->radius, from_center_x, from_center_y,
        from_center_z, 60);
    const double lamp_x = ldexp(from_center_x, lamp_exponent) / radius;   /* (L - C) / R */
    const double lamp_y = ldexp(from_center_y, lamp_exponent) / radius;
    const double lamp_z = ldexp(from_center_z, lamp_exponent) / radius;
    const double lamp2 = 1.0 + lamp_x * lamp_x + lamp_y * lamp_y + lamp_z * lamp_z;   /* |lamp|^2 + |n|^2 */

    /* silhouette [1 sqrt 1 max 11 call] */
    /* alpha = kappa^2 - 1, free of cancellation */
    const double_double alpha = dd_div(dd_mul(dd_difference(eye, radius), dd_sum(eye, radius)),
        dd_product(radius, radius));
    /* rays D = (x, y, -f): f is e, in the unit of the image plane */
    const double focal = ldexp(scene->eye, plane_exponent);
    /* the silhouette is the circle x^2 + y^2 = rho^2 = f^2 / alpha */
    const double_double rho2 = dd_div(dd_product(focal, focal), alpha);
    /* kappa = e / R: lengths of the scene in radii */
    const double_double depth = dd_div(dd_from(eye), dd_from(radius));
    const double share_4 = sqrt(rho2.hi > 0.0 ? rho2.hi : 0.0);
    const double extent_x = share_4;   /* no hit is farther from the axis, to the side or up */
    const double extent_y = share_4;

    /* ray and sphere [1 mul] */
    const double focal2 = focal * focal;

    /* normal [4 mul] */
    const double share_2 = focal * depth.hi;
    const double slope = lamp_x * share_2;   /* F = kappa (f x, f y, s): F.lamp = slope x + bend s + base */
    const double bend = depth.hi * lamp_z;
    const double base_frame = lamp_y * share_2;   /* what is the same for a frame in base */

    /* light [1 mul] */
    const double row_dot_lamp_frame = -(focal * lamp_z);   /* what is the same for a frame in row_dot_lamp */

    /* diffuse [1 mul] */
    const double diffuse_gain = scene->k_diffuse * scene->light_intensity;   /* I_L k_d */

    const frame f = {
        .half_exponent = half_exponent,
        .zero_power = zero_power,
        .specular_gain = specular_gain,
        .plane_unit = plane_unit,
        .lamp_x = lamp_x,
        .lamp_y = lamp_y,
        .lamp2 = lamp2,
        .alpha = alpha,
        .rho2 = rho2,
        .extent_x = extent_x,
        .extent_y = extent_y,
        .focal2 = focal2,
        .slope = slope,
        .bend = bend,
        .base_frame = base_frame,
        .row_dot_lamp_frame = row_dot_lamp_frame,
        .diffuse_gain = diffuse_gain,
        .k_ambient = scene->k_ambient,
        .shininess = scene->shininess,
    };
    return f;
}

/* What does not change within a row. */
typedef struct {
    double_double x_left, x_right;
    double y2, base, row_dot_lamp;
} row;

SYMRENDER_INLINE row row_of(double y, const frame *f)
{
    /* silhouette [5 call] */
    /* the row's hits are -reach <= x <= reach */
    const double_double reach = dd_sqrt(dd_positive_part(dd_sub(f->rho2, dd_product(y, y))));
    const double_double x_left = dd_neg(reach);
    const double_double x_right = reach;

    /* ray and sphere [1 mul] */
    const double y2 = y * y;

    /* normal [1 mul] */
    const double base = y * f->base_frame;

    /* light [1 mul 1 add] */
    const double row_dot_lamp = y * f->lamp_y + f->row_dot_lamp_frame;

    const row r = {
        .x_left = x_left, .x_right = x_right, .y2 = y2, .base = base, .row_dot_lamp = row_dot_lamp,
    };
    return r;
}

/* Does the ray through (x, y) hit? Settled without rounding, as the sign of a polynomial in the inputs. */
static int hits_exactly(double x, double y, const centred_sphere_certified_uint8_scene *scene)
{
    exact_sum sum;
    exact_sum_clear(&sum);   /* disc */
    exact_sum_add_product(&sum,  1, scene->eye, scene->eye, scene->radius, scene->radius);
    exact_sum_add_product(&sum, -1, scene->eye, scene->eye, x, x);
    exact_sum_add_product(&sum, -1, scene->eye, scene->eye, y, y);
    exact_sum_add_product(&sum,  1, scene->radius, scene->radius, x, x);
    exact_sum_add_product(&sum,  1, scene->radius, scene->radius, y, y);
    return exact_sum_sign(&sum) >= 0;
}

/* How surely facing2, the discriminant in radii, has the right sign: it has if this is positive. Its error is far below
 * 2^-40 |D|^2 for every scene that the plan admits; within that, and where it is NaN, hits_exactly decides. */
static inline double certainty(double facing2, double d_dot_d)
{
    return fabs(facing2) - 0x1p-40 * d_dot_d;
}

/* facing2 of the ray through x of this row: its sign says whether the ray hits, for sure where *sure is positive. */
SYMRENDER_INLINE double sight(double x, const row *r, const frame *f, double *sure)
{
    /* ray and sphere [3 mul 6 add] */
    /* distance to the two ends of the span, not negative inside it */
    const double from_left = x - r->x_left.hi - r->x_left.lo;
    const double to_right = r->x_right.hi - x + r->x_right.lo;
    const double chord = from_left * to_right;
    /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
    const double facing2 = f->alpha.hi * chord;
    const double s = x * x + r->y2;   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const double d_dot_d = s + f->focal2;

    *sure = certainty(facing2, d_dot_d);
    return facing2;
}

/* Does the ray through the centre of a pixel of this row hit? The pixel is column pixels to the right of the axis. */
static int is_hit(double column, double plane_y, const row *r, const frame *f, double pixel, double step,
    const centred_sphere_certified_uint8_scene *scene)
{
    double sure;
    const double facing2 = sight(column * step, r, f, &sure);

    return sure > 0.0 ? facing2 > 0.0 : hits_exactly(column * pixel, plane_y, scene);
}

/* ---- how far a value may be off ---- */

#define SURE_HIT 0x1p-20   /* facing2 below this part of |D|^2 is too close to the silhouette for the bounds below */

/* What holds for every pixel of a frame: the bound of its value, and where its conditions are decided. */
typedef struct {
    double value;                /* |computed - true value| */
    double unlit;                /* n.l below this is negative: there is no diffuse term */
    double no_lobe;              /* w . mirror below this is negative: there is no highlight */
    double lobe_from, lobe_to;   /* for n < 2, w . mirror between these is too small for the power */
} bounds;

/* The steps of the kernel in ranges, over all pixels with |x| <= x_most, |y| <= y_most that surely hit. */
static bounds bounds_of(
    const centred_sphere_certified_uint8_scene *scene, double x_most, double y_most)
{
    const range x = range_between(-x_most, x_most), y = range_between(-y_most, y_most);
    const double least_cos2 = scene->shininess < 2.0 ? 0x1p-20 : 0.0;

    /* specular [1 select 4 call] */
    const int half_exponent = half_of_whole(scene->shininess);
    const double zero_power = scene->shininess == 0.0 ? 1.0 : 0.0;
    const range specular_gain = range_product(FLOAT64, range_exact(scene->k_specular),
        range_exact(scene->light_intensity));

    /* units of length, powers of two [4 call] */
    const int plane_exponent = unit_exponent(scene->eye);
    const int world_exponent = unit_exponent(scene->radius);
    const double eye = ldexp(scene->eye, world_exponent);
    const double radius = ldexp(scene->radius, world_exponent);

    /* light [26 call] */
    const double from_center_x = scene->light_x;
    const double from_center_y = scene->light_y;
    const double from_center_z = scene->light_z;
    const int lamp_exponent = light_exponent(world_exponent, scene->radius, from_center_x, from_center_y,
        from_center_z, 60);
    const range lamp_x = range_blurred(range_quotient(FLOAT64, range_ldexp(range_known(from_center_x), lamp_exponent),
        range_exact(radius)), 0x1p-58);
    const range lamp_y = range_blurred(range_quotient(FLOAT64, range_ldexp(range_known(from_center_y), lamp_exponent),
        range_exact(radius)), 0x1p-58);
    const range lamp_z = range_blurred(range_quotient(FLOAT64, range_ldexp(range_known(from_center_z), lamp_exponent),
        range_exact(radius)), 0x1p-58);
    const double light_gap2 = range_light_gap2(lamp_x, lamp_y, lamp_z);   /* the least |w|^2: (|lamp| - 1)^2 */
    const double lamp_length = range_length(lamp_x, lamp_y, lamp_z);   /* the largest |lamp| */
    const range lamp2 = range_sum(FLOAT64,
        range_sum(FLOAT64, range_sum(FLOAT64, range_exact(1.0), range_square(FLOAT64, lamp_x)),
        range_square(FLOAT64, lamp_y)), range_square(FLOAT64, lamp_z));
    const range d_dot_lamp_odd = range_product(FLOAT64, x, lamp_x);

    /* silhouette [1 div 24 call] */
    const range alpha = range_quotient(DOUBLE_DOUBLE,
        range_product(DOUBLE_DOUBLE, range_difference(DOUBLE_DOUBLE, range_exact(eye), range_exact(radius)),
        range_sum(DOUBLE_DOUBLE, range_exact(eye), range_exact(radius))),
        range_square(DOUBLE_DOUBLE, range_exact(radius)));
    const double least_reach2 = SURE_HIT / range_size(alpha);   /* of a row with hits that are sure */
    const double focal = ldexp(scene->eye, plane_exponent);
    const range rho2 = range_quotient(DOUBLE_DOUBLE, range_square(DOUBLE_DOUBLE, range_exact(focal)), alpha);
    const range reach = range_root(DOUBLE_DOUBLE,
        range_within(range_positive_part(range_difference(DOUBLE_DOUBLE, rho2, range_square(DOUBLE_DOUBLE, y))),
        least_reach2, INFINITY));
    const range x_left = range_neg(reach);
    const range x_right = reach;
    const range depth = range_quotient(DOUBLE_DOUBLE, range_exact(eye), range_exact(radius));

    /* ray and sphere [17 call] */
    const range from_left = range_within(range_difference_in_order(x, x_left), 0.0, INFINITY);
    const range to_right = range_within(range_difference_in_order(x_right, x), 0.0, INFINITY);
    const range chord = range_product(FLOAT64, from_left, to_right);
    const range y2 = range_square(FLOAT64, y);
    const range s = range_sum(FLOAT64, range_square(FLOAT64, x), y2);
    const range focal2 = range_square(FLOAT64, range_exact(focal));
    const range d_dot_d = range_sum(FLOAT64, s, focal2);
    const double farthest2 = range_size(d_dot_d);   /* the largest |D|^2 */
    const range facing2 = range_within(range_product(FLOAT64, range_high(alpha), chord), SURE_HIT, farthest2);
    const range facing = range_root(FLOAT64, range_positive_part(facing2));

    /* normal [13 call] */
    const range inv_d2 = range_inverse(FLOAT64, d_dot_d);
    const range share_2 = range_product(FLOAT64, range_exact(focal), range_high(depth));
    const range slope = range_product(FLOAT64, lamp_x, share_2);
    const range bend = range_product(FLOAT64, range_high(depth), lamp_z);
    const range base_frame = range_product(FLOAT64, lamp_y, share_2);
    const range base = range_product(FLOAT64, y, base_frame);
    const range foot_dot_lamp_even = range_sum(FLOAT64, range_product(FLOAT64, s, bend), base);
    const range foot_dot_lamp_odd = range_product(FLOAT64, x, slope);
    const range foot_dot_lamp = range_sum(FLOAT64, foot_dot_lamp_even, foot_dot_lamp_odd);

    /* light [20 call] */
    const range row_dot_lamp_frame = range_neg(range_product(FLOAT64, range_exact(focal), lamp_z));
    const range row_dot_lamp = range_sum(FLOAT64, range_product(FLOAT64, y, lamp_y), row_dot_lamp_frame);
    const range d_dot_lamp = range_sum(FLOAT64, row_dot_lamp, d_dot_lamp_odd);
    const range n_dot_lamp = range_within(range_product(FLOAT64, inv_d2,
        range_difference(FLOAT64, foot_dot_lamp, range_product(FLOAT64, facing, d_dot_lamp))), -lamp_length,
        lamp_length);
    const range share_3 = range_product(FLOAT64, range_exact(2.0), n_dot_lamp);
    const range w2 = range_within(range_difference(FLOAT64, lamp2, share_3), light_gap2, INFINITY);
    const range inv_w2 = range_inverse(FLOAT64, w2);
    const range n_dot_l = range_within(range_product(FLOAT64, range_difference(FLOAT64, n_dot_lamp, range_exact(1.0)),
        range_root(FLOAT64, inv_w2)), -1.0, 1.0);

    /* diffuse [5 call] */
    const range diffuse_gain = range_product(FLOAT64, range_exact(scene->k_diffuse),
        range_exact(scene->light_intensity));
    const range diffuse = range_product(FLOAT64, range_positive_part(n_dot_l), diffuse_gain);

    /* specular [16 call] */
    const range w_dot_mirror = range_sum(FLOAT64, d_dot_lamp,
        range_product(FLOAT64, facing, range_difference(FLOAT64, share_3, range_exact(1.0))));
    const range inv_w2_d2 = range_product(FLOAT64, inv_d2, inv_w2);
    const range cos2 = range_within(range_product(FLOAT64, range_square(FLOAT64, w_dot_mirror), inv_w2_d2),
        least_cos2, 1.0);
    const range sin2 = range_within(range_difference(FLOAT64, range_exact(1.0), cos2), 0.0, 1.0);
    const range highlight = range_lobe(FLOAT64, cos2, sin2, range_exact(scene->shininess), half_exponent, 0.0,
        POWER_ERROR);
    const range specular = range_product(FLOAT64, range_either(highlight, range_exact(zero_power)), specular_gain);

    /* intensity [5 call] */
    const range lit = range_sum(FLOAT64, diffuse, specular);
    const range value = range_sum(FLOAT64, range_exact(scene->k_ambient), range_either(lit, range_exact(0.0)));

    bounds b = {.value = range_error(value)};
    b.value += 0x1p-50 * (1.0 + range_size(value));   /* what value - bound and value + bound round */
    b.unlit = -range_error(n_dot_l);
    const double lobe = range_error(w_dot_mirror);
    const int is_steep = scene->shininess > 0.0 && scene->shininess < 2.0;
    b.no_lobe = scene->shininess > 0.0 ? -lobe : -(double)INFINITY;
    b.lobe_from = is_steep ? -lobe : (double)INFINITY;
    b.lobe_to = 0x1p-10 * sqrt(range_size(w2) * farthest2) + lobe;
    return b;
}

/* The bounds of a frame where no hit is farther from the axis than these, in the unit of the image plane. */
static bounds bounds_within(
    const centred_sphere_certified_uint8_scene *scene, const frame *f,
    double x_most, double y_most)
{
    const double x_extent = f->extent_x * (1.0 + 0x1p-20), y_extent = f->extent_y * (1.0 + 0x1p-20);
    return bounds_of(scene, x_most < x_extent ? x_most : x_extent, y_most < y_extent ? y_most : y_extent);
}

/* ---- shading ---- */

/* A bound of a value's error, by the quantities that decide its conditions; 0 where it is exact, INFINITY where nothing
 * is known. */
SYMRENDER_INLINE double error_of(double facing2, double d_dot_d, double n_dot_l, double w_dot_mirror, const bounds *b)
{
    const int is_clear = (facing2 - SURE_HIT * d_dot_d > 0.0)
        & ((w_dot_mirror <= b->lobe_from) | (w_dot_mirror >= b->lobe_to));
    /* where it is unlit, the value is the ambient one, exactly */
    const int is_unlit = (n_dot_l < b->unlit) & (w_dot_mirror < b->no_lobe);

    return is_clear ? (is_unlit ? 0.0 : b->value) : (double)INFINITY;
}

/* Does a ray surely miss? */
SYMRENDER_INLINE int surely_misses(double facing2, double d_dot_d)
{
    return -0x1p-40 * d_dot_d - facing2 > 0.0;
}

/* Values of a block of pixels, from the stages that compute them to those that use them. */
typedef struct {
    double s[POINTS], facing[POINTS], inv_d2[POINTS], foot_dot_lamp_odd[POINTS], d_dot_lamp_odd[POINTS],
        facing2[POINTS], d_dot_d[POINTS], foot_dot_lamp_even[POINTS], w2[POINTS], diffuse[POINTS], w_dot_mirror[POINTS],
        cos2[POINTS], n_dot_l[POINTS], highlight[POINTS], value[POINTS];
    double error[POINTS];   /* a bound of that of the value: 0 where it is exact, INFINITY for an unknown one */
} block;

/* Stage 1, the same for x and -x, y and -y: ray and sphere, normal, light [5 mul 6 add 1 div 1 sqrt 1 max]. Leaves
 * s, facing, inv_d2, foot_dot_lamp_odd, d_dot_lamp_odd, facing2, d_dot_d. */
SYMRENDER_INLINE void stage_1(double x, const row *r, const frame *f, block *b, int i)
{
    /* ray and sphere [3 mul 6 add 1 sqrt 1 max] */
    /* distance to the two ends of the span, not negative inside it */
    const double from_left = x - r->x_left.hi - r->x_left.lo;
    const double to_right = r->x_right.hi - x + r->x_right.lo;
    const double chord = from_left * to_right;
    /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
    const double facing2 = f->alpha.hi * chord;
    const double s = x * x + r->y2;   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const double d_dot_d = s + f->focal2;
    const double facing = sqrt(facing2 > 0.0 ? facing2 : 0.0);   /* -n.D, how far the surface faces the ray: root / R */

    /* normal [1 mul 1 div] */
    const double inv_d2 = 1.0 / d_dot_d;
    const double foot_dot_lamp_odd = x * f->slope;   /* what x and -x share up to the sign in foot_dot_lamp */

    /* light [1 mul] */
    const double d_dot_lamp_odd = x * f->lamp_x;   /* what x and -x share up to the sign in d_dot_lamp */

    b->s[i] = s;
    b->facing[i] = facing;
    b->inv_d2[i] = inv_d2;
    b->foot_dot_lamp_odd[i] = foot_dot_lamp_odd;
    b->d_dot_lamp_odd[i] = d_dot_lamp_odd;
    b->facing2[i] = facing2;
    b->d_dot_d[i] = d_dot_d;
}

/* Stage 2, the same for x and -x: normal [1 mul 1 add]. Leaves foot_dot_lamp_even. */
SYMRENDER_INLINE void stage_2(const row *r, const frame *f, block *b, int i)
{
    /* normal [1 mul 1 add] */
    const double foot_dot_lamp_even = b->s[i] * f->bend + r->base;   /* what x and -x share in foot_dot_lamp */

    b->foot_dot_lamp_even[i] = foot_dot_lamp_even;
}

/* Stage 3: normal, light, diffuse, specular [9 mul 7 add 1 div 1 sqrt 1 max]. Leaves w2, diffuse, w_dot_mirror,
 * cos2, n_dot_l. */
SYMRENDER_INLINE void stage_3(double side, const row *r, const frame *f, block *b, int i)
{
    const double foot_dot_lamp_odd = side * b->foot_dot_lamp_odd[i];
    const double d_dot_lamp_odd = side * b->d_dot_lamp_odd[i];

    /* normal [1 add] */
    const double foot_dot_lamp = b->foot_dot_lamp_even[i] + foot_dot_lamp_odd;

    /* light [4 mul 4 add 1 div 1 sqrt] */
    const double d_dot_lamp = r->row_dot_lamp + d_dot_lamp_odd;   /* D.lamp */
    /* n.lamp, with n = (F - facing D) / |D|^2 */
    const double n_dot_lamp = b->inv_d2[i] * (foot_dot_lamp - b->facing[i] * d_dot_lamp);
    const double share_3 = 2.0 * n_dot_lamp;
    const double w2 = f->lamp2 - share_3;   /* |w|^2 for w = lamp - n */
    const double inv_w2 = 1.0 / w2;
    const double n_dot_l = (n_dot_lamp - 1.0) * sqrt(inv_w2);   /* n.l = n.w / |w| */

    /* diffuse [1 mul 1 max]. Phong 1975, Illumination for computer generated pictures */
    const double diffuse = (n_dot_l > 0.0 ? n_dot_l : 0.0) * f->diffuse_gain;   /* k_d max(0, n.l) */

    /* specular [4 mul 2 add] */
    /* r.v = w . mirror / (|w| |D|), mirror = D + 2 facing n */
    const double w_dot_mirror = d_dot_lamp + b->facing[i] * (share_3 - 1.0);
    const double inv_w2_d2 = b->inv_d2[i] * inv_w2;
    const double cos2 = w_dot_mirror * w_dot_mirror * inv_w2_d2;   /* (r.v)^2 */

    b->w2[i] = w2;
    b->diffuse[i] = diffuse;
    b->w_dot_mirror[i] = w_dot_mirror;
    b->cos2[i] = cos2;
    b->n_dot_l[i] = n_dot_l;
}

/* Stage 4: specular [1 add 1 call]. Leaves highlight. */
SYMRENDER_INLINE void stage_4(const frame *f, block *b, int i)
{
    /* specular [1 add 1 call]. Phong 1975, Illumination for computer generated pictures */
    const double sin2 = 1.0 - b->cos2[i];   /* 1 - (r.v)^2 as a difference: what cancels is paid for */
    const double highlight = power_of_cosine(b->cos2[i], sin2, f->shininess);   /* max(0, r.v)^n where r.v > 0 */

    b->highlight[i] = highlight;
}

/* Stage 5: specular, intensity [1 mul 2 add 2 select]. Leaves value. */
SYMRENDER_INLINE void stage_5(const frame *f, block *b, int i)
{
    const double highlight = b->highlight[i];
    const double zero_power = f->zero_power;

    /* specular [1 mul 1 select]. Phong 1975, Illumination for computer generated pictures */
    /* k_s max(0, r.v)^n */
    const double specular = (b->w_dot_mirror[i] > 0.0 ? highlight : zero_power) * f->specular_gain;

    /* intensity [2 add 1 select]. Phong 1975, Illumination for computer generated pictures */
    const double lit = b->diffuse[i] + specular;   /* what the light adds; the gains hold its intensity */
    const double value = f->k_ambient + (b->w2[i] > 0.0 ? lit : 0.0);   /* I = k_a + what the light adds */

    b->value[i] = value;
}

/* The stages that differ between x and -x, for pixels right (side 1) or left (side -1) of the middle of the row. */
SYMRENDER_INLINE void finish(double side, int count, const row *r, const frame *f, block *b)
{
    for (int i = 0; i < count; ++i)
        stage_3(side, r, f, b, i);
    if (f->half_exponent > 0) {
        whole_powers_of_square(b->cos2, b->highlight, f->half_exponent, count);
    } else {
        for (int i = 0; i < count; ++i)
            stage_4(f, b, i);
    }
    for (int i = 0; i < count; ++i)
        stage_5(f, b, i);
}

/* Bounds of the errors of a block of values. */
SYMRENDER_INLINE void judge(block *b, int count, const bounds *limits)
{
    for (int i = 0; i < count; ++i)
        b->error[i] = error_of(b->facing2[i], b->d_dot_d[i], b->n_dot_l[i], b->w_dot_mirror[i], limits);
}

/* Where a ray surely misses, the value is the background's, exactly. */
SYMRENDER_INLINE void clear_misses(block *b, int count, double background)
{
    for (int i = 0; i < count; ++i) {
        const int is_miss = surely_misses(b->facing2[i], b->d_dot_d[i]);
        b->value[i] = is_miss ? background : b->value[i];
        b->error[i] = is_miss ? 0.0 : b->error[i];
    }
}

/* Writes the grey levels of the true values, as far as the bounds show them to be that, and
 * the numbers of the points where they do not, from `first` on or back. Returns how many those are. `forth` is 1 or -1:
 * value k goes to out[k forth], for passed <= k < count; the block holds `held` values, whole vectors of them where it
 * may. */
SYMRENDER_INLINE ptrdiff_t settle(const block *b, int held, int passed, int count,
    unsigned char *restrict out, int forth, ptrdiff_t first, ptrdiff_t *unsettled)
{
    int settled[POINTS], some = 0;
    int level[POINTS];   /* bytes later: a loop that writes them takes 64 points at a time, and has many left over */
    for (int i = 0; i < held; ++i) {
        const grey found = grey_level(b->value[i]);
        const int is_settled = (found.distance > 255.0 * b->error[i] + 0x1p-44) | (b->error[i] == 0.0);
        level[i] = (int)found.level;
        settled[i] = is_settled | (i < passed) | (i >= count);
        some += !settled[i];
    }
    for (int i = passed; i < count; ++i)
        out[forth * i] = (unsigned char)level[i];
    if (some == 0)
        return 0;
    ptrdiff_t listed = 0;
    for (int i = passed; i < count; ++i)
        if (!settled[i])
            unsettled[listed++] = first + forth * i;
    return listed;
}

double centred_sphere_certified_uint8_bound(
    const symrender_grid *grid, const centred_sphere_certified_uint8_scene *scene)
{
    const frame f = frame_of(scene);
    const double half = 0.5 * grid->pixel * f.plane_unit;
    return bounds_within(scene, &f, half * grid->width, half * grid->height).value;
}

/* Rows [row_begin, row_end), and where `twins` is not 0 those at -y with them: what does not change with the sign of y
 * is computed once for both. */
static ptrdiff_t settle_rows(unsigned char *image, ptrdiff_t stride, const symrender_grid *grid,
    const centred_sphere_certified_uint8_scene *scene,
    int row_begin, int row_end, int twins, ptrdiff_t *unsettled)
{
    if (row_begin >= row_end)
        return 0;
    const frame f = frame_of(scene);
    const double unit = f.plane_unit;
    const double pixel = grid->pixel, step = pixel * unit;
    const double left = 0.5 - 0.5 * grid->width, top = 0.5 * grid->height - 0.5;
    const int width = grid->width, height = grid->height;
    const bounds b = bounds_within(scene, &f, 0.5 * width * step, 0.5 * grid->height * step);
    const unsigned char background = (unsigned char)grey_level(scene->background).level;
    ptrdiff_t found = 0;
    block values SYMRENDER_ALIGNED;
    row next = row_of((top - row_begin) * pixel * unit, &f);

    for (int j = row_begin; j < row_end; ++j) {
        const int rows = twins && 2 * j + 1 != height ? 2 : 1, row_number[2] = {j, height - 1 - j};
        const double plane_y = (top - j) * pixel;
        const row r = next;
        next = row_of((top - (j + 1)) * pixel * unit, &f);   /* begun here, it is ready when this row is done */
        const row r_of[2] = {r, rows == 2 ? row_of(-plane_y * unit, &f) : r};

        /* the hits of a row are one span of pixels, as many left of its middle as right of it; the right end is in
         * closed form and settled by an exact test */
        int last = span_between(0.0, r.x_right.hi / step - left, width).last;
        while (last < width - 1 && is_hit(last + 1 + left, plane_y, &r, &f, pixel, step, scene))
            ++last;
        while (last >= width / 2 && !is_hit(last + left, plane_y, &r, &f, pixel, step, scene))
            --last;

        const int end = last >= width / 2 ? last + 1 : width;
        const int begin = last >= width / 2 ? width - end : width;
        for (int k = 0; k < rows; ++k) {
            unsigned char *restrict out = image + row_number[k] * stride;
            for (int i = 0; i < begin; ++i)
                out[i] = background;
            for (int i = end; i < width; ++i)
                out[i] = background;
        }
        /* the right half of the span, and pixel by pixel its mirror image */
        for (int at = begin < end ? width / 2 : end, count; at < end; at += count) {
            count = end - at < POINTS ? end - at : POINTS;
            const int vectors = whole_vectors(count);
            const int middle = 2 * at + 1 == width;   /* it is its own mirror image */
            const int mirrored = width - 1 - at;
            for (int i = 0; i < vectors; ++i)
                stage_1((at + i + left) * step, &r, &f, &values, i);
            for (int k = 0; k < rows; ++k) {
                unsigned char *restrict out = image + row_number[k] * stride;
                const ptrdiff_t first = (ptrdiff_t)row_number[k] * width;
                for (int i = 0; i < vectors; ++i)
                    stage_2(&r_of[k], &f, &values, i);
                finish(1.0, vectors, &r_of[k], &f, &values);
                judge(&values, vectors, &b);
                found += settle(&values, vectors, 0, count, out + at, 1, first + at,
                    unsettled + found);
                finish(-1.0, vectors, &r_of[k], &f, &values);
                judge(&values, vectors, &b);
                found += settle(&values, vectors, middle, count, out + mirrored, -1, first + mirrored,
                    unsettled + found);
            }
        }
    }
    return found;
}

ptrdiff_t centred_sphere_certified_uint8_rows(
    unsigned char *image, ptrdiff_t stride, const symrender_grid *grid,
    const centred_sphere_certified_uint8_scene *scene,
    int row_begin, int row_end, ptrdiff_t *unsettled)
{
    /* rows [first, last) have their twins among them */
    const int height = grid->height, first = row_begin > height - row_end ? row_begin : height - row_end;
    const int last = height - first;

    ptrdiff_t found = settle_rows(
        image, stride, grid, scene, row_begin, first < last ? first : row_end, 0, unsettled);
    found += settle_rows(
        image, stride, grid, scene, first, first < last ? height - height / 2 : first, 1, unsettled + found);
    found += settle_rows(
        image, stride, grid, scene, first < last ? last : row_end, row_end, 0, unsettled + found);
    return found;
}

ptrdiff_t centred_sphere_certified_uint8_row_pairs(
    unsigned char *image, ptrdiff_t stride, const symrender_grid *grid,
    const centred_sphere_certified_uint8_scene *scene,
    int row_begin, int row_end, ptrdiff_t *unsettled)
{
    return settle_rows(image, stride, grid, scene, row_begin, row_end, 1, unsettled);
}

/* The larger of the two distances from an axis. */
static inline double farther(double a, double b)
{
    return fabs(a) > fabs(b) ? fabs(a) : fabs(b);
}

ptrdiff_t centred_sphere_certified_uint8_box(
    unsigned char *image, ptrdiff_t stride, const symrender_box *box,
    const centred_sphere_certified_uint8_scene *scene,
    int row_begin, int row_end, ptrdiff_t *unsettled)
{
    const symrender_grid *grid = &box->grid;
    const int begin = box->column_begin, end = box->column_end, width = grid->width;
    const int first = row_begin > box->row_begin ? row_begin : box->row_begin;
    const int last = row_end < box->row_end ? row_end : box->row_end;
    if (begin >= end || first >= last)
        return 0;

    const frame f = frame_of(scene);
    const double unit = f.plane_unit;
    const double pixel = grid->pixel, step = pixel * unit;
    const double left = 0.5 - 0.5 * width, top = 0.5 * grid->height - 0.5;
    const bounds b = bounds_within(scene, &f, farther((begin + left) * step, (end - 1 + left) * step),
        farther((top - box->row_begin) * step, (top - (box->row_end - 1)) * step));
    ptrdiff_t found = 0;
    block values SYMRENDER_ALIGNED;

    for (int j = first; j < last; ++j) {
        unsigned char *restrict out = image + j * stride;
        const row r = row_of((top - j) * pixel * unit, &f);
        for (int at = begin, count; at < end; at += count) {
            count = end - at < POINTS ? end - at : POINTS;
            const int vectors = whole_vectors(count);
            for (int i = 0; i < vectors; ++i)
                stage_1((at + i + left) * step, &r, &f, &values, i);
            for (int i = 0; i < vectors; ++i)
                stage_2(&r, &f, &values, i);
            finish(1.0, vectors, &r, &f, &values);
            judge(&values, vectors, &b);
            clear_misses(&values, vectors, scene->background);
            found += settle(&values, vectors, 0, count, out + at, 1, (ptrdiff_t)j * width + at,
                unsettled + found);
        }
    }
    return found;
}

/* The bounds for points of the image plane. */
static bounds bounds_at(const centred_sphere_certified_uint8_scene *scene, const frame *f,
    const double *x, const double *y, ptrdiff_t count)
{
    const double unit = f->plane_unit;
    double x_most = 0.0, y_most = 0.0;
    for (ptrdiff_t i = 0; i < count; ++i) {
        x_most = fabs(x[i] * unit) > x_most ? fabs(x[i] * unit) : x_most;
        y_most = fabs(y[i] * unit) > y_most ? fabs(y[i] * unit) : y_most;
    }
    return bounds_within(scene, f, x_most, y_most);
}

/* A block of points, whose rays may miss. */
SYMRENDER_INLINE void shade_block(block *found, const double *restrict block_x, const double *restrict block_y,
    int length, const frame *f, const bounds *limits, double background)
{
    const double unit = f->plane_unit;
    for (int i = 0; i < length; ++i) {
        const row r = row_of(block_y[i] * unit, f);
        stage_1(block_x[i] * unit, &r, f, found, i);
    }
    for (int i = 0; i < length; ++i) {
        const row r = row_of(block_y[i] * unit, f);
        stage_2(&r, f, found, i);
    }
    for (int i = 0; i < length; ++i) {
        const row r = row_of(block_y[i] * unit, f);
        stage_3(1.0, &r, f, found, i);
    }
    if (f->half_exponent > 0) {
        whole_powers_of_square(found->cos2, found->highlight, f->half_exponent, length);
    } else {
        for (int i = 0; i < length; ++i)
            stage_4(f, found, i);
    }
    for (int i = 0; i < length; ++i)
        stage_5(f, found, i);
    judge(found, length, limits);
    clear_misses(found, length, background);
}

ptrdiff_t centred_sphere_certified_uint8_points(
    unsigned char *values, const double *x, const double *y, ptrdiff_t count, double white,
    const centred_sphere_certified_uint8_scene *scene, ptrdiff_t *unsettled)
{
    const frame f = frame_of(scene);
    const bounds b = bounds_at(scene, &f, x, y, count);
    (void)white;
    ptrdiff_t found = 0;
    for (ptrdiff_t at = 0; at < count; at += POINTS) {
        const int length = count - at < POINTS ? (int)(count - at) : POINTS;
        block values_here SYMRENDER_ALIGNED;
        shade_block(&values_here, x + at, y + at, length, &f, &b, scene->background);
        found += settle(&values_here, length, 0, length, values + at, 1, at, unsettled + found);
    }
    return found;
}

void centred_sphere_certified_uint8_enclose(
    double *hi, double *lo, double *error, const double *x, const double *y, ptrdiff_t count,
    const centred_sphere_certified_uint8_scene *scene)
{
    const frame f = frame_of(scene);
    const bounds b = bounds_at(scene, &f, x, y, count);
    for (ptrdiff_t at = 0; at < count; at += POINTS) {
        const int length = count - at < POINTS ? (int)(count - at) : POINTS;
        block values_here SYMRENDER_ALIGNED;
        shade_block(&values_here, x + at, y + at, length, &f, &b, scene->background);
        for (int i = 0; i < length; ++i) {
            hi[at + i] = values_here.value[i];
            lo[at + i] = 0.0;
            error[at + i] = values_here.error[i];
        }
    }
}

ptrdiff_t centred_sphere_certified_uint8_batch(
    unsigned char *images, ptrdiff_t image_stride, ptrdiff_t stride,
    const symrender_grid *grids, const centred_sphere_certified_uint8_scene *scenes,
    ptrdiff_t row_begin, ptrdiff_t row_end, ptrdiff_t *unsettled)
{
    const ptrdiff_t height = grids->height, pixels = height * grids->width;
    ptrdiff_t found = 0;

    for (ptrdiff_t k = row_begin / height; k * height < row_end; ++k) {
        const ptrdiff_t top = k * height;
        const int begin = row_begin > top ? (int)(row_begin - top) : 0;
        const int end = row_end - top < height ? (int)(row_end - top) : (int)height;
        const ptrdiff_t listed = centred_sphere_certified_uint8_rows(
            images + k * image_stride, stride, &grids[k], &scenes[k], begin, end, unsettled + found);
        for (ptrdiff_t i = 0; i < listed; ++i)
            unsettled[found + i] += k * pixels;
        found += listed;
    }
    return found;
}

ptrdiff_t centred_sphere_certified_uint8_boxes(
    unsigned char *images, ptrdiff_t image_stride, ptrdiff_t stride,
    const symrender_box *boxes, const centred_sphere_certified_uint8_scene *scenes,
    ptrdiff_t row_begin, ptrdiff_t row_end, ptrdiff_t *unsettled)
{
    const ptrdiff_t height = boxes->grid.height, pixels = height * boxes->grid.width;
    ptrdiff_t found = 0;

    for (ptrdiff_t k = row_begin / height; k * height < row_end; ++k) {
        const ptrdiff_t top = k * height;
        const int begin = row_begin > top ? (int)(row_begin - top) : 0;
        const int end = row_end - top < height ? (int)(row_end - top) : (int)height;
        const ptrdiff_t listed = centred_sphere_certified_uint8_box(
            images + k * image_stride, stride, &boxes[k], &scenes[k], begin, end, unsettled + found);
        for (ptrdiff_t i = 0; i < listed; ++i)
            unsettled[found + i] += k * pixels;
        found += listed;
    }
    return found;
}
