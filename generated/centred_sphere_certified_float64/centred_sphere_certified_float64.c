/* centred_sphere_certified_float64: one Phong sphere, one point light
 * Accuracy "certified_float64" (symrender_cg 0.1.0)
 * Generated from the formula; do not edit. Regenerate with:
 *     python -m symrender_cg build chapter1 --accuracy certified
 *
 * promise  the float64 nearest to the true value; pixels whose own bound does not show that are reported
 * in       diffuse term
 *          specular term
 * out      sphere off the axis: the centre is the point looked at: disc depends on x^2 + y^2 alone
 *          sphere at the plane of the eye: the sphere lies wholly before the eye: depth of its centre 4 > R 1
 *          gated specular: the material asks for the specular term as Phong wrote it, not gated by n.l > 0
 *          shadow of the sphere on itself: a sphere is convex: where n.l > 0 the way to the light leaves it; where
 *          not, diffuse is 0
 *          numbers above are those of the scene it was written for; any scene with the same effects may call it
 * ops      once: frame 1 sqrt 1 max 1 select 33 call
 *          a row: 6 call
 *          a pixel: 2 add 64 call
 */
#include "centred_sphere_certified_float64.h"

#include "inline.h"
#include "span.h"
#include "units.h"
#include "double_double.h"
#include "pair.h"
#include "precise_power.h"
#include "exact_sign.h"
#include "range.h"
#include "settle.h"
#include <math.h>

enum { POINTS = 128 };   /* points shaded in one go, before the few doubtful ones among them are settled */

/* What does not change within a frame. */
typedef struct {
    double plane_unit, focal, extent_x, extent_y, zero_power, k_ambient, shininess;
    double_double lamp_x, lamp_y, lamp_z, alpha, rho2, depth, d_dot_d_frame, along_frame, diffuse_gain, specular_gain;
} frame;

static frame frame_of(const centred_sphere_certified_float64_scene *scene)
{
    /* units of length, powers of two [5 call] */
    const int plane_exponent = unit_exponent(scene->eye);   /* f = e 2^k in [1, 2) */
    const double plane_unit = ldexp(1, plane_exponent);
    const int world_exponent = unit_exponent(scene->radius);   /* R 2^k in [1, 2) */
    const double eye = ldexp(scene->eye, world_exponent);
    const double radius = ldexp(scene->radius, world_exponent);

    /* light [13 call] */
    const double_double from_center_x = dd_from(scene->light_x);   /* L - C */
    const double_double from_center_y = dd_from(scene->light_y);
    const double_double from_center_z = dd_from(scene->light_z);
    /* farther than 2^200 R a light shines in parallel */
    const int lamp_exponent = light_exponent(world_exponent, scene->radius, from_center_x.hi, from_center_y.hi,
        from_center_z.hi, 200);
    const double_double lamp_x = dd_div(dd_ldexp(from_center_x, lamp_exponent), dd_from(radius));   /* (L - C) / R */
    const double_double lamp_y = dd_div(dd_ldexp(from_center_y, lamp_exponent), dd_from(radius));
    const double_double lamp_z = dd_div(dd_ldexp(from_center_z, lamp_exponent), dd_from(radius));

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
    const double share_1 = sqrt(rho2.hi > 0.0 ? rho2.hi : 0.0);
    const double extent_x = share_1;   /* no hit is farther from the axis, to the side or up */
    const double extent_y = share_1;

    /* ray and sphere [1 call] */
    const double_double d_dot_d_frame = dd_product(focal, focal);   /* what is the same for a frame in d_dot_d */

    /* normal [1 call] */
    const double_double along_frame = dd_mul_double(depth, focal);   /* what is the same for a frame in along */

    /* diffuse [1 call] */
    const double_double diffuse_gain = dd_product(scene->k_diffuse, scene->light_intensity);   /* I_L k_d */

    /* specular [1 select 1 call] */
    const double zero_power = scene->shininess == 0.0 ? 1.0 : 0.0;   /* 0^n: 1 for n = 0 */
    const double_double specular_gain = dd_product(scene->k_specular, scene->light_intensity);   /* I_L k_s */

    const frame f = {
        .plane_unit = plane_unit,
        .lamp_x = lamp_x,
        .lamp_y = lamp_y,
        .lamp_z = lamp_z,
        .alpha = alpha,
        .focal = focal,
        .rho2 = rho2,
        .depth = depth,
        .extent_x = extent_x,
        .extent_y = extent_y,
        .d_dot_d_frame = d_dot_d_frame,
        .along_frame = along_frame,
        .diffuse_gain = diffuse_gain,
        .zero_power = zero_power,
        .specular_gain = specular_gain,
        .k_ambient = scene->k_ambient,
        .shininess = scene->shininess,
    };
    return f;
}

