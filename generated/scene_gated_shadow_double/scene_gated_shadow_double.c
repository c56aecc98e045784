/* scene_gated_shadow_double: spheres, every number an argument
 * Accuracy "double" (symrender_cg 0.1.0)
 * Generated from the formula; do not edit. Regenerate with:
 *     python -m symrender_cg build shadow --accuracy double
 *
 * promise  at most 1e-15 max(1, value) off where no light is within 1e-3 R of a surface and n <= 1000; another
 *          kernel draws what this one may not; no overflow; hit or miss never wrong
 *          What a ray of the eye hits is exact; the edges of shadows are decided in float64; pixels where rounding
 *          may have decided are listed
 * in       sphere off the axis
 *          diffuse term
 *          specular term
 *          gated specular
 *          lights on surfaces
 *          shadows of spheres
 *          clipping at 1
 * out      sphere at the plane of the eye: 2 visible spheres wholly before the eye
 *          shadow of the sphere on itself: a sphere is convex: where n.l > 0 the way to the light leaves it; where
 *          not, diffuse is 0
 *          spheres behind the eye: no sphere of 2 wholly behind the plane of the eye
 *          spheres outside the window: no window: any point of the image plane may be asked for
 *          hidden spheres: no sphere of 2 wholly hidden
 *          order along the ray: 1 pair of visible spheres disjoint: the smaller power of the eye is in front on
 *          every ray
 *          the plane: the scene has no plane
 *          tiles of the plane: the scene has no plane
 *          shadow of the plane: the scene has no plane
 *          reflections: no surface that is seen mirrors anything
 *          reflections of reflections: 0 of 4 bounces: no longer chain of mirrors that may see one another
 *          lights that fade with distance: every light that lights anything is as strong at every distance
 *          lights from a direction: 0 of 1 light from a direction
 *          background in two colours: the background is 0.0 in every direction
 *          colour: every colour of the scene is grey: one channel
 *          numbers above are those of the scene it was written for; any scene with the same effects may call it
 * ops      span: a frame: 1 mul 1 div 4 call, a sphere: 6 mul 6 add 2 div 1 sqrt 1 max 32 call, a row: 5 mul 2 add
 *            16 call, a pixel: 24 mul 21 add 2 div 2 sqrt 1 max
 *          lamp: a sphere: 3 add 3 div 6 call
 *          reach: a pixel: 6 mul 5 add
 *          matte: a pixel: 4 mul 2 add 1 div 1 sqrt 1 max 1 select
 *          glossy: a pixel: 20 mul 9 add 1 div 1 sqrt 1 max 4 select 2 call
 *          gate: a sphere: 1 mul, a pixel: 5 mul 3 add
 *          shadow: a pixel: 19 mul 15 add 1 select 1 call
 */
#include "scene_gated_shadow_double.h"

#include "inline.h"
#include "span.h"
#include "units.h"
#include "block.h"
#include "lobe_power.h"
#include "double_double.h"
#include "exact_sign.h"
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum {
    CHANNELS = 1,
    POINTS = 128,   /* points shaded together: their arrays stay in the cache nearest to the processor */
    LANES = 8,      /* runs begin at its multiples, and loops end there: nobody reads what lies between two runs */
    ROWS = 8,       /* rows whose spans are worked out side by side */
    LINE = 64       /* bytes of a line of the cache: a vector that straddles two takes twice as long */
};

typedef scene_gated_shadow_double_scene scene_type;
typedef scene_gated_shadow_double_frame frame;
typedef scene_gated_shadow_double_layers layer_set;

static inline int padded(int count)
{
    return (count + LANES - 1) & ~(LANES - 1);
}

static void *array(size_t count, size_t size)
{
    return calloc(count ? count : 1, size);
}

/* A run: neighbouring points of one receiver of light. */
typedef struct {
    int receiver, at, count;   /* points at <= i < at + count */
    int place;                 /* pixel of the first of them, or its number among the points asked for */
    int lamp, terms;           /* the lamp that lights it now, and which terms it adds */
} run;

/* Points that are shaded together, whatever they belong to. */
typedef struct {
    SYMRENDER_ALIGNED double value[CHANNELS][POINTS];
    double n_x[POINTS], n_y[POINTS], n_z[POINTS];   /* outward normal */
    double mirror_x[POINTS], mirror_y[POINTS], mirror_z[POINTS];   /* the ray mirrored there */
    double inv_d2[POINTS];   /* one over its length squared */
    double w_x[POINTS], w_y[POINTS], w_z[POINTS], w2[POINTS];   /* to the lamp, and its length squared */
    double light[POINTS];   /* how much of the lamp's light arrives */
    double cosine[POINTS];   /* max(0, n.l) */
    double lobe[POINTS], shininess[POINTS];   /* max(0, r.v)^n, and n */
    /* from one loop of a highlight to the next */
    double w_dot_mirror[POINTS], cos2[POINTS], sin2[POINTS], highlight_log2[POINTS], highlight[POINTS];
    double margin[POINTS];    /* by how much the closest of its decisions is sure; in doubt where it is not positive */
    double error[POINTS];     /* what rounding may have done to the value, in units of 2^-53 */
    double ordinal[POINTS];   /* 0, 1, 2, ...: to count in vectors of the same length as all others */
    int count, runs;
    run run[POINTS];
} points;

/* Rounding moves a point that the eye sees by far less than this, in the unit of its receiver. */
static const double GRAIN = 0x1p-44;

/* Units of 2^-53 that an intensity of at most 1 may be off: below 1e-15. */
static const double MOST_ROUNDOFFS = 9.1;

static inline double least(double a, double b)
{
    return a < b ? a : b;
}

/* ---- spheres before the eye: their pixels in a row are one span ---- */

/* What does not change within a frame. */
typedef struct {
    double plane_unit, focal, d_dot_d_frame, tilt_frame, eye;
    double_double focal2;
} span_frame;

static span_frame span_frame_of(const scene_type *scene)
{
    /* units of length, powers of two [2 call] */
    const int plane_exponent = unit_exponent(scene->eye);   /* f = e 2^k in [1, 2) */
    const double plane_unit = ldexp(1, plane_exponent);

    /* silhouette [2 call] */
    /* rays D = (x, y, -f): f is e, in the unit of the image plane */
    const double focal = ldexp(scene->eye, plane_exponent);
    const double_double focal2 = dd_product(focal, focal);

    /* ray and sphere [1 mul] */
    const double d_dot_d_frame = focal * focal;   /* what is the same for a frame in d_dot_d */

    /* normal [1 div] */
    const double tilt_frame = 1.0 / focal;   /* what is the same for a frame in tilt */

    const span_frame carried = {
        .plane_unit = plane_unit,
        .focal = focal,
        .focal2 = focal2,
        .d_dot_d_frame = d_dot_d_frame,
        .tilt_frame = tilt_frame,
        .eye = scene->eye,
    };
    return carried;
}

/* What does not change within a sphere. */
typedef struct {
    double_double offset_y, alpha, depth, offset_x, row_mid_sphere, row_gap_sphere, row_half_sphere, x_left_sphere,
        image_x, image_y, power;
    double row_low, row_high, ahead_sphere;
} span_sphere;

