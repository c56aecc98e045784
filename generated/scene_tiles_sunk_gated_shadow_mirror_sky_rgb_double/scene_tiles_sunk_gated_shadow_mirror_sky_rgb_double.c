/* scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double: spheres on a plane, every number an argument
 * Accuracy "double" (symrender_cg 0.1.0)
 * Generated from the formula; do not edit. Regenerate with:
 *     python -m symrender_cg build mirrors --accuracy double
 *
 * promise  at most 1e-15 max(1, value) off where no light is within 1e-3 R of a surface and n <= 1000; another
 *          kernel draws what this one may not; no overflow; hit or miss never wrong
 *          What a ray of the eye hits is exact; which of two intersecting surfaces is in front, the horizon of the
 *          plane, the edges of tiles, the edges of shadows and what mirrors show are decided in float64; pixels
 *          where rounding may have decided are listed
 * in       sphere off the axis
 *          diffuse term
 *          specular term
 *          gated specular
 *          the plane
 *          tiles of the plane
 *          lights on surfaces
 *          shadows of spheres
 *          reflections
 *          reflections of reflections
 *          lights from a direction
 *          background in two colours
 *          colour
 *          clipping at 1
 * out      sphere at the plane of the eye: 5 visible spheres wholly before the eye
 *          shadow of the sphere on itself: a sphere is convex: where n.l > 0 the way to the light leaves it; where
 *          not, diffuse is 0
 *          spheres behind the eye: no sphere of 5 wholly behind the plane of the eye
 *          spheres outside the window: no window: any point of the image plane may be asked for
 *          hidden spheres: no sphere of 5 wholly hidden
 *          order along the ray: 10 pairs of visible spheres disjoint: the smaller power of the eye is in front on
 *          every ray
 *          shadow of the plane: 2 of 2 lights on the eye's side of the plane, as is all that is seen
 *          lights that fade with distance: every light that lights anything is as strong at every distance
 *          numbers above are those of the scene it was written for; any scene with the same effects may call it
 * ops      span: a frame: 1 mul 1 div 8 call, a sphere: 6 mul 8 add 2 div 2 sqrt 2 max 32 call, a row: 5 mul 2 add
 *            22 call, a pixel: 25 mul 33 add 3 div 2 sqrt 1 max 42 call
 *          plane: a frame: 3 mul 7 call, a row: 3 mul 3 call, a pixel: 10 mul 25 add 5 div 1 sqrt 19 call
 *          tiles: a frame: 2 add, a pixel: 9 mul 14 add 1 max 5 call
 *          lamp: a sphere: 3 add 3 div 6 call
 *          reach: a pixel: 6 mul 5 add
 *          matte: a pixel: 4 mul 2 add 1 div 1 sqrt 1 max 1 select
 *          glossy: a pixel: 20 mul 9 add 1 div 1 sqrt 1 max 4 select 2 call
 *          gate: a pixel: 7 mul 3 add
 *          shadow: a pixel: 20 mul 15 add 1 select 1 call
 *          echo: a pixel: 24 mul 19 add 1 div 1 sqrt 1 max 1 call
 *          arrival: a sphere: 12 call, a pixel: 14 mul 8 add 2 div 1 sqrt 1 max 66 call
 *          echo_plane: a pixel: 28 mul 21 add 3 div 4 call
 *          landing: a frame: 3 call, a sphere: 9 call, a pixel: 14 mul 9 add 2 div 1 sqrt 47 call
 *          gradient: a pixel: 7 mul 5 add 1 div 1 sqrt
 */
#include "scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double.h"

#include "inline.h"
#include "span.h"
#include "units.h"
#include "block.h"
#include "lobe_power.h"
#include "double_double.h"
#include "pair.h"
#include "exact_sign.h"
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum {
    CHANNELS = 3,
    POINTS = 128,   /* points shaded together: their arrays stay in the cache nearest to the processor */
    LANES = 8,      /* runs begin at its multiples, and loops end there: nobody reads what lies between two runs */
    ROWS = 8,       /* rows whose spans are worked out side by side */
    LINE = 64       /* bytes of a line of the cache: a vector that straddles two takes twice as long */
};

typedef scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_scene scene_type;
typedef scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_frame frame;
typedef scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_layers layer_set;

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
    double p_x[POINTS], p_y[POINTS], p_z[POINTS];   /* from its receiver's origin, in its unit: a sphere's normal */
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
    double blur[POINTS];      /* how far rounding moves it, in units of GRAIN; on a sphere: 1 */
    double p_x_low[POINTS], p_y_low[POINTS], p_z_low[POINTS];   /* what rounding left of the point, */
    double mirror_x_low[POINTS], mirror_y_low[POINTS], mirror_z_low[POINTS];   /* and of the ray mirrored there; */
    double turn[POINTS];      /* how far both may be off still, in units of 2^-100 */
    double nearest[POINTS];   /* the distance of what is seen in this point's mirror, in lengths of its ray, */
    ptrdiff_t seen[POINTS];   /* and which receiver it is, in a number as wide; -1: none */
    double weight[POINTS];    /* how much of this point is added */
    int from[POINTS];         /* to which one that sees it in its mirror */
    double ordinal[POINTS];   /* 0, 1, 2, ...: to count in vectors of the same length as all others */
    int count, runs;
    run run[POINTS];
} points;

/* Rounding moves a point that the eye sees by far less than this, in the unit of its receiver. */
static const double GRAIN = 0x1p-44;

/* Units of 2^-53 that an intensity of at most 1 may be off: below 1e-15. */
static const double MOST_ROUNDOFFS = 9.1;

/* Units of 2^-100 that a mirrored point and its ray may be off: far below what rounding them does. */
static const double MOST_TURN = 0x1.0000000000000p+40;

static inline double least(double a, double b)
{
    return a < b ? a : b;
}

/* ---- spheres before the eye: their pixels in a row are one span ---- */

/* What does not change within a frame. */
typedef struct {
    double plane_unit, focal, d_dot_d_frame, tilt_frame, eye;
    double_double focal2, full_d_dot_d_frame, full_tilt_frame;
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

    /* ray and sphere [1 mul 1 call] */
    const double d_dot_d_frame = focal * focal;   /* what is the same for a frame in d_dot_d */
    /* what is the same for a frame in full_d_dot_d */
    const double_double full_d_dot_d_frame = dd_product(focal, focal);

    /* normal [1 div 3 call] */
    const double tilt_frame = 1.0 / focal;   /* what is the same for a frame in tilt */
    /* what is the same for a frame in full_tilt */
    const double_double full_tilt_frame = dd_div(dd_from(1.0), dd_from(focal));

    const span_frame carried = {
        .plane_unit = plane_unit,
        .focal = focal,
        .focal2 = focal2,
        .d_dot_d_frame = d_dot_d_frame,
        .full_d_dot_d_frame = full_d_dot_d_frame,
        .tilt_frame = tilt_frame,
        .full_tilt_frame = full_tilt_frame,
        .eye = scene->eye,
    };
    return carried;
}

/* What does not change within a sphere. */
typedef struct {
    double_double offset_y, alpha, depth, offset_x, row_mid_sphere, row_gap_sphere, row_half_sphere, x_left_sphere,
        image_x, image_y, power;
    double row_low, row_high, ahead_sphere, turned_sphere;
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
    const double_double share_6 = dd_mul_double(offset_y, f->focal);
    const double_double row_gap_sphere = dd_neg(share_6);   /* what is the same for a sphere in row_gap */
    const double_double share_7 = dd_add(alpha, dd_mul(offset_x, offset_x));
    const double_double row_half_sphere = share_7;   /* what is the same for a sphere in row_half */
    const double_double x_left_sphere = dd_div(dd_from(1.0), alpha);   /* what is the same for a sphere in x_left */
    /* where the centre appears on the image plane */
    const double_double image_x = dd_div(dd_mul_double(offset_x, f->focal), depth);
    const double_double image_y = dd_div(share_6, depth);
    /* kappa^2 - 1 */
    const double height2 = (distance.hi - radius + distance.lo) * (radius + distance.hi + distance.lo)
        / (radius * radius);
    const double share_2 = offset_y.hi * depth.hi;
    const double share_3 = sqrt(alpha.hi > 0.0 ? alpha.hi : 0.0);
    const double share_4 = f->focal / height2;
    const double row_low = (share_2 - share_3) * share_4;   /* the rows that meet the silhouette: row_disc = 0 */
    const double row_high = (share_2 + share_3) * share_4;

    /* distance [1 mul] */
    const double_double power = share_7;   /* |m|^2 - 1: the power of the eye in radii, squared */
    const double ahead_sphere = f->focal * depth.hi;   /* what is the same for a sphere in ahead */

    /* margin [2 add 1 sqrt 1 max] */
    /* what is the same for a sphere in turned */
    const double turned_sphere = sqrt(1.0 + power.hi + power.lo > 0.0 ? 1.0 + power.hi + power.lo : 0.0);

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
        .turned_sphere = turned_sphere,
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
    double_double x_left, x_right, full_s_row, full_tilt_row, full_n_y_row, full_n_z_row;
} span_row;