/* What does not change within a row. */
typedef struct {
    double y;
    double_double x_left, x_right, s_row;
} row;

SYMRENDER_INLINE row row_of(double y, const frame *f)
{
    /* silhouette [5 call] */
    /* the row's hits are -reach <= x <= reach */
    const double_double reach = dd_sqrt(dd_positive_part(dd_sub(f->rho2, dd_product(y, y))));
    const double_double x_left = dd_neg(reach);
    const double_double x_right = reach;

    /* ray and sphere [1 call] */
    const double_double s_row = dd_product(y, y);   /* what is the same for a row in s */

    const row r = {
        .y = y, .x_left = x_left, .x_right = x_right, .s_row = s_row,
    };
    return r;
}

/* Does the ray through (x, y) hit? Settled without rounding, as the sign of a polynomial in the inputs. */
static int hits_exactly(double x, double y, const centred_sphere_certified_float64_scene *scene)
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

/* Does the ray through the centre of a pixel of this row hit? The pixel is column pixels to the right of the axis. */
static int is_hit(double column, double plane_y, const row *r, const frame *f, double pixel, double step,
    const centred_sphere_certified_float64_scene *scene)
{
    const double x = column * step;

    /* ray and sphere [8 call] */
    /* distance to the two ends of the span, not negative inside it */
    const double_double from_left = dd_sub(dd_from(x), r->x_left);
    const double_double to_right = dd_add_double(r->x_right, -x);
    const double_double chord = pair_mul(from_left, to_right);
    /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
    const double_double facing2 = pair_mul(f->alpha, chord);
    const double_double s = pair_add(dd_product(x, x), r->s_row);   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const double_double d_dot_d = pair_add(s, f->d_dot_d_frame);

    return certainty(facing2.hi, d_dot_d.hi) > 0.0 ? facing2.hi > 0.0 : hits_exactly(column * pixel, plane_y, scene);
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
    const centred_sphere_certified_float64_scene *scene, double x_most, double y_most)
{
    const range x = range_between(-x_most, x_most), y = range_between(-y_most, y_most);
    const double least_cos2 = scene->shininess < 2.0 ? 0x1p-20 : 0.0;

    /* units of length, powers of two [4 call] */
    const int plane_exponent = unit_exponent(scene->eye);
    const int world_exponent = unit_exponent(scene->radius);
    const double eye = ldexp(scene->eye, world_exponent);
    const double radius = ldexp(scene->radius, world_exponent);

    /* light [20 call] */
    const double_double from_center_x = dd_from(scene->light_x);
    const double_double from_center_y = dd_from(scene->light_y);
    const double_double from_center_z = dd_from(scene->light_z);
    const int lamp_exponent = light_exponent(world_exponent, scene->radius, from_center_x.hi, from_center_y.hi,
        from_center_z.hi, 200);
    const range lamp_x = range_blurred(range_quotient(DOUBLE_DOUBLE,
        range_ldexp(range_known_wide(from_center_x), lamp_exponent), range_exact(radius)), 0x1p-195);
    const range lamp_y = range_blurred(range_quotient(DOUBLE_DOUBLE,
        range_ldexp(range_known_wide(from_center_y), lamp_exponent), range_exact(radius)), 0x1p-195);
    const range lamp_z = range_blurred(range_quotient(DOUBLE_DOUBLE,
        range_ldexp(range_known_wide(from_center_z), lamp_exponent), range_exact(radius)), 0x1p-195);
    const double light_gap2 = range_light_gap2(lamp_x, lamp_y, lamp_z);   /* the least |w|^2: (|lamp| - 1)^2 */

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
    const range from_left = range_within(range_difference(DOUBLE_DOUBLE, x, x_left), 0.0, INFINITY);
    const range to_right = range_within(range_sum(DOUBLE_DOUBLE, x_right, range_neg(x)), 0.0, INFINITY);
    const range chord = range_product(PAIR, from_left, to_right);
    const range s_row = range_square(DOUBLE_DOUBLE, y);
    const range s = range_sum(PAIR, range_square(DOUBLE_DOUBLE, x), s_row);
    const range d_dot_d_frame = range_square(DOUBLE_DOUBLE, range_exact(focal));
    const range d_dot_d = range_sum(PAIR, s, d_dot_d_frame);
    const double farthest2 = range_size(d_dot_d);   /* the largest |D|^2 */
    const range facing2 = range_within(range_product(PAIR, alpha, chord), SURE_HIT, farthest2);
    const range facing = range_root(PAIR, range_positive_part(facing2));

    /* normal [15 call] */
    const range inv_d2 = range_inverse(PAIR, d_dot_d);
    const range along_frame = range_product(DOUBLE_DOUBLE, depth, range_exact(focal));
    const range along = range_product(PAIR, inv_d2, range_difference(PAIR, along_frame, facing));
    const range n_x = range_within(range_product(PAIR, along, x), -1.0, 1.0);
    const range n_y = range_within(range_product(PAIR, along, y), -1.0, 1.0);
    const range n_z = range_within(range_product(PAIR,
        range_sum(PAIR, range_product(PAIR, s, depth), range_product(PAIR, facing, range_exact(focal))), inv_d2),
        -1.0, 1.0);

    /* light [18 call] */
    const range w_x = range_difference(PAIR, lamp_x, n_x);
    const range w_y = range_difference(PAIR, lamp_y, n_y);
    const range w_z = range_difference(PAIR, lamp_z, n_z);
    const range w2 = range_within(range_sum(PAIR, range_sum(PAIR, range_square(PAIR, w_x), range_square(PAIR, w_y)),
        range_square(PAIR, w_z)), light_gap2, INFINITY);
    const range inv_w2 = range_inverse(PAIR, w2);
    const range n_dot_l = range_within(range_product(PAIR,
        range_sum(PAIR, range_sum(PAIR, range_product(PAIR, n_x, w_x), range_product(PAIR, n_y, w_y)),
        range_product(PAIR, n_z, w_z)), range_root(PAIR, inv_w2)), -1.0, 1.0);

    /* diffuse [5 call] */
    const range diffuse_gain = range_product(DOUBLE_DOUBLE, range_exact(scene->k_diffuse),
        range_exact(scene->light_intensity));
    const range diffuse = range_product(PAIR, range_positive_part(n_dot_l), diffuse_gain);

    /* specular [1 select 30 call] */
    const range bounce = range_scaled(facing, 2.0);
    const range mirror_x = range_sum(PAIR, range_product(PAIR, n_x, bounce), x);
    const range mirror_y = range_sum(PAIR, range_product(PAIR, n_y, bounce), y);
    const range mirror_z = range_sum(PAIR, range_product(PAIR, n_z, bounce), range_neg(range_exact(focal)));
    const range w_dot_mirror = range_sum(PAIR,
        range_sum(PAIR, range_product(PAIR, w_x, mirror_x), range_product(PAIR, w_y, mirror_y)),
        range_product(PAIR, w_z, mirror_z));
    const range inv_w2_d2 = range_product(PAIR, inv_d2, inv_w2);
    const range cos2 = range_within(range_product(PAIR, range_square(PAIR, w_dot_mirror), inv_w2_d2), least_cos2, 1.0);
    const range sin2 = range_within(range_sum(PAIR, range_neg(cos2), range_exact(1.0)), 0.0, 1.0);
    const range highlight = range_power_of_cosine(PAIR, cos2, sin2, range_exact(scene->shininess),
        PRECISE_POWER_ERROR, PRECISE_POWER_FLOOR);
    const double zero_power = scene->shininess == 0.0 ? 1.0 : 0.0;
    const range specular_gain = range_product(DOUBLE_DOUBLE, range_exact(scene->k_specular),
        range_exact(scene->light_intensity));
    const range specular = range_product(PAIR, range_either(highlight, range_exact(zero_power)), specular_gain);

    /* intensity [5 call] */
    const range lit = range_sum(PAIR, diffuse, specular);
    const range value = range_sum(PAIR, range_either(lit, range_exact(0.0)), range_exact(scene->k_ambient));

    bounds b = {.value = range_error(value)};
    b.unlit = -range_error(range_high(n_dot_l));
    const double lobe = range_error(range_high(w_dot_mirror));
    const int is_steep = scene->shininess > 0.0 && scene->shininess < 2.0;
    b.no_lobe = scene->shininess > 0.0 ? -lobe : -(double)INFINITY;
    b.lobe_from = is_steep ? -lobe : (double)INFINITY;
    b.lobe_to = 0x1p-10 * sqrt(range_size(w2) * farthest2) + lobe;
    return b;
}