static span_sphere span_sphere_of(const scene_type *scene, int k, const span_frame *f)
{
    /* units of length, powers of two [6 call] */
    const int world_exponent = unit_exponent(scene->radius[k]);   /* R 2^k in [1, 2) */
    const double eye = ldexp(f->eye, world_exponent);
    const double radius = ldexp(scene->radius[k], world_exponent);
    const double center_x = ldexp(scene->center_x[k], world_exponent);
    const double center_y = ldexp(scene->center_y[k], world_exponent);
    const double center_z = ldexp(scene->center_z[k], world_exponent);

    /* silhouette [5 mul 6 add 2 div 1 sqrt 1 max 26 call] */
    const double_double distance = dd_difference(eye, center_z);   /* of the eye from the plane of the centre */
    const double_double offset_y = dd_div(dd_from(center_y), dd_from(radius));
    /* disc / R^2 is -alpha x^2 + ... along a row; alpha = kappa^2 - 1 + offset_y^2 > 0 */
    const double_double alpha = dd_add(dd_div(dd_mul(dd_add_double(distance, -radius),
        dd_add_double(distance, radius)), dd_product(radius, radius)), dd_mul(offset_y, offset_y));
    const double_double depth = dd_div(distance, dd_from(radius));   /* kappa: the same in radii */
    const double_double offset_x = dd_div(dd_from(center_x), dd_from(radius));
    /* what is the same for a sphere in row_mid */
    const double_double row_mid_sphere = dd_mul_double(depth, f->focal);
    const double_double share_5 = dd_mul_double(offset_y, f->focal);
    const double_double row_gap_sphere = dd_neg(share_5);   /* what is the same for a sphere in row_gap */
    const double_double share_6 = dd_add(alpha, dd_mul(offset_x, offset_x));
    const double_double row_half_sphere = share_6;   /* what is the same for a sphere in row_half */
    const double_double x_left_sphere = dd_div(dd_from(1.0), alpha);   /* what is the same for a sphere in x_left */
    /* where the centre appears on the image plane */
    const double_double image_x = dd_div(dd_mul_double(offset_x, f->focal), depth);
    const double_double image_y = dd_div(share_5, depth);
    /* kappa^2 - 1 */
    const double height2 = (distance.hi - radius + distance.lo) * (radius + distance.hi + distance.lo)
        / (radius * radius);
    const double share_1 = offset_y.hi * depth.hi;
    const double share_2 = sqrt(alpha.hi > 0.0 ? alpha.hi : 0.0);
    const double share_3 = f->focal / height2;
    const double row_low = (share_1 - share_2) * share_3;   /* the rows that meet the silhouette: row_disc = 0 */
    const double row_high = (share_1 + share_2) * share_3;

    /* distance [1 mul] */
    const double_double power = share_6;   /* |m|^2 - 1: the power of the eye in radii, squared */
    const double ahead_sphere = f->focal * depth.hi;   /* what is the same for a sphere in ahead */

    const span_sphere carried = {
        .offset_y = offset_y,
        .alpha = alpha,
        .depth = depth,
        .offset_x = offset_x,
        .row_mid_sphere = row_mid_sphere,
        .row_gap_sphere = row_gap_sphere,
        .row_half_sphere = row_half_sphere,
        .x_left_sphere = x_left_sphere,
        .image_x = image_x,
        .image_y = image_y,
        .row_low = row_low,
        .row_high = row_high,
        .power = power,
        .ahead_sphere = ahead_sphere,
    };
    return carried;
}

/* Where a row's hits begin and end. */
typedef struct {
    double_double x_left, x_right;
} span_ends;

SYMRENDER_INLINE span_ends span_ends_of(double y, const span_sphere *ball, const span_frame *f)
{
    /* silhouette [16 call] */
    /* alpha times the span's middle */
    const double_double row_mid = dd_mul(ball->offset_x,
        dd_add(dd_mul_double(ball->offset_y, y), ball->row_mid_sphere));
    /* by how much the row misses the centre */
    const double_double row_gap = dd_add(dd_mul_double(ball->depth, y), ball->row_gap_sphere);
    /* positive where the plane through eye and row cuts the sphere */
    const double_double row_disc = dd_sub(dd_add(dd_product(y, y), f->focal2), dd_mul(row_gap, row_gap));
    /* alpha times half the span's length */
    const double_double row_half = dd_sqrt(dd_positive_part(dd_mul(row_disc, ball->row_half_sphere)));
    /* the row's hits are x_left <= x <= x_right */
    const double_double x_left = dd_mul(dd_sub(row_mid, row_half), ball->x_left_sphere);
    const double_double x_right = dd_mul(dd_add(row_mid, row_half), ball->x_left_sphere);

    const span_ends ends = {x_left, x_right};
    return ends;
}

/* What does not change within a row. */
typedef struct {
    double y, y2, tilt_row, n_y_row, n_z_row, ahead_row;
    double_double x_left, x_right;
} span_row;

SYMRENDER_INLINE span_row span_row_of(double y, span_ends ends, const span_sphere *ball, const span_frame *f)
{
    /* ray and sphere [1 mul] */
    const double y2 = y * y;

    /* normal [3 mul 2 add] */
    const double dy = y - ball->image_y.hi - ball->image_y.lo;
    const double tilt_row = ball->image_x.hi * dy;   /* what is the same for a row in tilt */
    const double n_y_row = f->focal * dy;   /* what is the same for a row in n_y */
    const double n_z_row = y * dy;   /* what is the same for a row in n_z */

    /* distance [1 mul] */
    const double ahead_row = y * ball->offset_y.hi;   /* what is the same for a row in ahead */

    const span_row carried = {
        .y = y,
        .x_left = ends.x_left,
        .x_right = ends.x_right,
        .y2 = y2,
        .tilt_row = tilt_row,
        .n_y_row = n_y_row,
        .n_z_row = n_z_row,
        .ahead_row = ahead_row,
    };
    return carried;
}

/* The distance of the hit from the eye, in radii. */
static inline double span_distance(double x, const span_row *r, const span_sphere *ball, const span_frame *f)
{
    /* ray and sphere [3 mul 6 add 1 sqrt 1 max] */
    /* distance to the two ends of the span, not negative inside it */
    const double from_left = x - r->x_left.hi - r->x_left.lo;
    const double to_right = r->x_right.hi - x + r->x_right.lo;
    const double chord = from_left * to_right;
    /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
    const double facing2 = ball->alpha.hi * chord;
    const double s = x * x + r->y2;   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const double d_dot_d = s + f->d_dot_d_frame;
    const double facing = sqrt(facing2 > 0.0 ? facing2 : 0.0);   /* -n.D, how far the surface faces the ray: root / R */

    /* distance [2 mul 3 add 1 div 1 sqrt]. t_1 t_2 = (|m|^2 - R^2) / |D|^2 (Vieta) */
    const double ahead = x * ball->offset_x.hi + ball->ahead_sphere + r->ahead_row;   /* m.D */
    /* |P - E| in radii: the nearer root as a quotient, free of cancellation */
    const double hit_distance = sqrt(d_dot_d) * ball->power.hi / (facing + ahead);

    return hit_distance;
}

/* Does the ray through (x, y) hit sphere k? Settled without rounding, as the sign of a polynomial in the inputs. */
static int span_hits_exactly(double x, double y, const scene_type *scene, int k)
{
    exact_sum sum;
    exact_sum_clear(&sum);   /* disc */
    exact_sum_add_product(&sum, -1, scene->center_x[k], scene->center_x[k], scene->eye, scene->eye);
    exact_sum_add_product(&sum, -1, scene->center_x[k], scene->center_x[k], y, y);
    exact_sum_add_product(&sum,  2, scene->center_x[k], scene->center_y[k], x, y);
    exact_sum_add_product(&sum, -2, scene->center_x[k], scene->center_z[k], scene->eye, x);
    exact_sum_add_product(&sum,  2, scene->center_x[k], scene->eye, scene->eye, x);
    exact_sum_add_product(&sum, -1, scene->center_y[k], scene->center_y[k], scene->eye, scene->eye);
    exact_sum_add_product(&sum, -1, scene->center_y[k], scene->center_y[k], x, x);
    exact_sum_add_product(&sum, -2, scene->center_y[k], scene->center_z[k], scene->eye, y);
    exact_sum_add_product(&sum,  2, scene->center_y[k], scene->eye, scene->eye, y);
    exact_sum_add_product(&sum, -1, scene->center_z[k], scene->center_z[k], x, x);
    exact_sum_add_product(&sum, -1, scene->center_z[k], scene->center_z[k], y, y);
    exact_sum_add_product(&sum,  2, scene->center_z[k], scene->eye, x, x);
    exact_sum_add_product(&sum,  2, scene->center_z[k], scene->eye, y, y);
    exact_sum_add_product(&sum,  1, scene->eye, scene->eye, scene->radius[k], scene->radius[k]);
    exact_sum_add_product(&sum, -1, scene->eye, scene->eye, x, x);
    exact_sum_add_product(&sum, -1, scene->eye, scene->eye, y, y);
    exact_sum_add_product(&sum,  1, scene->radius[k], scene->radius[k], x, x);
    exact_sum_add_product(&sum,  1, scene->radius[k], scene->radius[k], y, y);
    return exact_sum_sign(&sum) >= 0;
}