SYMRENDER_INLINE span_row span_row_of(double y, span_ends ends, const span_sphere *ball, const span_frame *f)
{
    /* ray and sphere [1 mul 1 call] */
    const double y2 = y * y;
    const double_double full_s_row = dd_product(y, y);   /* what is the same for a row in full_s */

    /* normal [3 mul 2 add 5 call] */
    const double dy = y - ball->image_y.hi - ball->image_y.lo;
    const double_double full_dy = dd_add_double(dd_neg(ball->image_y), y);
    const double tilt_row = ball->image_x.hi * dy;   /* what is the same for a row in tilt */
    const double_double full_tilt_row = dd_mul(ball->image_x, full_dy);   /* what is the same for a row in full_tilt */
    const double n_y_row = f->focal * dy;   /* what is the same for a row in n_y */
    const double_double full_n_y_row = dd_mul_double(full_dy, f->focal);   /* what is the same for a row in full_n_y */
    const double n_z_row = y * dy;   /* what is the same for a row in n_z */
    const double_double full_n_z_row = dd_mul_double(full_dy, y);   /* what is the same for a row in full_n_z */

    /* distance [1 mul] */
    const double ahead_row = y * ball->offset_y.hi;   /* what is the same for a row in ahead */

    const span_row carried = {
        .y = y,
        .x_left = ends.x_left,
        .x_right = ends.x_right,
        .y2 = y2,
        .full_s_row = full_s_row,
        .tilt_row = tilt_row,
        .full_tilt_row = full_tilt_row,
        .n_y_row = n_y_row,
        .full_n_y_row = full_n_y_row,
        .n_z_row = n_z_row,
        .full_n_z_row = full_n_z_row,
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
    const double share_1 = sqrt(d_dot_d);
    /* |P - E| in radii: the nearer root as a quotient, free of cancellation */
    const double hit_distance = ball->power.hi * share_1 / (facing + ahead);

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

        /* ray and sphere [3 mul 6 add 1 sqrt 1 max 10 call] */
        /* distance to the two ends of the span, not negative inside it */
        const double from_left = x - r->x_left.hi - r->x_left.lo;
        const double_double full_from_left = dd_add_double(dd_neg(r->x_left), x);
        const double to_right = r->x_right.hi - x + r->x_right.lo;
        const double_double full_to_right = dd_add_double(r->x_right, -x);
        const double chord = from_left * to_right;
        const double_double full_chord = pair_mul(full_from_left, full_to_right);
        /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
        const double facing2 = ball->alpha.hi * chord;
        const double_double full_facing2 = pair_mul(ball->alpha, full_chord);
        const double s = x * x + r->y2;   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
        const double_double full_s = pair_add(dd_product(x, x), r->full_s_row);
        const double d_dot_d = s + f->d_dot_d_frame;
        const double_double full_d_dot_d = pair_add(full_s, f->full_d_dot_d_frame);
        /* -n.D, how far the surface faces the ray: root / R */
        const double facing = sqrt(facing2 > 0.0 ? facing2 : 0.0);
        const double_double full_facing = pair_sqrt(pair_positive_part(full_facing2));

        /* normal [15 mul 15 add 1 div 25 call] */
        const double inv_d2 = 1.0 / d_dot_d;
        const double_double full_inv_d2 = pair_inverse(full_d_dot_d);
        const double dx = x - ball->image_x.hi - ball->image_x.lo;   /* the pixel seen from the image of the centre */
        const double_double full_dx = pair_add_double(dd_neg(ball->image_x), x);
        const double tilt = f->tilt_frame * (r->tilt_row - dx * ball->image_y.hi);
        const double_double full_tilt = pair_mul(f->full_tilt_frame,
            pair_sub(r->full_tilt_row, pair_mul(full_dx, ball->image_y)));
        /* the foot point (D x (D x m)) / |D|^2 lies on the ray, nearest to the centre; n is it less facing D /
         * |D|^2 */
        const double n_x = inv_d2 * (ball->depth.hi * (f->focal * dx - r->y * tilt) - x * facing);
        const double_double full_n_x = pair_mul(full_inv_d2,
            pair_sub(pair_mul(ball->depth,
            pair_sub(pair_mul_double(full_dx, f->focal), pair_mul_double(full_tilt, r->y))),
            pair_mul_double(full_facing, x)));
        const double n_x_low = full_n_x.hi - n_x + full_n_x.lo;   /* what rounding left */
        const double n_y = inv_d2 * (ball->depth.hi * (x * tilt + r->n_y_row) - r->y * facing);
        const double_double full_n_y = pair_mul(full_inv_d2,
            pair_sub(pair_mul(ball->depth, pair_add(pair_mul_double(full_tilt, x), r->full_n_y_row)),
            pair_mul_double(full_facing, r->y)));
        const double n_y_low = full_n_y.hi - n_y + full_n_y.lo;
        const double n_z = inv_d2 * (f->focal * facing + ball->depth.hi * (x * dx + r->n_z_row));
        const double_double full_n_z = pair_mul(full_inv_d2,
            pair_add(pair_mul_double(full_facing, f->focal),
            pair_mul(ball->depth, pair_add(pair_mul_double(full_dx, x), r->full_n_z_row))));
        const double n_z_low = full_n_z.hi - n_z + full_n_z.lo;

        /* specular [4 mul 9 add 7 call] */
        const double bounce = 2.0 * facing;
        const double_double full_bounce = dd_scale(full_facing, 2.0);
        /* the primary ray mirrored at the surface, D + 2 facing n, as long as D */
        const double mirror_x = x + n_x * bounce;
        const double_double full_mirror_x = pair_add_double(pair_mul(full_n_x, full_bounce), x);
        const double mirror_x_low = full_mirror_x.hi - mirror_x + full_mirror_x.lo;
        const double mirror_y = r->y + n_y * bounce;
        const double_double full_mirror_y = pair_add_double(pair_mul(full_n_y, full_bounce), r->y);
        const double mirror_y_low = full_mirror_y.hi - mirror_y + full_mirror_y.lo;
        const double mirror_z = n_z * bounce - f->focal;
        const double_double full_mirror_z = pair_add_double(pair_mul(full_n_z, full_bounce), -f->focal);
        const double mirror_z_low = full_mirror_z.hi - mirror_z + full_mirror_z.lo;

        /* distance [1 sqrt] */
        const double share_1 = sqrt(d_dot_d);

        /* margin [1 mul 1 div] */
        /* at grazing rays, and far away, two words are less exact */
        const double turned = share_1 * ball->turned_sphere / facing;

        p->n_x[at + i] = n_x;
        p->n_y[at + i] = n_y;
        p->n_z[at + i] = n_z;
        p->p_x[at + i] = n_x;
        p->p_y[at + i] = n_y;
        p->p_z[at + i] = n_z;
        p->mirror_x[at + i] = mirror_x;
        p->mirror_y[at + i] = mirror_y;
        p->mirror_z[at + i] = mirror_z;
        p->inv_d2[at + i] = inv_d2;
        p->turn[at + i] = turned;
        p->p_x_low[at + i] = n_x_low;
        p->p_y_low[at + i] = n_y_low;
        p->p_z_low[at + i] = n_z_low;
        p->mirror_x_low[at + i] = mirror_x_low;
        p->mirror_y_low[at + i] = mirror_y_low;
        p->mirror_z_low[at + i] = mirror_z_low;
    }
}

/* ---- the ground plane ---- */

/* What does not change within a frame. */
typedef struct {
    double plane_unit, focal, descent_frame, focal2, n_x, n_y, n_z, margin_frame, plane_x, plane_y, plane_z;
    double_double full_plane_x, full_plane_y, full_plane_z, full_descent_frame;
} plane_frame;