/* The bounds of a frame where no hit is farther from the axis than these, in the unit of the image plane. */
static bounds bounds_within(
    const centred_sphere_certified_float64_scene *scene, const frame *f, double x_most, double y_most)
{
    const double x_extent = f->extent_x * (1.0 + 0x1p-20), y_extent = f->extent_y * (1.0 + 0x1p-20);
    return bounds_of(scene, x_most < x_extent ? x_most : x_extent, y_most < y_extent ? y_most : y_extent);
}

/* ---- shading ---- */

/* The intensity along a ray that hits, and a bound of its error: 0 where it is exact, INFINITY for an unknown one. */
typedef struct {
    double_double value;
    double error;
    double miss;   /* positive where the ray surely misses */
} sample;

SYMRENDER_INLINE sample shade(double x, const row *r, const frame *f, const bounds *b)
{
    /* ray and sphere [10 call] */
    /* distance to the two ends of the span, not negative inside it */
    const double_double from_left = dd_sub(dd_from(x), r->x_left);
    const double_double to_right = dd_add_double(r->x_right, -x);
    const double_double chord = pair_mul(from_left, to_right);
    /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
    const double_double facing2 = pair_mul(f->alpha, chord);
    const double_double s = pair_add(dd_product(x, x), r->s_row);   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const double_double d_dot_d = pair_add(s, f->d_dot_d_frame);
    /* -n.D, how far the surface faces the ray: root / R */
    const double_double facing = pair_sqrt(pair_positive_part(facing2));

    /* normal [9 call] */
    const double_double inv_d2 = pair_inverse(d_dot_d);
    /* t / R: n = (t x, t y, e (1 - t)) / R */
    const double_double along = pair_mul(inv_d2, pair_sub(f->along_frame, facing));
    const double_double n_x = pair_mul_double(along, x);
    const double_double n_y = pair_mul_double(along, r->y);
    /* a sum, where e (1 - t) would cancel */
    const double_double n_z = pair_mul(pair_add(pair_mul(s, f->depth), pair_mul_double(facing, f->focal)), inv_d2);

    /* light [16 call] */
    const double_double w_x = pair_sub(f->lamp_x, n_x);   /* w = (L - P) / R */
    const double_double w_y = pair_sub(f->lamp_y, n_y);
    const double_double w_z = pair_sub(f->lamp_z, n_z);
    const double_double w2 = pair_add(pair_add(pair_square(w_x), pair_square(w_y)), pair_square(w_z));   /* |w|^2 */
    const double_double inv_w2 = pair_inverse(w2);
    /* n.l = n.w / |w| */
    const double_double n_dot_l = pair_mul(pair_add(pair_add(pair_mul(n_x, w_x), pair_mul(n_y, w_y)),
        pair_mul(n_z, w_z)), pair_sqrt(inv_w2));

    /* diffuse [2 call]. Phong 1975, Illumination for computer generated pictures */
    const double_double diffuse = pair_mul(pair_positive_part(n_dot_l), f->diffuse_gain);   /* k_d max(0, n.l) */

    /* specular [1 add 23 call]. Phong 1975, Illumination for computer generated pictures */
    const double_double bounce = dd_scale(facing, 2.0);
    /* the primary ray mirrored at the surface, D + 2 facing n, as long as D */
    const double_double mirror_x = pair_add_double(pair_mul(n_x, bounce), x);
    const double_double mirror_y = pair_add_double(pair_mul(n_y, bounce), r->y);
    const double_double mirror_z = pair_add_double(pair_mul(n_z, bounce), -f->focal);
    /* r.v = w . mirror / (|w| |D|) */
    const double_double w_dot_mirror = pair_add(pair_add(pair_mul(w_x, mirror_x), pair_mul(w_y, mirror_y)),
        pair_mul(w_z, mirror_z));
    const double_double inv_w2_d2 = pair_mul(inv_d2, inv_w2);
    const double_double cos2 = pair_mul(pair_square(w_dot_mirror), inv_w2_d2);   /* (r.v)^2 */
    /* 1 - (r.v)^2 as a difference: what cancels is paid for */
    const double_double sin2 = pair_add_double(dd_neg(cos2), 1.0);
    /* max(0, r.v)^n where r.v > 0 */
    const double_double highlight = precise_power_of_cosine(pair_normalised(cos2), pair_normalised(sin2), f->shininess);
    /* k_s max(0, r.v)^n */
    const double_double specular = pair_mul(pair_select(w_dot_mirror.hi + w_dot_mirror.lo > 0.0, highlight,
        dd_from(f->zero_power)), f->specular_gain);

    /* intensity [1 add 4 call]. Phong 1975, Illumination for computer generated pictures */
    const double_double lit = pair_add(diffuse, specular);   /* what the light adds; the gains hold its intensity */
    /* I = k_a + what the light adds */
    const double_double value = pair_add_double(pair_select(w2.hi + w2.lo > 0.0, lit, dd_from(0.0)), f->k_ambient);

    /* conditions that are decided */
    const double sure = facing2.hi - SURE_HIT * d_dot_d.hi;
    const int is_clear = (sure > 0.0)
        & ((w_dot_mirror.hi <= b->lobe_from) | (w_dot_mirror.hi >= b->lobe_to));
    /* where it is unlit, the value is the ambient one, exactly */
    const int is_unlit = (n_dot_l.hi < b->unlit) & (w_dot_mirror.hi < b->no_lobe);

    const sample taken = {
        .value = value,
        .error = is_clear ? (is_unlit ? 0.0 : b->value) : (double)INFINITY,
        .miss = -0x1p-40 * d_dot_d.hi - facing2.hi,
    };
    return taken;
}