/* Which sign disc / R^2 has, and in *sure, where it is positive, that rounding cannot have changed it: the error is far
 * below 2^-40 |D|^2 for every sphere that the plan admits. */
SYMRENDER_INLINE double span_sight(
    double x, const span_row *r, const span_sphere *ball, const span_frame *f, double *sure)
{
    /* ray and sphere [3 mul 6 add] */
    /* distance to the two ends of the span, not negative inside it */
    const double from_left = x - r->x_left.hi - r->x_left.lo;
    const double to_right = r->x_right.hi - x + r->x_right.lo;
    const double chord = from_left * to_right;
    /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
    const double facing2 = ball->alpha.hi * chord;
    const double s = x * x + r->y2;   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const double d_dot_d = s + f->d_dot_d_frame;

    *sure = fabs(facing2) - 0x1p-40 * d_dot_d;
    return facing2;
}

/* Does the ray through a point of this row hit sphere k? Its x is column steps from the axis. */
static int span_hits(double column, double plane_y, const span_row *r, const span_sphere *ball, const span_frame *f,
    double pixel, double step, const scene_type *scene, int k)
{
    double sure;
    const double sight = span_sight(column * step, r, ball, f, &sure);
    return sure > 0.0 ? sight > 0.0 : span_hits_exactly(column * pixel, plane_y, scene, k);
}

/* The spans of a sphere in some rows. */
typedef struct {
    double left[ROWS], left_low[ROWS], right[ROWS], right_low[ROWS];   /* the ends of its hits, in two words each, */
    int first[ROWS], last[ROWS];   /* and the pixels from one to the other, */
    int is_sure[ROWS];             /* and whether rounding cannot have changed which */
} span_strip;

static span_ends ends_in(const span_strip *s, int q)
{
    const span_ends ends = {{s->left[q], s->left_low[q]}, {s->right[q], s->right_low[q]}};
    return ends;
}

/* The spans of ROWS rows, one at each y. What a row takes, dozens of operations that wait for one another, is then one
 * vector of rows. */
static void span_strip_of(span_strip *restrict s, const double *restrict y, const span_sphere *restrict ball,
    const span_frame *restrict f, double left, double step, int width)
{
    for (int q = 0; q < ROWS; ++q) {
        const span_ends ends = span_ends_of(y[q], ball, f);
        s->left[q] = ends.x_left.hi;
        s->left_low[q] = ends.x_left.lo;
        s->right[q] = ends.x_right.hi;
        s->right_low[q] = ends.x_right.lo;
    }
    const double steps = 1.0 / step, end = width;
    for (int q = 0; q < ROWS; ++q) {
        const double from = ceil(s->left[q] * steps - left), to = floor(s->right[q] * steps - left);
        const double first = from < end ? (from > 0.0 ? from : 0.0) : end;
        const double last = to > -1.0 ? (to < end - 1.0 ? to : end - 1.0) : -1.0;
        s->first[q] = (int)first;
        s->last[q] = (int)last;

        /* outside are a miss and inside a hit, at both ends */
        const span_row r = span_row_of(y[q], ends_in(s, q), ball, f);
        double sure_before, sure_first, sure_last, sure_after;
        const double before = span_sight((first - 1.0 + left) * step, &r, ball, f, &sure_before);
        const double at_first = span_sight((first + left) * step, &r, ball, f, &sure_first);
        const double at_last = span_sight((last + left) * step, &r, ball, f, &sure_last);
        const double after = span_sight((last + 1.0 + left) * step, &r, ball, f, &sure_after);
        const int none_before = (first < 1.0) | ((sure_before > 0.0) & (before < 0.0));
        const int none_after = (last > end - 1.5) | ((sure_after > 0.0) & (after < 0.0));
        const int both_hit = (sure_first > 0.0) & (at_first > 0.0) & (sure_last > 0.0) & (at_last > 0.0);
        s->is_sure[q] = none_before & none_after & (both_hit | (first > last));
    }
}

/* Fills the arrays for a run of points, the i-th of them at x = (first + i) step. */
static void span_surface(points *p, int at, int count, double first, double step,
    const span_row *r, const span_sphere *ball, const span_frame *f)
{
    for (int i = 0; i < padded(count); ++i) {
        const double x = (first + p->ordinal[i]) * step;

        /* ray and sphere [3 mul 6 add 1 sqrt 1 max] */
        /* distance to the two ends of the span, not negative inside it */
        const double from_left = x - r->x_left.hi - r->x_left.lo;
        const double to_right = r->x_right.hi - x + r->x_right.lo;
        const double chord = from_left * to_right;
        /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
        const double facing2 = ball->alpha.hi * chord;
        const double s = x * x + r->y2;   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
        const double d_dot_d = s + f->d_dot_d_frame;
        /* -n.D, how far the surface faces the ray: root / R */
        const double facing = sqrt(facing2 > 0.0 ? facing2 : 0.0);

        /* normal [15 mul 9 add 1 div] */
        const double inv_d2 = 1.0 / d_dot_d;
        const double dx = x - ball->image_x.hi - ball->image_x.lo;   /* the pixel seen from the image of the centre */
        const double tilt = f->tilt_frame * (r->tilt_row - dx * ball->image_y.hi);
        /* the foot point (D x (D x m)) / |D|^2 lies on the ray, nearest to the centre; n is it less facing D /
         * |D|^2 */
        const double n_x = inv_d2 * (ball->depth.hi * (f->focal * dx - r->y * tilt) - x * facing);
        const double n_y = inv_d2 * (ball->depth.hi * (x * tilt + r->n_y_row) - r->y * facing);
        const double n_z = inv_d2 * (f->focal * facing + ball->depth.hi * (x * dx + r->n_z_row));

        /* specular [4 mul 3 add] */
        const double bounce = 2.0 * facing;
        /* the primary ray mirrored at the surface, D + 2 facing n, as long as D */
        const double mirror_x = x + n_x * bounce;
        const double mirror_y = r->y + n_y * bounce;
        const double mirror_z = n_z * bounce - f->focal;

        p->n_x[at + i] = n_x;
        p->n_y[at + i] = n_y;
        p->n_z[at + i] = n_z;
        p->mirror_x[at + i] = mirror_x;
        p->mirror_y[at + i] = mirror_y;
        p->mirror_z[at + i] = mirror_z;
        p->inv_d2[at + i] = inv_d2;
    }
}

/* ---- light ---- */

enum { DIFFUSE = 1, SPECULAR = 2, GATED = 4 };   /* terms of a lamp */

/* A light as one receiver has it. */
typedef struct {
    double lamp_x, lamp_y, lamp_z;   /* its place from the receiver's origin, in its unit; or its direction */
    double nearness;                 /* 1; 0 for a light in parallel */
    double diffuse_gain[CHANNELS], specular_gain[CHANNELS];   /* I_L k_d, I_L k_s */
    double keen;                     /* how much closeness magnifies what rounding moves a point by, times GRAIN */
    double matte_error, gloss_error; /* what it does to the terms, in units of 2^-53 */
    double steepness;                /* to the highlight: min(1, steepness * highlight) of that */
    int light, terms;
} lamp;