static plane_frame plane_frame_of(const scene_type *scene)
{
    /* units of length, powers of two [2 call] */
    const int plane_exponent = unit_exponent(scene->eye);   /* f = e 2^k in [1, 2) */
    const double plane_unit = ldexp(1, plane_exponent);

    /* inputs in full [3 call] */
    const double_double full_plane_x = dd_sum(scene->plane_x, scene->plane_x_low);
    const double_double full_plane_y = dd_sum(scene->plane_y, scene->plane_y_low);
    const double_double full_plane_z = dd_sum(scene->plane_z, scene->plane_z_low);

    /* ground plane [2 mul 2 call] */
    /* rays D = (x, y, -f): f is e, in the unit of the image plane */
    const double focal = ldexp(scene->eye, plane_exponent);
    const double descent_frame = scene->plane_z * focal;   /* what is the same for a frame in descent */
    /* what is the same for a frame in full_descent */
    const double_double full_descent_frame = dd_mul_double(full_plane_z, focal);
    const double focal2 = focal * focal;
    const double n_x = scene->plane_x;   /* its normal, towards the eye */
    const double n_y = scene->plane_y;
    const double n_z = scene->plane_z;

    /* margin [1 mul] */
    const double margin_frame = -(5.684341886080802e-14 * focal);   /* what is the same for a frame in margin */

    const plane_frame carried = {
        .plane_unit = plane_unit,
        .full_plane_x = full_plane_x,
        .full_plane_y = full_plane_y,
        .full_plane_z = full_plane_z,
        .focal = focal,
        .descent_frame = descent_frame,
        .full_descent_frame = full_descent_frame,
        .focal2 = focal2,
        .n_x = n_x,
        .n_y = n_y,
        .n_z = n_z,
        .margin_frame = margin_frame,
        .plane_x = scene->plane_x,
        .plane_y = scene->plane_y,
        .plane_z = scene->plane_z,
    };
    return carried;
}

/* What does not change within a row. */
typedef struct {
    double y, descent_row, y2, margin_row;
    double_double full_descent_row;
} plane_row;

SYMRENDER_INLINE plane_row plane_row_of(double y, const plane_frame *f)
{
    /* ground plane [2 mul 2 call] */
    const double descent_row = -(f->plane_y * y);   /* what is the same for a row in descent */
    /* what is the same for a row in full_descent */
    const double_double full_descent_row = dd_neg(dd_mul_double(f->full_plane_y, y));
    const double y2 = y * y;

    /* margin [1 mul 1 call] */
    const double margin_row = -(5.684341886080802e-14 * fabs(y));   /* what is the same for a row in margin */

    const plane_row carried = {
        .y = y,
        .descent_row = descent_row,
        .full_descent_row = full_descent_row,
        .y2 = y2,
        .margin_row = margin_row,
    };
    return carried;
}

/* The distance of the hit from the eye, in heights of the eye above the plane; infinite where there is none. */
static inline double plane_distance(double x, const plane_row *r, const plane_frame *f)
{
    /* ground plane [2 mul 4 add 1 div 1 sqrt] */
    /* -n.D: the ray meets the plane where it is positive */
    const double descent = f->descent_frame + r->descent_row - f->plane_x * x;
    const double d_dot_d = x * x + f->focal2 + r->y2;   /* |D|^2 */
    const double hit_distance = sqrt(d_dot_d) / descent;   /* |P - E| */

    return descent > 0.0 ? hit_distance : INFINITY;
}