/* Values of a block of points, up to their bounds. */
typedef struct {
    double value[POINTS];
    double rest[POINTS];    /* the value is value + rest */
    double error[POINTS];
} block;

SYMRENDER_INLINE void keep(block *b, int i, const sample *s)
{
    b->value[i] = s->value.hi;
    b->rest[i] = s->value.lo;
    b->error[i] = s->error;
}

/* The same where the ray may miss: then the value is the background's, exactly. */
SYMRENDER_INLINE void keep_or_miss(block *b, int i, const sample *s, double background)
{
    keep(b, i, s);
    const int is_miss = s->miss > 0.0;
    b->value[i] = is_miss ? background : b->value[i];
    b->rest[i] = is_miss ? 0.0 : b->rest[i];
    b->error[i] = is_miss ? 0.0 : b->error[i];
}

/* Writes the float64 numbers nearest to the true values, as far as the bounds show them to be that, and the
 * numbers, from `first` on, of the points where they do not. Returns how many those are. */
static ptrdiff_t settle(const block *b, int count, double *restrict out, double white,
    ptrdiff_t first, ptrdiff_t *unsettled)
{
    int settled[POINTS], some = 0;
    for (int i = 0; i < count; ++i) {
        const double_double v = dd_sum(b->value[i], b->rest[i]);
        const int is_settled = rounds_to_high(
            v, b->error[i]);
        out[i] = v.hi > white ? white : v.hi;
        settled[i] = is_settled;
        some += !is_settled;
    }
    if (some == 0)
        return 0;
    ptrdiff_t listed = 0;
    for (int i = 0; i < count; ++i)
        if (!settled[i])
            unsettled[listed++] = first + i;
    return listed;
}