/* How much a lamp magnifies what rounding does, fitted to the largest errors seen of one sphere under one light. */
static void set_estimates(lamp *l, const scene_type *scene, int k)
{
    /* the closer a light is to the surface, the more its direction changes with the point */
    double reach = 1.0, away = 1.0;
    if (l->nearness > 0.0) {
        reach += sqrt(l->lamp_x * l->lamp_x + l->lamp_y * l->lamp_y + l->lamp_z * l->lamp_z);
        away = fabs(reach - 2.0);
    }
    l->keen = GRAIN * reach / away;

    double diffuse = 0.0, specular = 0.0;   /* of the brightest channel */
    for (int c = 0; c < CHANNELS; ++c) {
        diffuse = l->diffuse_gain[c] > diffuse ? l->diffuse_gain[c] : diffuse;
        specular = l->specular_gain[c] > specular ? l->specular_gain[c] : specular;
    }
    l->matte_error = 3.0 * diffuse / away;
    /* a narrow highlight c^n is steep only where it is bright: n c^(n-1) sin is at most sqrt(n) min(0.61, 3.8 c^n) */
    const double n = scene->shininess[k];
    const int is_narrow = n >= 8.0;
    l->steepness = is_narrow ? 6.3 : 0x1p1000;
    l->gloss_error = specular * ((is_narrow ? 1.0 : 4.0) + 2.9 * sqrt(n)) * (1.0 + 0.25 / away);
    if (n > 0.0 && n < 1.0 && specular > 0.0)
        l->gloss_error = INFINITY;   /* its slope is infinite where it ends */
}

static lamp lamp_of(const scene_type *scene, int k, int light, int terms)
{
    lamp l = {.nearness = scene->nearness[light], .light = light, .terms = terms};
    if (l.nearness > 0.0) {
        /* units of length, powers of two [2 call] */
        const int world_exponent = unit_exponent(scene->radius[k]);   /* R 2^k in [1, 2) */
        const double radius = ldexp(scene->radius[k], world_exponent);

        /* light [3 add 3 div 4 call] */
        const double from_center_x = scene->light_x[light] - scene->center_x[k];   /* L - C */
        const double from_center_y = scene->light_y[light] - scene->center_y[k];
        const double from_center_z = scene->light_z[light] - scene->center_z[k];
        /* farther than 2^60 R a light shines in parallel */
        const int lamp_exponent = light_exponent(world_exponent, scene->radius[k], from_center_x, from_center_y,
            from_center_z, 60);
        const double lamp_x = ldexp(from_center_x, lamp_exponent) / radius;   /* (L - C) / R */
        const double lamp_y = ldexp(from_center_y, lamp_exponent) / radius;
        const double lamp_z = ldexp(from_center_z, lamp_exponent) / radius;

        l.lamp_x = lamp_x;
        l.lamp_y = lamp_y;
        l.lamp_z = lamp_z;
    } else {
        l.lamp_x = scene->light_x[light];
        l.lamp_y = scene->light_y[light];
        l.lamp_z = scene->light_z[light];
    }
    for (int c = 0; c < CHANNELS; ++c) {
        const double intensity = scene->light_intensity[CHANNELS * light + c];
        l.diffuse_gain[c] = (intensity * scene->diffuse[CHANNELS * k + c]);
        l.specular_gain[c] = (intensity * scene->specular[CHANNELS * k + c]);
    }
    set_estimates(&l, scene, k);
    return l;
}

struct scene_gated_shadow_double_frame {
    const scene_type *scene;
    symrender_grid grid;
    double white;
    span_frame span;
    span_sphere *spans;   /* [visible] */
    int *row_first, *row_last;   /* [visible] the rows that may show a sphere */
    lamp *lamps;
    int *half_exponents;   /* [receivers] n / 2 where n is an even whole number, else 0 */
    int *spared;           /* [receivers] rounding cannot do too much to its values, however its lamps shine on it */
};

/* w from every point of the run to its lamp. */
static void reach(points *p, const run *r, const lamp *l)
{
    const double lamp_x = l->lamp_x, lamp_y = l->lamp_y, lamp_z = l->lamp_z, nearness = l->nearness;
    for (int i = r->at; i < r->at + padded(r->count); ++i) {
        /* light [6 mul 5 add] */
        /* w = (L - P) in the receiver's unit; nearness is 0 for a light in parallel, else 1 */
        const double w_x = lamp_x - nearness * p->n_x[i];
        const double w_y = lamp_y - nearness * p->n_y[i];
        const double w_z = lamp_z - nearness * p->n_z[i];
        const double w2 = w_x * w_x + w_y * w_y + w_z * w_z;   /* |w|^2 */

        p->w_x[i] = w_x;
        p->w_y[i] = w_y;
        p->w_z[i] = w_z;
        p->w2[i] = w2;
        p->light[i] = 1.0;
    }
}

/* max(0, n.l) of points that have their w. */
static void shade_matte(points *p, int begin, int end)
{
    for (int i = begin; i < end; ++i) {
        /* light [4 mul 2 add 1 div 1 sqrt] */
        const double inv_w2 = 1.0 / p->w2[i];
        /* n.l = n.w / |w| */
        const double n_dot_l = (p->n_x[i] * p->w_x[i] + p->n_y[i] * p->w_y[i] + p->n_z[i] * p->w_z[i]) * sqrt(inv_w2);

        /* diffuse [1 max 1 select]. Phong 1975, Illumination for computer generated pictures */
        /* max(0, n.l); a light at the point itself adds nothing */
        const double cosine = p->w2[i] > 0.0 ? (n_dot_l > 0.0 ? n_dot_l : 0.0) : 0.0;

        p->cosine[i] = cosine;
    }
}

/* max(0, n.l), and what a highlight's power is taken of, of points that have their w. */
static void shade_glossy(points *p, int begin, int end)
{
    for (int i = begin; i < end; ++i) {
        /* light [4 mul 2 add 1 div 1 sqrt] */
        const double inv_w2 = 1.0 / p->w2[i];
        /* n.l = n.w / |w| */
        const double n_dot_l = (p->n_x[i] * p->w_x[i] + p->n_y[i] * p->w_y[i] + p->n_z[i] * p->w_z[i]) * sqrt(inv_w2);

        /* specular [16 mul 7 add] */
        /* r.v = w . mirror / (|w| |D|) */
        const double w_dot_mirror = p->mirror_x[i] * p->w_x[i] + p->mirror_y[i] * p->w_y[i] + p->mirror_z[i]
            * p->w_z[i];
        const double inv_w2_d2 = p->inv_d2[i] * inv_w2;
        const double cos2 = w_dot_mirror * w_dot_mirror * inv_w2_d2;   /* (r.v)^2 */
        /* w x mirror, short where the highlight is */
        const double side_x = p->mirror_z[i] * p->w_y[i] - p->mirror_y[i] * p->w_z[i];
        const double side_y = p->mirror_x[i] * p->w_z[i] - p->mirror_z[i] * p->w_x[i];
        const double side_z = p->mirror_y[i] * p->w_x[i] - p->mirror_x[i] * p->w_y[i];
        /* 1 - (r.v)^2, accurate where r.v is near 1 */
        const double sin2 = inv_w2_d2 * (side_x * side_x + side_y * side_y + side_z * side_z);

        /* diffuse [1 max 1 select]. Phong 1975, Illumination for computer generated pictures */
        const double share_1 = p->w2[i] > 0.0;
        /* max(0, n.l); a light at the point itself adds nothing */
        const double cosine = share_1 ? (n_dot_l > 0.0 ? n_dot_l : 0.0) : 0.0;

        p->w_dot_mirror[i] = w_dot_mirror;
        p->cos2[i] = cos2;
        p->sin2[i] = sin2;
        p->cosine[i] = cosine;
    }
}

/* The powers of highlights: for an even whole exponent, 2 half_exponent, by squaring. */
static void raise_lobes(points *p, int begin, int end, int half_exponent)
{
    if (half_exponent > 0) {
        const int count = end - begin;
        whole_powers_of_lobe(p->sin2 + begin, p->highlight_log2 + begin, p->highlight + begin, half_exponent, count);
        return;
    }
    for (int i = begin; i < end; ++i) {
        /* specular [1 call] */
        const double highlight_log2 = log2_of_lobe(p->cos2[i], p->sin2[i]);   /* log2 (r.v)^2 */

        p->highlight_log2[i] = highlight_log2;
    }
    for (int i = begin; i < end; ++i) {
        /* specular [1 call]. Phong 1975, Illumination for computer generated pictures */
        /* max(0, r.v)^n where r.v > 0 */
        const double highlight = power_of_lobe(p->highlight_log2[i], p->shininess[i]);

        p->highlight[i] = highlight;
    }
}