/* Fills the arrays for a run of points, the i-th of them at x = (first + i) step. */
static void plane_surface(points *p, int at, int count, double first, double step,
    const plane_row *r, const plane_frame *f)
{
    for (int i = 0; i < padded(count); ++i) {
        const double x = (first + p->ordinal[i]) * step;

        /* ground plane [6 mul 19 add 4 div 17 call] */
        /* -n.D: the ray meets the plane where it is positive */
        const double descent = f->descent_frame + r->descent_row - f->plane_x * x;
        const double_double full_descent = pair_sub(pair_add(f->full_descent_frame, r->full_descent_row),
            pair_mul_double(f->full_plane_x, x));
        const double p_x = x / descent;   /* P - E = D / -n.D, in heights of the eye above the plane */
        const double_double full_p_x = pair_div(dd_from(x), full_descent);
        const double p_x_low = full_p_x.hi - p_x + full_p_x.lo;   /* what rounding left */
        const double p_y = r->y / descent;
        const double_double full_p_y = pair_div(dd_from(r->y), full_descent);
        const double p_y_low = full_p_y.hi - p_y + full_p_y.lo;
        const double p_z = -(f->focal / descent);
        const double_double full_p_z = dd_neg(pair_div(dd_from(f->focal), full_descent));
        const double p_z_low = full_p_z.hi - p_z + full_p_z.lo;
        const double d_dot_d = x * x + f->focal2 + r->y2;   /* |D|^2 */
        const double inv_d2 = 1.0 / d_dot_d;
        const double bounce = 2.0 * descent;
        const double_double full_bounce = dd_scale(full_descent, 2.0);
        const double mirror_x = x + f->plane_x * bounce;   /* the ray mirrored at the plane */
        const double_double full_mirror_x = pair_add_double(pair_mul(f->full_plane_x, full_bounce), x);
        const double mirror_x_low = full_mirror_x.hi - mirror_x + full_mirror_x.lo;
        const double mirror_y = r->y + f->plane_y * bounce;
        const double_double full_mirror_y = pair_add_double(pair_mul(f->full_plane_y, full_bounce), r->y);
        const double mirror_y_low = full_mirror_y.hi - mirror_y + full_mirror_y.lo;
        const double mirror_z = f->plane_z * bounce - f->focal;
        const double_double full_mirror_z = pair_add_double(pair_mul(f->full_plane_z, full_bounce), -f->focal);
        const double mirror_z_low = full_mirror_z.hi - mirror_z + full_mirror_z.lo;

        /* margin [3 mul 3 add] */
        /* far away rounding moves the point along the ray by |p|^2 */
        const double blurred = 1.0 + p_x * p_x + p_y * p_y + p_z * p_z;
        const double turned = blurred;   /* and so what two words leave */

        p->n_x[at + i] = f->n_x;
        p->n_y[at + i] = f->n_y;
        p->n_z[at + i] = f->n_z;
        p->p_x[at + i] = p_x;
        p->p_y[at + i] = p_y;
        p->p_z[at + i] = p_z;
        p->mirror_x[at + i] = mirror_x;
        p->mirror_y[at + i] = mirror_y;
        p->mirror_z[at + i] = mirror_z;
        p->inv_d2[at + i] = inv_d2;
        p->blur[at + i] = blurred;
        p->turn[at + i] = turned;
        p->p_x_low[at + i] = p_x_low;
        p->p_y_low[at + i] = p_y_low;
        p->p_z_low[at + i] = p_z_low;
        p->mirror_x_low[at + i] = mirror_x_low;
        p->mirror_y_low[at + i] = mirror_y_low;
        p->mirror_z_low[at + i] = mirror_z_low;
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
        if (k >= scene->spheres)
            away = fabs(
                1.0 + scene->plane_x * l->lamp_x + scene->plane_y * l->lamp_y + scene->plane_z * l->lamp_z);
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

struct scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_frame {
    const scene_type *scene;
    symrender_grid grid;
    double white;
    span_frame span;
    span_sphere *spans;   /* [visible] */
    plane_frame plane;
    int *row_first, *row_last;   /* [visible] the rows that may show a sphere */
    lamp *lamps;
    int *half_exponents;   /* [receivers] n / 2 where n is an even whole number, else 0 */
    double tile_keen;             /* what GRAIN is of a tile */
};

/* w from every point of the run to its lamp. */
static void reach(points *p, const run *r, const lamp *l)
{
    const double lamp_x = l->lamp_x, lamp_y = l->lamp_y, lamp_z = l->lamp_z, nearness = l->nearness;
    for (int i = r->at; i < r->at + padded(r->count); ++i) {
        /* light [6 mul 5 add] */
        /* w = (L - P) in the receiver's unit; nearness is 0 for a light in parallel, else 1 */
        const double w_x = lamp_x - nearness * p->p_x[i];
        const double w_y = lamp_y - nearness * p->p_y[i];
        const double w_z = lamp_z - nearness * p->p_z[i];
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
            const double b_x = gap_x - p->p_x[i];   /* b, the blocker's centre seen from the point */
            const double b_y = gap_y - p->p_y[i];
            const double b_z = gap_z - p->p_z[i];
            const double cross_x = p->w_z[i] * b_y - p->w_y[i] * b_z;   /* b x w */
            const double cross_y = p->w_x[i] * b_z - p->w_z[i] * b_x;
            const double cross_z = p->w_y[i] * b_x - p->w_x[i] * b_y;
            const double toward = p->w_x[i] * b_x + p->w_y[i] * b_y + p->w_z[i] * b_z;   /* b.w */
            /* positive where the line to the light meets the blocker */
            const double inside2 = ratio2 * p->w2[i] - cross_x * cross_x - cross_y * cross_y - cross_z * cross_z;
            /* no light where it does so between point and light */
            const double shade = (((inside2 > 0.0) & (toward > 0.0)) & (far * p->w2[i] - toward > 0.0)) ? 0.0
                : p->light[i];

            /* margin [6 mul 3 add 1 call] */
            const double b2 = b_x * b_x + b_y * b_y + b_z * b_z;   /* |b|^2, at least ratio^2 */
            const double margin = fabs(inside2) - p->blur[i] * keen * p->w2[i] * b2;   /* not above 0: in doubt */

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
static void accumulate(points *p, const run *r, const lamp *l)
{
    if (l->terms & GATED) {
        const double keen = l->keen;

        for (int i = r->at; i < r->at + padded(r->count); ++i) {
            /* gate [3 mul 2 add] */
            /* |w| n.l */
            const double n_dot_w = p->n_x[i] * p->w_x[i] + p->n_y[i] * p->w_y[i] + p->n_z[i] * p->w_z[i];

            /* margin [4 mul 1 add] */
            const double keen_here = p->blur[i] * keen;
            const double margin = n_dot_w * n_dot_w - p->w2[i] * (keen_here * keen_here);   /* not above 0: in doubt */

            const double sure = p->lobe[i] > 0.0 ? margin : INFINITY;
            p->margin[i] = least(sure, p->margin[i]);
            p->lobe[i] = p->cosine[i] > 0.0 ? p->lobe[i] : 0.0;
        }
    }
    const double matte_error = l->matte_error, gloss_error = l->gloss_error, steepness = l->steepness;
    const int end = r->at + padded(r->count);
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

/* How far up a direction points: 0 straight down, 1 straight up. */
static inline double height_of(const scene_type *scene, double d_x, double d_y, double d_z)
{
    const double up_x = scene->up_x, up_y = scene->up_y, up_z = scene->up_z;
    /* background [7 mul 5 add 1 div 1 sqrt] */
    /* sine of the elevation */
    const double climb = (d_x * up_x + d_y * up_y + d_z * up_z) / sqrt(d_x * d_x + d_y * d_y + d_z * d_z);
    const double height = 0.5 + 0.5 * climb;   /* 0 straight down, 1 straight up */

    return height;
}

/* A channel of the background at that height. */
static inline double backdrop(const scene_type *scene, double height, int c)
{
    const double bottom = scene->background[c], top = scene->background_top[c];
    return bottom + height * (top - bottom);
}

/* Which of the plane's two materials is at a point of it: 0 on even tiles, 1 on odd ones. */
static inline int parity_of(double p_x, double p_y, double p_z, double blur, double *sure, const frame *h)
{
    const scene_type *scene = h->scene;
    const double keen = h->tile_keen;
    const double across_x = scene->across_x, across_y = scene->across_y, across_z = scene->across_z;
    const double along_x = scene->along_x, along_y = scene->along_y, along_z = scene->along_z;
    const double across_0 = scene->across_0, along_0 = scene->along_0;
    /* tiles [8 mul 8 add 3 call] */
    const double share_1 = across_x * p_x + across_y * p_y + across_z * p_z;
    const double tile_u = floor(across_0 + share_1);   /* number of the tile across */
    const double share_2 = along_x * p_x + along_y * p_y + along_z * p_z;
    const double tile_v = floor(along_0 + share_2);   /* and along the axis */
    const double tile = tile_u + tile_v;
    const double parity = tile - 2.0 * floor(0.5 * tile);   /* even: 0, odd: 1 */

    /* margin [1 mul 8 add 1 max 2 call] */
    const double from_middle_frame = across_0 - 0.5;   /* what is the same for a frame in from_middle */
    const double from_middle_frame_1 = along_0 - 0.5;   /* what is the same for a frame in from_middle */
    /* from the middle of the tile, 1/2 at its edge */
    const double from_middle = fabs(share_1 + from_middle_frame - tile_u) > fabs(share_2 + from_middle_frame_1
        - tile_v) ? fabs(share_1 + from_middle_frame - tile_u) : fabs(share_2 + from_middle_frame_1 - tile_v);
    const double margin = 0.5 - blur * keen - from_middle;   /* not above 0: in doubt */

    *sure = least(margin, *sure);
    return parity > 0.5;
}

static void shade(points *p, const frame *h, int bounces, const layer_set *layers, size_t pixel, size_t pixels);

/* Where the rays mirrored at a run's points meet sphere k, if that is nearer than what they met before. */
static void find_in_mirror(points *p, const run *q, int k, const scene_type *scene)
{
    const int of = q->receiver;
    const double reach = scene->radius[k], shrink = scene->radius[of] / reach;
    const double link_x = (scene->center_x[k] - scene->center_x[of]) / reach;
    const double link_y = (scene->center_y[k] - scene->center_y[of]) / reach;
    const double link_z = (scene->center_z[k] - scene->center_z[of]) / reach;
    const double keen = 2.0 * GRAIN * (2.0 * shrink + sqrt(link_x * link_x + link_y * link_y + link_z * link_z));
    for (int i = q->at, end = q->at + q->count; i < end; ++i) {
        /* mirrored ray and sphere [22 mul 17 add 1 div 1 sqrt 1 max]. Lagrange's identity |m|^2 |D|^2 - (m.D)^2 =
         * |m x D|^2 */
        const double m_x = link_x - p->p_x[i] * shrink;   /* m, the centre seen from the point, in radii */
        const double m_y = link_y - p->p_y[i] * shrink;
        const double m_z = link_z - p->p_z[i] * shrink;
        const double cross_x = p->mirror_z[i] * m_y - p->mirror_y[i] * m_z;   /* m x d, with d the mirrored ray */
        const double cross_y = p->mirror_x[i] * m_z - p->mirror_z[i] * m_x;
        const double cross_z = p->mirror_y[i] * m_x - p->mirror_x[i] * m_y;
        /* |d|^2 */
        const double d2 = p->mirror_x[i] * p->mirror_x[i] + p->mirror_y[i] * p->mirror_y[i] + p->mirror_z[i]
            * p->mirror_z[i];
        /* disc / R^2: a hit where >= 0 and m.d > 0 */
        const double disc = d2 - cross_x * cross_x - cross_y * cross_y - cross_z * cross_z;
        const double ahead = p->mirror_x[i] * m_x + p->mirror_y[i] * m_y + p->mirror_z[i] * m_z;   /* m.d */
        const double facing = sqrt(disc > 0.0 ? disc : 0.0);   /* -n.d */
        /* distance in lengths of d */
        const double t = reach * (m_x * m_x + m_y * m_y + m_z * m_z - 1.0) / (ahead + facing);

        /* margin [2 mul 2 add 1 call] */
        const double margin = fabs(disc) - keen * (1.0 + p->blur[i]) * d2;   /* not above 0: in doubt */

        const int is_nearer = (disc >= 0.0) & (ahead > 0.0) & (t < p->nearest[i]);
        const int is_tie = (disc >= 0.0) & (ahead > 0.0) & (fabs(t - p->nearest[i]) < 0x1p-24 * t);
        p->margin[i] = is_tie ? 0.0 : (ahead > 0.0 ? least(margin, p->margin[i]) : p->margin[i]);
        p->nearest[i] = is_nearer ? t : p->nearest[i];
        p->seen[i] = is_nearer ? k : p->seen[i];
    }
}

/* Normal and next mirrored ray of a new run: where the rays of the points that it is seen in meet its sphere. */
static void arrive(
    points *restrict child, const run *q, const points *restrict p, int of, const scene_type *scene)
{
    const int k = q->receiver;
    /* inputs in full [1 call] */
    const double_double full_own_radius = dd_sum(scene->radius[of], scene->radius_low[of]);

    /* from sphere to sphere [11 call] */
    /* the centre seen from the mirror's, in radii */
    const double_double link_x = dd_div(dd_difference(scene->center_x[k], scene->center_x[of]),
        dd_from(scene->radius[k]));
    const double_double link_y = dd_div(dd_difference(scene->center_y[k], scene->center_y[of]),
        dd_from(scene->radius[k]));
    const double_double link_z = dd_div(dd_difference(scene->center_z[k], scene->center_z[of]),
        dd_from(scene->radius[k]));
    const double_double shrink = dd_div(full_own_radius, dd_from(scene->radius[k]));   /* the mirror's unit in radii */
    for (int j = q->at; j < q->at + padded(q->count); ++j) {
        const int i = child->from[j];
        /* inputs in full [6 call] */
        const double_double full_p_x = dd_sum(p->p_x[i], p->p_x_low[i]);   /* both words */
        const double_double full_p_y = dd_sum(p->p_y[i], p->p_y_low[i]);
        const double_double full_p_z = dd_sum(p->p_z[i], p->p_z_low[i]);
        const double_double full_mirror_x = dd_sum(p->mirror_x[i], p->mirror_x_low[i]);
        const double_double full_mirror_y = dd_sum(p->mirror_y[i], p->mirror_y_low[i]);
        const double_double full_mirror_z = dd_sum(p->mirror_z[i], p->mirror_z_low[i]);

        /* mirrored ray and sphere [28 call]. Lagrange's identity |m|^2 |D|^2 - (m.D)^2 = |m x D|^2 */
        /* m, the centre seen from the point, in radii */
        const double_double m_x = pair_sub(link_x, pair_mul(full_p_x, shrink));
        const double_double m_y = pair_sub(link_y, pair_mul(full_p_y, shrink));
        const double_double m_z = pair_sub(link_z, pair_mul(full_p_z, shrink));
        /* m x d, with d the mirrored ray */
        const double_double cross_x = pair_sub(pair_mul(full_mirror_z, m_y), pair_mul(full_mirror_y, m_z));
        const double_double cross_y = pair_sub(pair_mul(full_mirror_x, m_z), pair_mul(full_mirror_z, m_x));
        const double_double cross_z = pair_sub(pair_mul(full_mirror_y, m_x), pair_mul(full_mirror_x, m_y));
        /* |d|^2 */
        const double_double d2 = pair_add(pair_add(pair_square(full_mirror_x), pair_square(full_mirror_y)),
            pair_square(full_mirror_z));
        /* disc / R^2: a hit where >= 0 and m.d > 0 */
        const double_double disc = pair_sub(pair_sub(pair_sub(d2, pair_square(cross_x)), pair_square(cross_y)),
            pair_square(cross_z));
        const double_double facing = pair_sqrt(pair_positive_part(disc));   /* -n.d */

        /* normal [32 call] */
        const double_double inv_d2 = pair_inverse(d2);
        /* the foot point -(d x (m x d)) / |d|^2 lies on the ray, nearest to the centre */
        const double_double loose_n_x = pair_mul(pair_sub(pair_sub(pair_mul(full_mirror_z, cross_y),
            pair_mul(full_mirror_y, cross_z)), pair_mul(full_mirror_x, facing)), inv_d2);
        const double_double n_x = pair_normalised(loose_n_x);
        const double_double loose_n_y = pair_mul(pair_sub(pair_sub(pair_mul(full_mirror_x, cross_z),
            pair_mul(full_mirror_z, cross_x)), pair_mul(full_mirror_y, facing)), inv_d2);
        const double_double n_y = pair_normalised(loose_n_y);
        const double_double loose_n_z = pair_mul(pair_sub(pair_sub(pair_mul(full_mirror_y, cross_x),
            pair_mul(full_mirror_x, cross_y)), pair_mul(full_mirror_z, facing)), inv_d2);
        const double_double n_z = pair_normalised(loose_n_z);
        const double_double bounce = dd_scale(facing, 2.0);
        /* d mirrored at the surface, d + 2 facing n */
        const double_double loose_next_x = pair_add(full_mirror_x, pair_mul(n_x, bounce));
        const double_double next_x = pair_normalised(loose_next_x);
        const double_double loose_next_y = pair_add(full_mirror_y, pair_mul(n_y, bounce));
        const double_double next_y = pair_normalised(loose_next_y);
        const double_double loose_next_z = pair_add(full_mirror_z, pair_mul(n_z, bounce));
        const double_double next_z = pair_normalised(loose_next_z);

        /* margin [14 mul 8 add 2 div 1 sqrt 1 max] */
        const double d_size = sqrt(d2.hi > 0.0 ? d2.hi : 0.0);   /* |d| */
        const double ahead = p->mirror_x[i] * m_x.hi + p->mirror_y[i] * m_y.hi + p->mirror_z[i] * m_z.hi;   /* m.d */
        /* the ray's way, in radii */
        const double travelled = (m_x.hi * m_x.hi + m_y.hi * m_y.hi + m_z.hi * m_z.hi - 1.0) * d_size
            / (facing.hi + ahead);
        /* how far what two words leave moves the new point: more at grazing rays */
        const double turned = 1.0 + d_size
            * (0.25 * 3.0 * p->turn[i] * shrink.hi + 0.5 * 3.0 * p->turn[i] * travelled) / facing.hi;

        child->n_x[j] = n_x.hi;
        child->n_y[j] = n_y.hi;
        child->n_z[j] = n_z.hi;
        child->mirror_x[j] = next_x.hi;
        child->mirror_y[j] = next_y.hi;
        child->mirror_z[j] = next_z.hi;
        child->p_x[j] = n_x.hi;
        child->p_y[j] = n_y.hi;
        child->p_z[j] = n_z.hi;
        child->inv_d2[j] = inv_d2.hi;
        child->p_x_low[j] = n_x.lo;
        child->p_y_low[j] = n_y.lo;
        child->p_z_low[j] = n_z.lo;
        child->mirror_x_low[j] = next_x.lo;
        child->mirror_y_low[j] = next_y.lo;
        child->mirror_z_low[j] = next_z.lo;
        child->blur[j] = 1.0;
        child->turn[j] = turned;
        child->margin[j] = turned < MOST_TURN ? INFINITY : 0.0;
    }
}

/* Where the rays mirrored at a run's points meet the plane, if that is nearer than what they met before. */
static void find_plane_in_mirror(points *p, const run *q, const frame *h)
{
    const scene_type *scene = h->scene;
    const int of = q->receiver;
    const double plane_x = scene->plane_x, plane_y = scene->plane_y, plane_z = scene->plane_z;
    const double height = scene->radius[scene->spheres], scale = scene->radius[of] / height;
    const double origin_x = (scene->center_x[of] - scene->center_x[scene->spheres]) / height;
    const double origin_y = (scene->center_y[of] - scene->center_y[scene->spheres]) / height;
    const double origin_z = (scene->center_z[of] - scene->center_z[scene->spheres]) / height;
    for (int i = q->at, end = q->at + q->count; i < end; ++i) {
        /* mirrored ray and plane [13 mul 11 add 1 div] */
        const double o_x = origin_x + p->p_x[i] * scale;   /* the point seen from the eye */
        const double o_y = origin_y + p->p_y[i] * scale;
        const double o_z = origin_z + p->p_z[i] * scale;
        /* -n.d: the ray meets the plane where it is positive */
        const double descent = -(p->mirror_x[i] * plane_x) - (p->mirror_y[i] * plane_y + p->mirror_z[i] * plane_z);
        /* height over descent */
        const double t_plane = (1.0 + plane_x * o_x + plane_y * o_y + plane_z * o_z) / descent;
        const double t = height * t_plane;   /* distance in lengths of d */
        const double foot_x = o_x + p->mirror_x[i] * t_plane;   /* where it meets the plane, seen from the eye */
        const double foot_y = o_y + p->mirror_y[i] * t_plane;
        const double foot_z = o_z + p->mirror_z[i] * t_plane;

        /* margin [8 mul 5 add 1 div 4 call] */
        const double d_size = fabs(p->mirror_x[i]) + fabs(p->mirror_y[i]) + fabs(p->mirror_z[i]);   /* at least |d| */
        const double travelled = t_plane * d_size;   /* the ray's way, in heights */
        const double margin = fabs(descent) - 5.684341886080802e-14 * d_size;   /* not above 0: in doubt */
        /* rounding moves the ray aside */
        const double drifted = 1.0 + 0.25 * 3.0 * p->blur[i] * scale + 0.5 * 3.0 * travelled;
        const double blurred = d_size * drifted / descent;   /* and so the foot, along the plane */

        const int is_nearer = (descent > 0.0) & (t < p->nearest[i]);
        const int is_tie = (descent > 0.0) & (fabs(t - p->nearest[i]) < 0x1p-24 * t);
        p->margin[i] = is_tie ? 0.0 : least(margin, p->margin[i]);
        p->nearest[i] = is_nearer ? t : p->nearest[i];
        double sure = p->margin[i];
        const int tile = parity_of(foot_x, foot_y, foot_z, blurred, &sure, h);
        p->margin[i] = is_nearer ? sure : p->margin[i];
        p->seen[i] = is_nearer ? scene->spheres + tile : p->seen[i];
    }
}

/* Point and next mirrored ray where rays of the points above meet the plane. */
static void arrive_on_plane(
    points *restrict child, const run *q, const points *restrict p, int of, const scene_type *scene)
{
    /* inputs in full [5 call] */
    const double_double full_plane_x = dd_sum(scene->plane_x, scene->plane_x_low);   /* both words */
    const double_double full_plane_y = dd_sum(scene->plane_y, scene->plane_y_low);
    const double_double full_plane_z = dd_sum(scene->plane_z, scene->plane_z_low);
    const double_double full_height = dd_sum(scene->radius[scene->spheres], scene->radius_low[scene->spheres]);
    const double_double full_own_radius = dd_sum(scene->radius[of], scene->radius_low[of]);

    /* from sphere to plane [7 call] */
    /* the mirror's centre seen from the eye, in heights */
    const double_double origin_x = dd_div(dd_from(scene->center_x[of]), full_height);
    const double_double origin_y = dd_div(dd_from(scene->center_y[of]), full_height);
    const double_double origin_z = dd_div(dd_difference(scene->center_z[of], scene->center_z[scene->spheres]),
        full_height);
    const double_double scale = dd_div(full_own_radius, full_height);   /* the mirror's unit in heights */
    for (int j = q->at; j < q->at + padded(q->count); ++j) {
        const int i = child->from[j];
        /* inputs in full [6 call] */
        const double_double full_p_x = dd_sum(p->p_x[i], p->p_x_low[i]);
        const double_double full_p_y = dd_sum(p->p_y[i], p->p_y_low[i]);
        const double_double full_p_z = dd_sum(p->p_z[i], p->p_z_low[i]);
        const double_double full_mirror_x = dd_sum(p->mirror_x[i], p->mirror_x_low[i]);
        const double_double full_mirror_y = dd_sum(p->mirror_y[i], p->mirror_y_low[i]);
        const double_double full_mirror_z = dd_sum(p->mirror_z[i], p->mirror_z_low[i]);

        /* mirrored ray and plane [3 mul 2 add 1 div 38 call] */
        const double_double o_x = pair_add(origin_x, pair_mul(full_p_x, scale));   /* the point seen from the eye */
        const double_double o_y = pair_add(origin_y, pair_mul(full_p_y, scale));
        const double_double o_z = pair_add(origin_z, pair_mul(full_p_z, scale));
        /* -n.d: the ray meets the plane where it is positive */
        const double_double descent = pair_sub(dd_neg(pair_mul(full_plane_x, full_mirror_x)),
            pair_add(pair_mul(full_plane_y, full_mirror_y), pair_mul(full_plane_z, full_mirror_z)));
        /* height over descent */
        const double_double t_plane = pair_div(pair_add(pair_add(pair_add_double(pair_mul(full_plane_x, o_x), 1.0),
            pair_mul(full_plane_y, o_y)), pair_mul(full_plane_z, o_z)), descent);
        /* where it meets the plane, seen from the eye */
        const double_double loose_foot_x = pair_add(o_x, pair_mul(full_mirror_x, t_plane));
        const double_double foot_x = pair_normalised(loose_foot_x);
        const double_double loose_foot_y = pair_add(o_y, pair_mul(full_mirror_y, t_plane));
        const double_double foot_y = pair_normalised(loose_foot_y);
        const double_double loose_foot_z = pair_add(o_z, pair_mul(full_mirror_z, t_plane));
        const double_double foot_z = pair_normalised(loose_foot_z);
        const double inv_d2 = 1.0 / (full_mirror_x.hi * full_mirror_x.hi + full_mirror_y.hi * full_mirror_y.hi
            + full_mirror_z.hi * full_mirror_z.hi);
        const double_double bounce = dd_scale(descent, 2.0);
        /* d mirrored at the plane */
        const double_double loose_next_x = pair_add(full_mirror_x, pair_mul(full_plane_x, bounce));
        const double_double next_x = pair_normalised(loose_next_x);
        const double_double loose_next_y = pair_add(full_mirror_y, pair_mul(full_plane_y, bounce));
        const double_double next_y = pair_normalised(loose_next_y);
        const double_double loose_next_z = pair_add(full_mirror_z, pair_mul(full_plane_z, bounce));
        const double_double next_z = pair_normalised(loose_next_z);

        /* margin [11 mul 7 add 1 div 1 sqrt 3 call] */
        const double d_size = fabs(p->mirror_x[i]) + fabs(p->mirror_y[i]) + fabs(p->mirror_z[i]);   /* at least |d| */
        const double travelled = t_plane.hi * d_size;   /* the ray's way, in heights */
        /* rounding moves the point by its distance */
        const double blurred = 1.0 + sqrt(foot_x.hi * foot_x.hi + foot_y.hi * foot_y.hi + foot_z.hi * foot_z.hi);
        /* what two words leave moves the ray aside */
        const double drifted = 1.0 + 0.25 * 3.0 * p->turn[i] * scale.hi + 0.5 * 3.0 * p->turn[i] * travelled;
        const double turned = d_size * drifted / descent.hi;   /* and so the foot, along the plane */

        child->mirror_x[j] = next_x.hi;
        child->mirror_y[j] = next_y.hi;
        child->mirror_z[j] = next_z.hi;
        child->n_x[j] = full_plane_x.hi;
        child->n_y[j] = full_plane_y.hi;
        child->n_z[j] = full_plane_z.hi;
        child->p_x[j] = foot_x.hi;
        child->p_y[j] = foot_y.hi;
        child->p_z[j] = foot_z.hi;
        child->inv_d2[j] = inv_d2;
        child->p_x_low[j] = foot_x.lo;
        child->p_y_low[j] = foot_y.lo;
        child->p_z_low[j] = foot_z.lo;
        child->mirror_x_low[j] = next_x.lo;
        child->mirror_y_low[j] = next_y.lo;
        child->mirror_z_low[j] = next_z.lo;
        child->blur[j] = blurred;
        child->turn[j] = turned;
        child->margin[j] = turned < MOST_TURN ? INFINITY : 0.0;
    }
}

/* Shades the points that were met in mirrors and adds them to those that see them. */
static void flush_mirror(points *p, const frame *h, int bounces)
{
    points *child = p + 1;
    shade(child, h, bounces - 1, NULL, 0, 0);
    for (const run *r = child->run; r < child->run + child->runs; ++r)
        for (int c = 0; c < CHANNELS; ++c)
            for (int j = r->at; j < r->at + r->count; ++j)
                p->value[c][child->from[j]] += child->weight[j] * child->value[c][j];
    for (const run *r = child->run; r < child->run + child->runs; ++r)
        for (int j = r->at; j < r->at + r->count; ++j) {
            const int i = child->from[j];
            p->margin[i] = least(child->margin[j], p->margin[i]);
            p->error[i] += child->weight[j] * child->error[j];
        }
    child->count = child->runs = 0;
}

/* Points of the run that see receiver k in their mirror become runs of the points below. */
static void follow(points *p, const run *q, int k, double weight, const frame *h, int bounces)
{
    const scene_type *scene = h->scene;
    points *child = p + 1;
    int i = q->at, waiting = 0;
    const int end = q->at + q->count;
    for (int n = i; n < end; ++n)
        waiting += p->seen[n] == k;
    while (waiting > 0) {
        if (child->count == POINTS)
            flush_mirror(p, h, bounces);
        run *next = &child->run[child->runs];
        const int at = child->count, room = waiting < POINTS - at ? waiting : POINTS - at;
        next->receiver = k;
        next->at = at;
        next->count = room;
        next->place = 0;
        waiting -= room;
        for (int found = 0; found < room; ++i) {
            child->from[at + found] = i;
            found += p->seen[i] == k;
        }
        for (int j = at + room; j < at + padded(room); ++j)
            child->from[j] = child->from[at];   /* what lies between two runs is worked out and never read */
        for (int j = at; j < at + room; ++j)
            child->weight[j] = weight;
        child->count += padded(next->count);
        ++child->runs;
        if (k >= scene->spheres)
            arrive_on_plane(child, next, p, q->receiver, scene);
        else
            arrive(child, next, p, q->receiver, scene);
    }
}

/* Adds what the points see in their mirrors. */
static void reflect(points *p, const frame *h, int bounces)
{
    const scene_type *scene = h->scene;
    points *child = p + 1;
    child->count = child->runs = 0;
    for (const run *q = p->run; q < p->run + p->runs; ++q) {
        const double weight = scene->reflect[q->receiver];
        if (!(weight > 0.0))
            continue;
        for (int i = q->at; i < q->at + q->count; ++i) {
            p->nearest[i] = INFINITY;
            p->seen[i] = -1;
        }
        for (int m = scene->mirrors_begin[q->receiver]; m < scene->mirrors_begin[q->receiver + 1]; ++m)
            find_in_mirror(p, q, scene->mirrors[m], scene);
        if (scene->mirror_plane[q->receiver])
            find_plane_in_mirror(p, q, h);
        double height[POINTS];
        for (int i = q->at; i < q->at + padded(q->count); ++i)
            height[i] = height_of(scene, p->mirror_x[i], p->mirror_y[i], p->mirror_z[i]);
        for (int c = 0; c < CHANNELS; ++c)
            for (int i = q->at; i < q->at + q->count; ++i) {
                const double beyond = backdrop(scene, height[i], c);
                p->value[c][i] += p->seen[i] < 0 ? weight * beyond : 0.0;
            }
        for (int m = scene->mirrors_begin[q->receiver]; m < scene->mirrors_begin[q->receiver + 1]; ++m)
            follow(p, q, scene->mirrors[m], weight, h, bounces);
        if (scene->mirror_plane[q->receiver])
            for (int k = scene->spheres; k < scene->receivers; ++k)
                follow(p, q, k, weight, h, bounces);
    }
    if (child->count > 0)
        flush_mirror(p, h, bounces);
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
                accumulate(p, r, &h->lamps[r->lamp]);
                if (layers)
                    write_terms(p, r, &h->lamps[r->lamp], layers, pixel + (size_t)r->place, pixels);
            }
    }
    if (layers && layers->reflected)
        for (const run *r = p->run; r < p->run + p->runs; ++r)
            for (int c = 0; c < CHANNELS; ++c)
                for (int i = 0; i < r->count; ++i) {
                    const size_t place = pixel + (size_t)(r->place + i);
                    layers->reflected[CHANNELS * place + (size_t)c] = -p->value[c][r->at + i];
                }
    if (bounces > 0)
        reflect(p, h, bounces);
    if (layers && layers->reflected)
        for (const run *r = p->run; r < p->run + p->runs; ++r)
            for (int c = 0; c < CHANNELS; ++c)
                for (int i = 0; i < r->count; ++i) {
                    const size_t place = pixel + (size_t)(r->place + i);
                    layers->reflected[CHANNELS * place + (size_t)c] += p->value[c][r->at + i];
                }
}

frame *scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_prepare(const scene_type *scene, const symrender_grid *grid)
{
    frame *h = array(1, sizeof *h);
    if (!h)
        return NULL;
    h->scene = scene;
    h->grid = *grid;
    h->white = grid->white;
    h->span = span_frame_of(scene);
    h->plane = plane_frame_of(scene);
    const size_t visible = (size_t)scene->visible;
    h->row_first = array(visible, sizeof *h->row_first);
    h->row_last = array(visible, sizeof *h->row_last);
    h->spans = array(visible, sizeof *h->spans);
    h->lamps = array((size_t)scene->lamps_begin[scene->receivers], sizeof *h->lamps);
    h->half_exponents = array((size_t)scene->receivers, sizeof *h->half_exponents);
    if (!h->spans || !h->row_first || !h->row_last || !h->lamps || !h->half_exponents) {
        scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_release(h);
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
    h->tile_keen = GRAIN * (
        fabs(scene->across_x) + fabs(scene->across_y) + fabs(scene->across_z) + fabs(scene->across_0)
        + fabs(scene->along_x) + fabs(scene->along_y) + fabs(scene->along_z) + fabs(scene->along_0));
    return h;
}

void scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_release(frame *h)
{
    if (!h)
        return;
    free(h->spans);
    free(h->row_first);
    free(h->row_last);
    free(h->lamps);
    free(h->half_exponents);
    free(h);
}

/* ---- the rows of an image ---- */

/* What a call of rows or points works in. */
typedef struct {
    void *memory;       /* in which points lie, where a line of the cache begins */
    points *points;     /* one for each level of mirrors */
    int *owner;         /* [width] which of the row's spheres a pixel shows; then the plane's materials; -1: none */
    double *margin;     /* [width] how sure that is */
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
    free(w->owner);
    free(w->margin);
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
    w->memory = array(1, ((size_t)h->scene->bounces + 1) * sizeof *w->points + LINE);
    w->points = w->memory ? line_of_cache(w->memory) : NULL;
    for (int i = 0; w->points && i < POINTS; ++i)
        w->points->ordinal[i] = i;
    w->owner = array((size_t)width, sizeof *w->owner);
    w->margin = array((size_t)width, sizeof *w->margin);
    if (!w->points || !w->owner || !w->margin)
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
    w->memory = array(1, ((size_t)h->scene->bounces + 1) * sizeof *w->points + LINE);
    w->points = w->memory ? line_of_cache(w->memory) : NULL;
    for (int i = 0; w->points && i < POINTS; ++i)
        w->points->ordinal[i] = i;
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

/* Is it the nearer of two depths? *sure tells how sure that is. */
static inline int is_before(double depth, double other, double *sure)
{
    *sure = least(fabs(depth - other) - 0x1p-40 * depth, *sure);
    return depth < other;
}

/* Is sphere k, which is hit, seen at x although another one may own the pixel? Disjoint spheres are painted front to
 * back, so that the owner is in front.
 * What is below the plane is not seen. */
static int is_seen(const workspace *w, const frame *h, const int *active, int slot, int owner,
    double x, const plane_row *ground, double *sure)
{
    const scene_type *scene = h->scene;
    const int k = active[slot];
    if (scene->crosses_plane[k]
        && !is_before(
            depth_of(w, h, slot, k, x), plane_distance(x, ground, &h->plane) * scene->radius[scene->spheres], sure))
        return 0;
    if (owner < 0)
        return 1;
    return 0;
}

/* The place among the owners of the plane's material where the ray through x meets it, from `first` on; -1 for none. */
static int ground_at(double x, const plane_row *r, const frame *h, int first, double *sure)
{
    const plane_frame *f = &h->plane;
    /* ground plane [1 mul 2 add 3 div] */
    /* -n.D: the ray meets the plane where it is positive */
    const double descent = f->descent_frame + r->descent_row - f->plane_x * x;
    const double p_x = x / descent;   /* P - E = D / -n.D, in heights of the eye above the plane */
    const double p_y = r->y / descent;
    const double p_z = -(f->focal / descent);

    /* margin [4 mul 6 add 2 call] */
    /* not above 0: in doubt */
    const double margin = fabs(descent) + f->margin_frame + r->margin_row - 5.684341886080802e-14 * fabs(x);
    /* far away rounding moves the point along the ray by |p|^2 */
    const double blurred = 1.0 + p_x * p_x + p_y * p_y + p_z * p_z;

    *sure = least(margin, *sure);
    return descent > 0.0 ? first + parity_of(p_x, p_y, p_z, blurred, sure, h) : -1;
}

/* Depth, normal, index and ambient term of the last run, which the pixels of one owner in this row make up. */
static void write_geometry(const points *p, const workspace *w, const frame *h, const layer_set *layers,
    size_t row, int slot, double left, double step, const plane_row *ground)
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
            layers->depth[place] = r->receiver < scene->spheres
                ? depth_of(w, h, slot, r->receiver, x)
                : plane_distance(x, ground, &h->plane) * scene->radius[scene->spheres];
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
    shade(p, h, h->scene->bounces, layers, row, pixels);
    int doubtful = 0;
    for (int i = 0; i < p->count; ++i)
        doubtful += !((p->margin[i] > 0.0) & (p->error[i] < MOST_ROUNDOFFS));
    const ptrdiff_t listed = doubtful && unsettled ? list_doubtful(p, row, unsettled) : 0;
    const double white = h->white;
    for (int c = 0; c < CHANNELS; ++c)
        for (int i = 0; i < p->count; ++i)
            p->value[c][i] = p->value[c][i] > white ? white : p->value[c][i];
    for (const run *r = p->run; r < p->run + p->runs; ++r)
        for (int i = 0; i < r->count; ++i)
            for (int c = 0; c < CHANNELS; ++c)
                out[CHANNELS * (r->place + i) + c] = p->value[c][r->at + i];
    p->count = p->runs = 0;
    return listed;
}

/* Geometry of a run of points of the sphere in a slot of the row, or of the plane. */
static void surface(points *p, const workspace *w, const frame *h, int slot, int receiver, int count,
    double first, double step, const plane_row *ground, const double *sure)
{
    run *r = &p->run[p->runs++];
    r->receiver = receiver;
    r->at = p->count;
    r->count = count;
    p->count += padded(count);
    for (int i = r->at; i < p->count; ++i) {
        p->margin[i] = i < r->at + count ? sure[i - r->at] : INFINITY;
        p->blur[i] = 1.0;
    }
    if (receiver >= h->scene->spheres) {
        plane_surface(p, r->at, count, first, step, ground, &h->plane);
        return;
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
    const plane_row *ground;
} row_place;

/* Writes the background to the pixels [begin, end) of a row. */
static void paint_background(const frame *h, const row_place *to, int begin, int end)
{
    const scene_type *scene = h->scene;
    const double unit = h->span.plane_unit;
    for (int i = begin; i < end; ++i) {
        const double height = height_of(scene, (i + to->left) * to->step, to->plane_y * unit, -scene->eye * unit);
        for (int c = 0; c < CHANNELS; ++c) {
            const double value = backdrop(scene, height, c);
            to->out[CHANNELS * i + c] = value > h->white ? h->white : value;
        }
    }
    const layer_set *layers = to->layers;
    for (int i = begin; layers && i < end; ++i) {
        const size_t place = to->row + (size_t)i;
        if (layers->depth)
            layers->depth[place] = INFINITY;
        if (layers->index)
            layers->index[place] = -1;
        if (layers->background) {
            const double height
                = height_of(scene, (i + to->left) * to->step, to->plane_y * unit, -scene->eye * unit);
            for (int c = 0; c < CHANNELS; ++c)
                layers->background[CHANNELS * place + (size_t)c] = backdrop(scene, height, c);
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
        surface(p, w, h, slot, receiver, some, at + to->left, to->step, to->ground, w->margin + at);
        if (to->layers)
            write_geometry(p, w, h, to->layers, to->row, slot, to->left, to->step, to->ground);
    }
    return found;
}

/* Where the pixels from `begin` on that have one owner end, at `end` or before it. */
static int end_of_run(const int *owner, int begin, int end)
{
    enum { MANY = 64 };   /* as many at a time as equal those before them */
    int next = begin + 1;
    while (next + MANY <= end && memcmp(owner + next - 1, owner + next, MANY * sizeof *owner) == 0)
        next += MANY;
    while (next < end && owner[next] == owner[begin])
        ++next;
    return next;
}

/* Draws the pixels [begin, end) of a row as their owners have it, the plane where there is none.
 * Returns how many were in doubt. */
static ptrdiff_t draw_owned(workspace *w, const frame *h, const row_place *to,
    const int *active, int count, int begin, int end, ptrdiff_t *unsettled)
{
    const scene_type *scene = h->scene;
    ptrdiff_t found = 0;
    for (int i = begin; i < end; ++i) {
        if (scene->plane_seen && w->owner[i] < 0)
            w->owner[i] = ground_at((i + to->left) * to->step, to->ground, h, count, &w->margin[i]);
    }
    for (int at = begin, next; at < end; at = next) {
        const int owner = w->owner[at];
        next = end_of_run(w->owner, at, end);
        if (owner < 0) {
            paint_background(h, to, at, next);
            int doubtful = 0;
            for (int i = at; i < next; ++i)
                doubtful += !(w->margin[i] > 0.0);
            for (int i = at; unsettled && doubtful && i < next; ++i)
                if (!(w->margin[i] > 0.0))
                    unsettled[found++] = (ptrdiff_t)to->row + i;
            continue;
        }
        const int receiver = owner < count ? active[owner] : scene->spheres + owner - count;
        found += add_pixels(w, h, to, owner, receiver, at, next, unsettled ? unsettled + found : NULL);
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

ptrdiff_t scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_rows(
    double *image, ptrdiff_t stride, const frame *h, const layer_set *layers, int row_begin, int row_end,
    ptrdiff_t *unsettled)
{
    const scene_type *scene = h->scene;
    const int width = h->grid.width;
    const double unit = h->span.plane_unit;
    const double pixel = h->grid.pixel, step = pixel * unit;
    const double left = 0.5 - 0.5 * width, top = 0.5 * h->grid.height - 0.5;
    ptrdiff_t found = 0;
    workspace w;
    if (!take(&w, h, row_begin, row_end, width)) {
        drop(&w);
        return -1;
    }
    for (int j = row_begin; j < row_end; ++j) {
        const double plane_y = (top - j) * pixel;
        for (int i = 0; i < width; ++i)
            w.owner[i] = -1;
        for (int i = 0; i < width; ++i)
            w.margin[i] = INFINITY;
        const plane_row ground = plane_row_of(plane_y * unit, &h->plane);
        const row_place here = {
            image + j * stride, layers, (size_t)j * (size_t)width, plane_y, left, step, &ground,
        };
        const int strip = (j - row_begin) / ROWS, in_strip = (j - row_begin) % ROWS;
        const int *active = w.active + w.start[strip];
        const int count = w.start[strip + 1] - w.start[strip];
        if (in_strip == 0)
            enter_strip(&w, h, active, count, j);
        int left_over = width;
        for (int slot = 0; slot < count && left_over > 0; ++slot) {
            const int k = active[slot];

            const pixel_span span = span_in_row(&w, h, slot, k, in_strip, &here);
            if (span.last < span.first)
                continue;
            enter_row_of_strip(&w, h, slot, k, in_strip, plane_y * unit);
            if (scene->crosses_plane[k]) {
                for (int i = span.first; i <= span.last; ++i)
                    if (is_seen(&w, h, active, slot, w.owner[i], (i + left) * step, &ground, &w.margin[i])) {
                        left_over -= w.owner[i] < 0;
                        w.owner[i] = slot;
                    }
                continue;
            }
            int painted = 0;
            for (int i = span.first; i <= span.last; ++i) {
                painted += w.owner[i] < 0;
                w.owner[i] = w.owner[i] < 0 ? slot : w.owner[i];
            }
            left_over -= painted;
        }

        found += draw_owned(&w, h, &here, active, count, 0, width, unsettled ? unsettled + found : NULL);
        if (w.points->count > 0)
            found += flush(w.points, h, here.out, layers, here.row, unsettled ? unsettled + found : NULL);
    }
    drop(&w);
    return found;
}

ptrdiff_t scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_points(
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
        double sure = INFINITY;
        const plane_row ground = plane_row_of(y[i] * unit, &h->plane);
        /* two slots: what the point shows so far, and the sphere that is tried */
        int active[2] = {0, 0};
        for (int k = 0; k < scene->visible; ++k) {
            active[1] = k;
            enter_row(&w, h, 1, k, y[i] * unit);
            if (!hits(&w, h, 1, k, x[i], y[i], 1.0, unit))
                continue;
            if (!is_seen(&w, h, active, 1, owner, x[i] * unit, &ground, &sure))
                continue;
            owner = 0;
            active[0] = k;
            w.span_rows[0] = w.span_rows[1];
            break;
        }
        int receiver = owner < 0 ? -1 : active[0];
        if (owner < 0) {
            const int material = scene->plane_seen ? ground_at(x[i] * unit, &ground, h, 0, &sure) : -1;
            receiver = material < 0 ? -1 : scene->spheres + material;
        }
        if (receiver < 0) {
            if (unsettled && !(sure > 0.0))
                unsettled[found++] = i;
            const double height = height_of(scene, x[i] * unit, y[i] * unit, -scene->eye * unit);
            for (int c = 0; c < CHANNELS; ++c) {
                const double value = backdrop(scene, height, c);
                values[CHANNELS * i + c] = value > h->white ? h->white : value;
            }
            continue;
        }
        if (p->count == POINTS || i - (out - values) / CHANNELS > 0x3fffffff) {
            found += flush(p, h, out, NULL, (size_t)((out - values) / CHANNELS), unsettled ? unsettled + found : NULL);
            out = values + CHANNELS * i;
        }
        p->run[p->runs].place = (int)(i - (out - values) / CHANNELS);
        surface(p, &w, h, 0, receiver, 1, x[i] * unit, 1.0, &ground, &sure);
    }
    if (p->count > 0)
        found += flush(p, h, out, NULL, (size_t)((out - values) / CHANNELS), unsettled ? unsettled + found : NULL);
    drop(&w);
    return found;
}

int scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_prepare_many(
    frame **frames, const scene_type *scenes, ptrdiff_t count, const symrender_grid *grids)
{
    for (ptrdiff_t k = 0; k < count; ++k) {
        frames[k] = scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_prepare(&scenes[k], &grids[k]);
        if (!frames[k]) {
            scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_release_many(frames, k);
            return -1;
        }
    }
    return 0;
}

void scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_release_many(
    frame **frames, ptrdiff_t count)
{
    for (ptrdiff_t k = 0; k < count; ++k)
        scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_release(frames[k]);
}

ptrdiff_t scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_batch(double *const *images, ptrdiff_t stride,
    frame *const *frames, ptrdiff_t row_begin, ptrdiff_t row_end, ptrdiff_t *unsettled)
{
    const ptrdiff_t height = frames[0]->grid.height, pixels = height * frames[0]->grid.width;
    ptrdiff_t found = 0;

    for (ptrdiff_t k = row_begin / height; k * height < row_end; ++k) {
        const ptrdiff_t top = k * height;
        const int begin = row_begin > top ? (int)(row_begin - top) : 0;
        const int end = row_end - top < height ? (int)(row_end - top) : (int)height;
        const ptrdiff_t listed = scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_rows(
            images[k], stride, frames[k], NULL, begin, end, unsettled ? unsettled + found : NULL);
        if (listed < 0)
            return -1;
        for (ptrdiff_t i = 0; unsettled && i < listed; ++i)
            unsettled[found + i] += k * pixels;
        found += listed;
    }
    return found;
}