double centred_sphere_certified_float64_bound(
    const symrender_grid *grid, const centred_sphere_certified_float64_scene *scene)
{
    const frame f = frame_of(scene);
    const double half = 0.5 * grid->pixel * f.plane_unit;
    return bounds_within(scene, &f, half * grid->width, half * grid->height).value;
}

ptrdiff_t centred_sphere_certified_float64_rows(
    double *image, ptrdiff_t stride, const symrender_grid *grid,
    const centred_sphere_certified_float64_scene *scene,
    int row_begin, int row_end, ptrdiff_t *unsettled)
{
    const frame f = frame_of(scene);
    const double unit = f.plane_unit;
    const double pixel = grid->pixel, step = pixel * unit;
    const double left = 0.5 - 0.5 * grid->width, top = 0.5 * grid->height - 0.5;
    const int width = grid->width;
    const bounds b = bounds_within(scene, &f, 0.5 * width * step, 0.5 * grid->height * step);
    const double background = (double)(scene->background > grid->white ? grid->white : scene->background);
    ptrdiff_t found = 0;

    for (int j = row_begin; j < row_end; ++j) {
        double *restrict out = image + j * stride;
        const double plane_y = (top - j) * pixel;
        const row r = row_of(plane_y * unit, &f);

        /* the hits of a row are one span of pixels, its ends in closed form and settled by an exact test */
        const double left_end = r.x_left.hi / step - left, right_end = r.x_right.hi / step - left;
        pixel_span hits = span_between(left_end, right_end, width);
        while (hits.first > 0 && is_hit(hits.first - 1 + left, plane_y, &r, &f, pixel, step, scene))
            --hits.first;
        while (hits.last < width - 1 && is_hit(hits.last + 1 + left, plane_y, &r, &f, pixel, step, scene))
            ++hits.last;
        while (hits.first <= hits.last && !is_hit(hits.first + left, plane_y, &r, &f, pixel, step, scene))
            ++hits.first;
        while (hits.last >= hits.first && !is_hit(hits.last + left, plane_y, &r, &f, pixel, step, scene))
            --hits.last;

        const int begin = hits.first <= hits.last ? hits.first : width;
        const int end = hits.first <= hits.last ? hits.last + 1 : width;
        for (int i = 0; i < begin; ++i)
            out[i] = background;
        for (int at = begin, count; at < end; at += count) {
            count = end - at < POINTS ? end - at : POINTS;
            block values;
            for (int i = 0; i < count; ++i) {
                const sample s = shade((at + i + left) * step, &r, &f, &b);
                keep(&values, i, &s);
            }
            found += settle(&values, count, out + at, grid->white,
                (ptrdiff_t)j * width + at, unsettled + found);
        }
        for (int i = end; i < width; ++i)
            out[i] = background;
    }
    return found;
}