/* max(0, r.v)^n of points that have their power. */
static void finish_glossy(points *p, int begin, int end)
{
    for (int i = begin; i < end; ++i) {
        const double highlight = p->highlight[i];

        /* specular [2 select]. Phong 1975, Illumination for computer generated pictures */
        const double zero_power = p->shininess[i] == 0.0 ? 1.0 : 0.0;   /* 0^n: 1 for n = 0 */
        const double leaf = p->w_dot_mirror[i] > 0.0 ? highlight : zero_power;   /* max(0, r.v)^n */

        /* diffuse */
        const double share_1 = p->w2[i] > 0.0;

        /* specular [1 select] */
        const double lobe = share_1 ? leaf : 0.0;

        p->lobe[i] = lobe;
    }
}

/* The light that reaches each point of the run past the spheres that may stand before it. Returns 0 if it is none. */
static int cast_shadows(points *p, const run *r, const lamp *l, const scene_type *scene)
{
    const int k = r->receiver;
    const double per_unit = 1.0 / scene->radius[k];
    for (int q = scene->blockers_begin[r->lamp]; q < scene->blockers_begin[r->lamp + 1]; ++q) {
        const int blocker = scene->blockers[q];
        const double gap_x = (scene->center_x[blocker] - scene->center_x[k]) * per_unit;
        const double gap_y = (scene->center_y[blocker] - scene->center_y[k]) * per_unit;
        const double gap_z = (scene->center_z[blocker] - scene->center_z[k]) * per_unit;
        const double ratio = scene->radius[blocker] * per_unit, ratio2 = ratio * ratio;
        const double past_x = l->lamp_x - gap_x, past_y = l->lamp_y - gap_y, past_z = l->lamp_z - gap_z;
        const int is_within = past_x * past_x + past_y * past_y + past_z * past_z < ratio2;
        const double far = l->nearness > 0.0 && !is_within ? 1.0 : INFINITY;
        const double gap = sqrt(gap_x * gap_x + gap_y * gap_y + gap_z * gap_z);
        const double keen = l->keen + GRAIN * (1.0 + gap) / ratio;
        for (int i = r->at; i < r->at + padded(r->count); ++i) {
            /* shadow [14 mul 12 add 1 select]. Lagrange's identity |m|^2 |D|^2 - (m.D)^2 = |m x D|^2 */
            const double b_x = gap_x - p->n_x[i];   /* b, the blocker's centre seen from the point */
            const double b_y = gap_y - p->n_y[i];
            const double b_z = gap_z - p->n_z[i];
            const double cross_x = p->w_z[i] * b_y - p->w_y[i] * b_z;   /* b x w */
            const double cross_y = p->w_x[i] * b_z - p->w_z[i] * b_x;
            const double cross_z = p->w_y[i] * b_x - p->w_x[i] * b_y;
            const double toward = p->w_x[i] * b_x + p->w_y[i] * b_y + p->w_z[i] * b_z;   /* b.w */
            /* positive where the line to the light meets the blocker */
            const double inside2 = ratio2 * p->w2[i] - cross_x * cross_x - cross_y * cross_y - cross_z * cross_z;
            /* no light where it does so between point and light */
            const double shade = (((inside2 > 0.0) & (toward > 0.0)) & (far * p->w2[i] - toward > 0.0)) ? 0.0
                : p->light[i];

            /* margin [5 mul 3 add 1 call] */
            const double b2 = b_x * b_x + b_y * b_y + b_z * b_z;   /* |b|^2, at least ratio^2 */
            const double margin = fabs(inside2) - keen * p->w2[i] * b2;   /* not above 0: in doubt */

            p->light[i] = shade;
            p->margin[i] = least(margin, p->margin[i]);
        }
    }
    if (scene->blockers_begin[r->lamp] == scene->blockers_begin[r->lamp + 1])
        return 1;
    int lit = 0;
    for (int i = r->at; i < r->at + r->count; ++i)
        lit += p->light[i] > 0.0;
    return lit;
}

/* Adds what the run's lamp brings. */
static void accumulate(points *p, const run *r, const lamp *l, int is_spared)
{
    if (l->terms & GATED) {
        const double keen = l->keen;
        /* margin [1 mul] */
        const double keen_here = keen;
        const double keen_here2 = keen_here * keen_here;

        for (int i = r->at; i < r->at + padded(r->count); ++i) {
            /* gate [3 mul 2 add] */
            /* |w| n.l */
            const double n_dot_w = p->n_x[i] * p->w_x[i] + p->n_y[i] * p->w_y[i] + p->n_z[i] * p->w_z[i];

            /* margin [2 mul 1 add] */
            const double margin = n_dot_w * n_dot_w - p->w2[i] * keen_here2;   /* not above 0: in doubt */

            const double sure = p->lobe[i] > 0.0 ? margin : INFINITY;
            p->margin[i] = least(sure, p->margin[i]);
            p->lobe[i] = p->cosine[i] > 0.0 ? p->lobe[i] : 0.0;
        }
    }
    const double matte_error = l->matte_error, gloss_error = l->gloss_error, steepness = l->steepness;
    const int end = is_spared ? r->at : r->at + padded(r->count);
    for (int i = r->at; i < end; ++i) {
        const double matte = p->cosine[i] > 0.0 ? matte_error : 0.0;
        const double steep = l->terms & SPECULAR ? gloss_error * least(1.0, steepness * p->lobe[i]) : 0.0;
        const double told = matte + steep;
        p->error[i] += p->light[i] * told;
    }
    for (int c = 0; c < CHANNELS; ++c) {
        const double diffuse_gain = l->diffuse_gain[c], specular_gain = l->specular_gain[c];
        if (l->terms & SPECULAR)
            for (int i = r->at; i < r->at + padded(r->count); ++i)
                p->value[c][i] += p->light[i] * (diffuse_gain * p->cosine[i] + specular_gain * p->lobe[i]);
        else
            for (int i = r->at; i < r->at + padded(r->count); ++i)
                p->value[c][i] += p->light[i] * (diffuse_gain * p->cosine[i]);
    }
}

/* The terms that the run's lamp adds, one by one, for pixels from `pixel` on. */
static void write_terms(
    const points *p, const run *r, const lamp *l, const layer_set *layers, size_t pixel, size_t pixels)
{
    for (int c = 0; c < CHANNELS; ++c)
        for (int i = 0; i < r->count; ++i) {
            const size_t place = CHANNELS * (pixels * (size_t)l->light + pixel + (size_t)i) + (size_t)c;
            const double light = p->light[r->at + i];
            if (layers->diffuse)
                layers->diffuse[place] = light * l->diffuse_gain[c] * p->cosine[r->at + i];
            if (layers->specular && l->terms & SPECULAR)
                layers->specular[place] = light * l->specular_gain[c] * p->lobe[r->at + i];
        }
}

/* The intensity of points that have their geometry. `layers` may ask for its terms, for pixels from `pixel` on. */
static void shade(points *p, const frame *h, int bounces, const layer_set *layers, size_t pixel, size_t pixels)
{
    const scene_type *scene = h->scene;
    for (const run *r = p->run; r < p->run + p->runs; ++r) {
        const int end = r->at + padded(r->count);
        for (int c = 0; c < CHANNELS; ++c) {
            const double ambient = scene->ambient[CHANNELS * r->receiver + c];
            for (int i = r->at; i < end; ++i)
                p->value[c][i] = ambient;
        }
        const double shininess = scene->shininess[r->receiver];
        for (int i = r->at; i < end; ++i)
            p->shininess[i] = shininess;
        for (int i = r->at; i < end; ++i)
            p->error[i] = 0.0;
    }

    /* the turn-th lamp of every run: points of different receivers share the loops */
    for (int turn = 0;; ++turn) {
        int is_last = 1;
        for (run *r = p->run; r < p->run + p->runs; ++r) {
            r->terms = 0;
            r->lamp = scene->lamps_begin[r->receiver] + turn;
            if (r->lamp >= scene->lamps_begin[r->receiver + 1])
                continue;
            is_last = 0;
            const lamp *l = &h->lamps[r->lamp];
            reach(p, r, l);
            if (!cast_shadows(p, r, l, scene))
                continue;
            r->terms = l->terms;
        }
        if (is_last)
            break;
        for (int first = 0, next; first < p->runs; first = next) {
            const int is_glossy = p->run[first].terms & SPECULAR, is_lit = p->run[first].terms != 0;
            next = first + 1;
            while (next < p->runs
                   && (p->run[next].terms & SPECULAR) == is_glossy && (p->run[next].terms != 0) == is_lit)
                ++next;
            const int begin = p->run[first].at, end = p->run[next - 1].at + padded(p->run[next - 1].count);
            if (is_glossy) {
                shade_glossy(p, begin, end);
                for (int from = first, to; from < next; from = to) {
                    const int half_exponent = h->half_exponents[p->run[from].receiver];
                    to = from + 1;
                    while (to < next && h->half_exponents[p->run[to].receiver] == half_exponent)
                        ++to;
                    raise_lobes(p, p->run[from].at, p->run[to - 1].at + padded(p->run[to - 1].count), half_exponent);
                }
                finish_glossy(p, begin, end);
            } else if (is_lit) {
                shade_matte(p, begin, end);
            }
        }
        for (const run *r = p->run; r < p->run + p->runs; ++r)
            if (r->terms) {
                accumulate(p, r, &h->lamps[r->lamp], h->spared[r->receiver]);
                if (layers)
                    write_terms(p, r, &h->lamps[r->lamp], layers, pixel + (size_t)r->place, pixels);
            }
    }
    (void)bounces;
}

frame *scene_gated_shadow_double_prepare(const scene_type *scene, const symrender_grid *grid)
{
    frame *h = array(1, sizeof *h);
    if (!h)
        return NULL;
    h->scene = scene;
    h->grid = *grid;
    h->white = grid->white;
    h->span = span_frame_of(scene);
    const size_t visible = (size_t)scene->visible;
    h->row_first = array(visible, sizeof *h->row_first);
    h->row_last = array(visible, sizeof *h->row_last);
    h->spans = array(visible, sizeof *h->spans);
    h->lamps = array((size_t)scene->lamps_begin[scene->receivers], sizeof *h->lamps);
    h->half_exponents = array((size_t)scene->receivers, sizeof *h->half_exponents);
    h->spared = array((size_t)scene->receivers, sizeof *h->spared);
    if (!h->spans || !h->row_first || !h->row_last || !h->lamps || !h->half_exponents || !h->spared) {
        scene_gated_shadow_double_release(h);
        return NULL;
    }
    for (int k = 0; k < scene->visible; ++k) {
        h->row_first[k] = 0;
        h->row_last[k] = grid->height - 1;
        h->spans[k] = span_sphere_of(scene, k, &h->span);
        /* the silhouette's rows, and one more on each side for what rounding may do */
        const double step = grid->pixel * h->span.plane_unit, top = 0.5 * grid->height - 0.5;
        const double first = top - h->spans[k].row_high / step - 1.5, last = top - h->spans[k].row_low / step + 1.5;
        if (first > 0.0)
            h->row_first[k] = first < grid->height ? (int)first : grid->height;
        if (last < grid->height - 1)
            h->row_last[k] = last > 0.0 ? (int)last : -1;
    }
    for (int k = 0; k < scene->receivers; ++k)
        for (int l = scene->lamps_begin[k]; l < scene->lamps_begin[k + 1]; ++l)
            h->lamps[l] = lamp_of(scene, k, scene->lamp_light[l], scene->lamp_terms[l]);
    for (int k = 0; k < scene->receivers; ++k)
        h->half_exponents[k] = half_of_whole(scene->shininess[k]);
    for (int k = 0; k < scene->receivers; ++k) {
        double most = 0.0;
        for (int l = scene->lamps_begin[k]; l < scene->lamps_begin[k + 1]; ++l)
            most += h->lamps[l].matte_error + h->lamps[l].gloss_error;
        h->spared[k] = most < 0.999 * MOST_ROUNDOFFS;
    }
    return h;
}

void scene_gated_shadow_double_release(frame *h)
{
    if (!h)
        return;
    free(h->spans);
    free(h->row_first);
    free(h->row_last);
    free(h->lamps);
    free(h->half_exponents);
    free(h->spared);
    free(h);
}

/* ---- the rows of an image ---- */

/* What a call of rows or points works in. */
typedef struct {
    void *memory;       /* in which points lie, where a line of the cache begins */
    points *points;     /* one for each level of mirrors */
    pixel_span *gap;    /* [width / 2 + 1] the pixels of the row that nobody has taken, from left to right */
    int *start;         /* [strips + 1] where the list of spheres of each strip of ROWS rows begins in */
    int *active;        /* the spheres that may show in each strip, front to back */
    span_strip *strips; /* [most in a strip] */
    span_row *span_rows;
} workspace;

/* Where the first line of the cache begins in some memory. */
static void *line_of_cache(void *memory)
{
    return (char *)memory + (LINE - (uintptr_t)memory % LINE) % LINE;
}

static void drop(workspace *w)
{
    free(w->memory);
    free(w->gap);
    free(w->start);
    free(w->active);
    free(w->strips);
    free(w->span_rows);
}

/* The strips from row_begin on that a sphere may show in: from the first to the last of them. */
static int first_strip(const frame *h, int k, int row_begin)
{
    return h->row_first[k] > row_begin ? (h->row_first[k] - row_begin) / ROWS : 0;
}

static int last_strip(const frame *h, int k, int row_begin, int row_end)
{
    const int last = h->row_last[k] < row_end - 1 ? h->row_last[k] : row_end - 1;
    return last >= row_begin ? (last - row_begin) / ROWS : -1;
}

/* Memory for these rows, and their lists of spheres. Returns 0 where there is none. */
static int take(workspace *w, const frame *h, int row_begin, int row_end, int width)
{
    const workspace none = {0};
    *w = none;
    w->memory = array(1, sizeof *w->points + LINE);
    w->points = w->memory ? line_of_cache(w->memory) : NULL;
    for (int i = 0; w->points && i < POINTS; ++i)
        w->points->ordinal[i] = i;
    w->gap = array((size_t)width / 2 + 1, sizeof *w->gap);
    if (!w->points || !w->gap)
        return 0;
    const int strips = (row_end - row_begin + ROWS - 1) / ROWS;
    size_t most = 0;
    w->start = array((size_t)strips + 2, sizeof *w->start);
    if (!w->start)
        return 0;
    for (int k = 0; k < h->scene->visible; ++k)
        for (int s = first_strip(h, k, row_begin); s <= last_strip(h, k, row_begin, row_end); ++s)
            ++w->start[s + 2];
    for (int s = 0; s < strips; ++s) {
        most = (size_t)w->start[s + 2] > most ? (size_t)w->start[s + 2] : most;
        w->start[s + 2] += w->start[s + 1];
    }
    w->active = array((size_t)w->start[strips + 1], sizeof *w->active);
    w->strips = array(most, sizeof *w->strips);
    w->span_rows = array(most, sizeof *w->span_rows);
    if (!w->active || !w->strips || !w->span_rows)
        return 0;
    for (int k = 0; k < h->scene->visible; ++k)
        for (int s = first_strip(h, k, row_begin); s <= last_strip(h, k, row_begin, row_end); ++s)
            w->active[w->start[s + 1]++] = k;
    return 1;
}

/* The same for points, one at a time: two slots. */
static int take_for_points(workspace *w, const frame *h)
{
    const workspace none = {0};
    *w = none;
    w->memory = array(1, sizeof *w->points + LINE);
    w->points = w->memory ? line_of_cache(w->memory) : NULL;
    for (int i = 0; w->points && i < POINTS; ++i)
        w->points->ordinal[i] = i;
    (void)h;
    w->span_rows = array(2, sizeof *w->span_rows);
    return w->points != NULL && w->span_rows != NULL;
}