/* The bounds for points of the image plane. */
static bounds bounds_at(const centred_sphere_certified_float64_scene *scene, const frame *f,
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
SYMRENDER_INLINE void shade_block(block *found, const double *x, const double *y, int count, const frame *f,
    const bounds *b, double background)
{
    const double unit = f->plane_unit;
    for (int i = 0; i < count; ++i) {
        const row r = row_of(y[i] * unit, f);
        const sample s = shade(x[i] * unit, &r, f, b);
        keep_or_miss(found, i, &s, background);
    }
}

ptrdiff_t centred_sphere_certified_float64_points(
    double *values, const double *x, const double *y, ptrdiff_t count, double white,
    const centred_sphere_certified_float64_scene *scene, ptrdiff_t *unsettled)
{
    const frame f = frame_of(scene);
    const bounds b = bounds_at(scene, &f, x, y, count);
    ptrdiff_t found = 0;
    for (ptrdiff_t at = 0; at < count; at += POINTS) {
        const int length = count - at < POINTS ? (int)(count - at) : POINTS;
        block values_here;
        shade_block(&values_here, x + at, y + at, length, &f, &b, scene->background);
        found += settle(&values_here, length, values + at, white, at,
            unsettled + found);
    }
    return found;
}

void centred_sphere_certified_float64_enclose(
    double *hi, double *lo, double *error, const double *x, const double *y, ptrdiff_t count,
    const centred_sphere_certified_float64_scene *scene)
{
    const frame f = frame_of(scene);
    const bounds b = bounds_at(scene, &f, x, y, count);
    for (ptrdiff_t at = 0; at < count; at += POINTS) {
        const int length = count - at < POINTS ? (int)(count - at) : POINTS;
        block values_here;
        shade_block(&values_here, x + at, y + at, length, &f, &b, scene->background);
        for (int i = 0; i < length; ++i) {
            hi[at + i] = values_here.value[i];
            lo[at + i] = values_here.rest[i];
            error[at + i] = values_here.error[i];
        }
    }
}