/* The row's own numbers of sphere k, in the slot of the workspace that its place in the row's list gives it. */
static void enter_row(workspace *w, const frame *h, int slot, int k, double y)
{
    w->span_rows[slot] = span_row_of(y, span_ends_of(y, &h->spans[k], &h->span), &h->spans[k], &h->span);
}

static int hits(
    const workspace *w, const frame *h, int slot, int k, double column, double plane_y, double pixel, double step)
{
    return span_hits(column, plane_y, &w->span_rows[slot], &h->spans[k], &h->span, pixel, step, h->scene, k);
}

/* Distance of sphere k from the eye along the ray through x, in scene units. */
static double depth_of(const workspace *w, const frame *h, int slot, int k, double x)
{
    const double radii = span_distance(x, &w->span_rows[slot], &h->spans[k], &h->span);
    return radii * h->scene->radius[k];
}

/* Depth, normal, index and ambient term of the last run, which the pixels of one owner in this row make up. */
static void write_geometry(const points *p, const workspace *w, const frame *h, const layer_set *layers,
    size_t row, int slot, double left, double step)
{
    const scene_type *scene = h->scene;
    const run *r = &p->run[p->runs - 1];
    for (int i = 0; i < r->count; ++i) {
        const size_t place = row + (size_t)(r->place + i);
        if (layers->index)
            layers->index[place] = r->receiver;
        if (layers->normal) {
            layers->normal[3 * place] = p->n_x[r->at + i];
            layers->normal[3 * place + 1] = p->n_y[r->at + i];
            layers->normal[3 * place + 2] = p->n_z[r->at + i];
        }
        if (layers->ambient)
            for (int c = 0; c < CHANNELS; ++c)
                layers->ambient[CHANNELS * place + (size_t)c] = scene->ambient[CHANNELS * r->receiver + c];
        if (layers->depth) {
            const double x = (r->place + i + left) * step;
            layers->depth[place] = depth_of(w, h, slot, r->receiver, x);
        }
    }
}

/* Lists the points in doubt, the i-th from the row's beginning as row + i. Returns how many they are. */
static ptrdiff_t list_doubtful(const points *p, size_t row, ptrdiff_t *unsettled)
{
    ptrdiff_t found = 0;
    for (const run *r = p->run; r < p->run + p->runs; ++r)
        for (int i = r->at; i < r->at + r->count; ++i) {
            double most = 1.0;
            for (int c = 0; c < CHANNELS; ++c)
                most = p->value[c][i] > most ? p->value[c][i] : most;
            if (p->margin[i] > 0.0 && p->error[i] < MOST_ROUNDOFFS * most)
                continue;
            unsettled[found++] = (ptrdiff_t)row + r->place + i - r->at;
        }
    return found;
}

/* Shades the points at hand and writes them to the row. Returns how many are in doubt: their numbers are listed. */
static ptrdiff_t flush(points *p, const frame *h, double *restrict out, const layer_set *layers, size_t row,
    ptrdiff_t *unsettled)
{
    const size_t pixels = (size_t)h->grid.width * (size_t)h->grid.height;
    shade(p, h, 0, layers, row, pixels);
    int doubtful = 0;
    for (int i = 0; i < p->count; ++i)
        doubtful += !((p->margin[i] > 0.0) & (p->error[i] < MOST_ROUNDOFFS));
    const ptrdiff_t listed = doubtful && unsettled ? list_doubtful(p, row, unsettled) : 0;
    const double white = h->white;
    for (int c = 0; c < CHANNELS; ++c)
        for (int i = 0; i < p->count; ++i)
            p->value[c][i] = p->value[c][i] > white ? white : p->value[c][i];
    for (const run *r = p->run; r < p->run + p->runs; ++r)
        memcpy(out + r->place, p->value[0] + r->at, (size_t)r->count * sizeof *out);
    p->count = p->runs = 0;
    return listed;
}

/* Geometry of a run of points of the sphere in a slot of the row, or of the plane. */
static void surface(points *p, const workspace *w, const frame *h, int slot, int receiver, int count,
    double first, double step)
{
    run *r = &p->run[p->runs++];
    r->receiver = receiver;
    r->at = p->count;
    r->count = count;
    p->count += padded(count);
    for (int i = r->at; i < p->count; ++i) {
        p->margin[i] = INFINITY;
    }
    span_surface(p, r->at, count, first, step, &w->span_rows[slot], &h->spans[receiver], &h->span);
}

/* Where the pixels of a row go. */
typedef struct {
    double *out;                /* the row of the image, */
    const layer_set *layers;    /* what is asked for beside it, */
    size_t row;                 /* and the number of the row's first pixel in the image */
    double plane_y;             /* its place on the image plane */
    double left, step;          /* pixel i is at x = (i + left) step */
    const double *background;   /* [CHANNELS] */
} row_place;

/* Writes the background to the pixels [begin, end) of a row. */
static void paint_background(const frame *h, const row_place *to, int begin, int end)
{
    const scene_type *scene = h->scene;
    for (int i = begin; i < end; ++i)
        for (int c = 0; c < CHANNELS; ++c)
            to->out[CHANNELS * i + c] = to->background[c];
    const layer_set *layers = to->layers;
    for (int i = begin; layers && i < end; ++i) {
        const size_t place = to->row + (size_t)i;
        if (layers->depth)
            layers->depth[place] = INFINITY;
        if (layers->index)
            layers->index[place] = -1;
        if (layers->background) {
            for (int c = 0; c < CHANNELS; ++c)
                layers->background[CHANNELS * place + (size_t)c] = scene->background[c];
        }
    }
}

/* Makes points of the pixels [begin, end) of one receiver: as many at a time as there is room for, the others when
 * these have been shaded. Returns how many of them were in doubt. */
static ptrdiff_t add_pixels(
    workspace *w, const frame *h, const row_place *to, int slot, int receiver, int begin, int end, ptrdiff_t *unsettled)
{
    points *p = w->points;
    ptrdiff_t found = 0;
    for (int at = begin, some; at < end; at += some) {
        if (p->count == POINTS)
            found += flush(p, h, to->out, to->layers, to->row, unsettled ? unsettled + found : NULL);
        some = end - at < POINTS - p->count ? end - at : POINTS - p->count;
        p->run[p->runs].place = at;
        surface(p, w, h, slot, receiver, some, at + to->left, to->step);
        if (to->layers)
            write_geometry(p, w, h, to->layers, to->row, slot, to->left, to->step);
    }
    return found;
}

/* The rows of a strip that begins with this one, for all spheres that may show in it. */
static void enter_strip(workspace *w, const frame *h, const int *active, int count, int row)
{
    const double unit = h->span.plane_unit, pixel = h->grid.pixel;
    const double left = 0.5 - 0.5 * h->grid.width, top = 0.5 * h->grid.height - 0.5;
    double y[ROWS];
    for (int q = 0; q < ROWS; ++q)
        y[q] = (top - (row + q)) * pixel * unit;
    for (int slot = 0; slot < count; ++slot)
        span_strip_of(&w->strips[slot], y, &h->spans[active[slot]], &h->span, left, pixel * unit, h->grid.width);
}

/* The row's own numbers of the sphere in a slot. */
static void enter_row_of_strip(workspace *w, const frame *h, int slot, int k, int in_strip, double y)
{
    w->span_rows[slot] = span_row_of(y, ends_in(&w->strips[slot], in_strip), &h->spans[k], &h->span);
}

/* The pixels of a row that hit the sphere in a slot: between the ends in closed form, settled by an exact test where
 * rounding may have moved them. */
static pixel_span span_in_row(const workspace *w, const frame *h, int slot, int k, int in_strip, const row_place *to)
{
    const span_strip *s = &w->strips[slot];
    pixel_span span = {s->first[in_strip], s->last[in_strip]};
    if (s->is_sure[in_strip])
        return span;
    const double unit = h->span.plane_unit, pixel = h->grid.pixel, step = to->step, left = to->left, y = to->plane_y;
    const span_sphere *ball = &h->spans[k];
    const span_frame *f = &h->span;
    const span_row r = span_row_of(y * unit, ends_in(s, in_strip), ball, f);
    const int width = h->grid.width;
    while (span.first > 0 && span_hits(span.first - 1 + left, y, &r, ball, f, pixel, step, h->scene, k))
        --span.first;
    while (span.last < width - 1 && span_hits(span.last + 1 + left, y, &r, ball, f, pixel, step, h->scene, k))
        ++span.last;
    while (span.first <= span.last && !span_hits(span.first + left, y, &r, ball, f, pixel, step, h->scene, k))
        ++span.first;
    while (span.last >= span.first && !span_hits(span.last + left, y, &r, ball, f, pixel, step, h->scene, k))
        --span.last;
    return span;
}

/* The first of the gaps, from left to right, that ends at a pixel or right of it. */
static int gap_from(const pixel_span *gap, int gaps, int pixel)
{
    int low = 0, high = gaps;
    while (low < high) {
        const int middle = (low + high) / 2;
        if (gap[middle].last < pixel)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* Takes pixels from gap g, which holds them: none, one or two gaps stay of it. Returns how many there are in all. */
static int take_from_gap(pixel_span *gap, int gaps, int g, pixel_span taken)
{
    const pixel_span before = {gap[g].first, taken.first - 1}, after = {taken.last + 1, gap[g].last};
    const int has_before = before.first <= before.last, has_after = after.first <= after.last;
    const int stay = has_before + has_after;
    if (stay != 1)
        memmove(gap + g + stay, gap + g + 1, (size_t)(gaps - g - 1) * sizeof *gap);
    if (has_before)
        gap[g] = before;
    if (has_after)
        gap[g + has_before] = after;
    return gaps - 1 + stay;
}

ptrdiff_t scene_gated_shadow_double_rows(
    double *image, ptrdiff_t stride, const frame *h, const layer_set *layers, int row_begin, int row_end,
    ptrdiff_t *unsettled)
{
    const scene_type *scene = h->scene;
    const int width = h->grid.width;
    const double unit = h->span.plane_unit;
    const double pixel = h->grid.pixel, step = pixel * unit;
    const double left = 0.5 - 0.5 * width, top = 0.5 * h->grid.height - 0.5;
    double background[CHANNELS];
    for (int c = 0; c < CHANNELS; ++c)
        background[c] = scene->background[c] > h->grid.white ? h->white : scene->background[c];
    ptrdiff_t found = 0;
    workspace w;
    if (!take(&w, h, row_begin, row_end, width)) {
        drop(&w);
        return -1;
    }
    for (int j = row_begin; j < row_end; ++j) {
        const double plane_y = (top - j) * pixel;
        const pixel_span whole = {0, width - 1};
        w.gap[0] = whole;
        int gaps = 1;
        const row_place here = {
            image + j * stride, layers, (size_t)j * (size_t)width, plane_y, left, step, background,
        };
        const int strip = (j - row_begin) / ROWS, in_strip = (j - row_begin) % ROWS;
        const int *active = w.active + w.start[strip];
        const int count = w.start[strip + 1] - w.start[strip];
        if (in_strip == 0)
            enter_strip(&w, h, active, count, j);

        /* front to back, each sphere gets what is left of its span */
        for (int slot = 0; slot < count && gaps > 0; ++slot) {
            const int k = active[slot];
            const pixel_span span = span_in_row(&w, h, slot, k, in_strip, &here);
            int g = span.first <= span.last ? gap_from(w.gap, gaps, span.first) : gaps;
            if (g == gaps || w.gap[g].first > span.last)
                continue;
            enter_row_of_strip(&w, h, slot, k, in_strip, plane_y * unit);
            while (g < gaps && w.gap[g].first <= span.last) {
                const pixel_span seen = {
                    w.gap[g].first > span.first ? w.gap[g].first : span.first,
                    w.gap[g].last < span.last ? w.gap[g].last : span.last,
                };
                found += add_pixels(
                    &w, h, &here, slot, k, seen.first, seen.last + 1, unsettled ? unsettled + found : NULL);
                const int is_split = w.gap[g].first < seen.first;
                gaps = take_from_gap(w.gap, gaps, g, seen);
                g += is_split;
            }
        }

        for (int g = 0; g < gaps; ++g)
            paint_background(h, &here, w.gap[g].first, w.gap[g].last + 1);
        if (w.points->count > 0)
            found += flush(w.points, h, here.out, layers, here.row, unsettled ? unsettled + found : NULL);
    }
    drop(&w);
    return found;
}

ptrdiff_t scene_gated_shadow_double_points(
    double *values, const double *x, const double *y, ptrdiff_t count, const frame *h, ptrdiff_t *unsettled)
{
    const scene_type *scene = h->scene;
    const double plane_unit = h->span.plane_unit;
    ptrdiff_t found = 0;
    workspace w;
    if (!take_for_points(&w, h)) {
        drop(&w);
        return -1;
    }
    points *p = w.points;
    double *out = values;
    for (ptrdiff_t i = 0; i < count; ++i) {
        const double unit = point_unit(plane_unit, x[i], y[i], 0x1p200);
        int owner = -1;
        /* two slots: what the point shows so far, and the sphere that is tried */
        int active[2] = {0, 0};
        for (int k = 0; k < scene->visible; ++k) {
            active[1] = k;
            enter_row(&w, h, 1, k, y[i] * unit);
            if (!hits(&w, h, 1, k, x[i], y[i], 1.0, unit))
                continue;
            owner = 0;
            active[0] = k;
            w.span_rows[0] = w.span_rows[1];
            break;
        }
        int receiver = owner < 0 ? -1 : active[0];
        if (receiver < 0) {
            for (int c = 0; c < CHANNELS; ++c) {
                const double value = scene->background[c];
                values[CHANNELS * i + c] = value > h->white ? h->white : value;
            }
            continue;
        }
        if (p->count == POINTS || i - (out - values) / CHANNELS > 0x3fffffff) {
            found += flush(p, h, out, NULL, (size_t)((out - values) / CHANNELS), unsettled ? unsettled + found : NULL);
            out = values + CHANNELS * i;
        }
        p->run[p->runs].place = (int)(i - (out - values) / CHANNELS);
        surface(p, &w, h, 0, receiver, 1, x[i] * unit, 1.0);
    }
    if (p->count > 0)
        found += flush(p, h, out, NULL, (size_t)((out - values) / CHANNELS), unsettled ? unsettled + found : NULL);
    drop(&w);
    return found;
}

int scene_gated_shadow_double_prepare_many(
    frame **frames, const scene_type *scenes, ptrdiff_t count, const symrender_grid *grids)
{
    for (ptrdiff_t k = 0; k < count; ++k) {
        frames[k] = scene_gated_shadow_double_prepare(&scenes[k], &grids[k]);
        if (!frames[k]) {
            scene_gated_shadow_double_release_many(frames, k);
            return -1;
        }
    }
    return 0;
}

void scene_gated_shadow_double_release_many(
    frame **frames, ptrdiff_t count)
{
    for (ptrdiff_t k = 0; k < count; ++k)
        scene_gated_shadow_double_release(frames[k]);
}

ptrdiff_t scene_gated_shadow_double_batch(double *const *images, ptrdiff_t stride,
    frame *const *frames, ptrdiff_t row_begin, ptrdiff_t row_end, ptrdiff_t *unsettled)
{
    const ptrdiff_t height = frames[0]->grid.height, pixels = height * frames[0]->grid.width;
    ptrdiff_t found = 0;

    for (ptrdiff_t k = row_begin / height; k * height < row_end; ++k) {
        const ptrdiff_t top = k * height;
        const int begin = row_begin > top ? (int)(row_begin - top) : 0;
        const int end = row_end - top < height ? (int)(row_end - top) : (int)height;
        const ptrdiff_t listed = scene_gated_shadow_double_rows(
            images[k], stride, frames[k], NULL, begin, end, unsettled ? unsettled + found : NULL);
        if (listed < 0)
            return -1;
        for (ptrdiff_t i = 0; unsettled && i < listed; ++i)
            unsettled[found + i] += k * pixels;
        found += listed;
    }
    return found;
}
