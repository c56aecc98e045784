/* centred_sphere_double_baked: one Phong sphere, one point light
 * Accuracy "double" (symrender_cg 0.1.0)
 * Generated from the formula; do not edit. Regenerate with:
 *     python -m symrender_cg build chapter1 --accuracy double --bake
 *
 * promise  about 1e-15 absolute where the light is farther than 1e-3 R from the surface and n >= 1 (a gated
 *          highlight may be switched wrongly within rounding of the terminator); no overflow; hit or miss never
 *          wrong
 * in       diffuse term
 *          specular term
 * out      sphere off the axis: the centre is the point looked at: disc depends on x^2 + y^2 alone
 *          sphere at the plane of the eye: the sphere lies wholly before the eye: depth of its centre 4 > R 1
 *          gated specular: the material asks for the specular term as Phong wrote it, not gated by n.l > 0
 *          shadow of the sphere on itself: a sphere is convex: where n.l > 0 the way to the light leaves it; where
 *          not, diffuse is 0
 * baked    eye 4, radius 1, light_intensity 1, k_ambient 0.1, k_diffuse 0.7, k_specular 0.5, shininess 32,
 *          background 0, center_x 0, light_x 5, center_y 0, light_y 5, center_z 0, light_z 10
 * ops      at build time: frame 3 call
 *          a row: 1 mul 5 call
 *          a pixel: 37 mul 28 add 2 div 2 sqrt 2 max 3 select 4 call
 */
#include "centred_sphere_double_baked.h"

#include "inline.h"
#include "span.h"
#include "square.h"
#include "double_double.h"
#include "exact_sign.h"
#include <math.h>

enum { POINTS = 256 };   /* points shaded in one go, before the few doubtful ones among them are settled */

/* What does not change within a frame, computed to 200 bits and rounded once. */
static const double background = 0.0;   /* where no ray hits */
static const double plane_unit = 0.25;
static const double_double alpha = {15.0, 0.0};   /* alpha = kappa^2 - 1, free of cancellation */
/* the silhouette is the circle x^2 + y^2 = rho^2 = f^2 / alpha */
static const double_double rho2 = {0.06666666666666667, 9.251858538542971e-19};
static const double_double depth = {4.0, 0.0};   /* kappa = e / R: lengths of the scene in radii */
static const double along_frame = 4.0;   /* what is the same for a frame in along */
static const double lamp_x = 5.0;   /* (L - C) / R */
static const double lamp_y = 5.0;
static const double lamp_z = 10.0;
static const double diffuse_gain = 0.7;   /* I_L k_d */
static const double specular_gain = 0.5;   /* I_L k_s */

/* What does not change within a row. */
typedef struct {
    double y, s_row;
    double_double x_left, x_right;
} row;

SYMRENDER_INLINE row row_of(double y)
{
    /* silhouette [5 call] */
    /* the row's hits are -reach <= x <= reach */
    const double_double reach = dd_sqrt(dd_positive_part(dd_sub(rho2, dd_product(y, y))));
    const double_double x_left = dd_neg(reach);
    const double_double x_right = reach;

    /* ray and sphere [1 mul] */
    const double s_row = y * y;   /* what is the same for a row in s */

    const row r = {
        .y = y, .x_left = x_left, .x_right = x_right, .s_row = s_row,
    };
    return r;
}

/* Does the ray through (x, y) hit? Settled without rounding, as the sign of a polynomial in the inputs. */
static int hits_exactly(double x, double y)
{
    exact_sum sum;
    exact_sum_clear(&sum);   /* disc */
    exact_sum_add_product(&sum,  1, 4.0, 4.0, 1.0, 1.0);
    exact_sum_add_product(&sum, -1, 4.0, 4.0, x, x);
    exact_sum_add_product(&sum, -1, 4.0, 4.0, y, y);
    exact_sum_add_product(&sum,  1, 1.0, 1.0, x, x);
    exact_sum_add_product(&sum,  1, 1.0, 1.0, y, y);
    return exact_sum_sign(&sum) >= 0;
}

/* How surely facing2, the discriminant in radii, has the right sign: it has if this is positive. Its error is far below
 * 2^-40 |D|^2 for every scene that the plan admits; within that, and where it is NaN, hits_exactly decides. */
static inline double certainty(double facing2, double d_dot_d)
{
    return fabs(facing2) - 0x1p-40 * d_dot_d;
}

/* Does the ray through the centre of a pixel of this row hit? The pixel is column pixels to the right of the axis. */
static int is_hit(double column, double plane_y, const row *r, double pixel, double step)
{
    const double x = column * step;

    /* ray and sphere [3 mul 6 add] */
    /* distance to the two ends of the span, not negative inside it */
    const double from_left = x - r->x_left.hi - r->x_left.lo;
    const double to_right = r->x_right.hi - x + r->x_right.lo;
    const double chord = from_left * to_right;
    /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
    const double facing2 = alpha.hi * chord;
    const double s = x * x + r->s_row;   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const double d_dot_d = s + 1.0;

    return certainty(facing2, d_dot_d) > 0.0 ? facing2 > 0.0 : hits_exactly(column * pixel, plane_y);
}

/* Intensity of the sphere along the ray through x of this row, and in *sure how surely the ray hits or misses:
 * the sign of *sight says which. */
SYMRENDER_INLINE double shade(double x, const row *r, double *sight, double *sure)
{
    /* ray and sphere [3 mul 6 add 1 sqrt 1 max] */
    /* distance to the two ends of the span, not negative inside it */
    const double from_left = x - r->x_left.hi - r->x_left.lo;
    const double to_right = r->x_right.hi - x + r->x_right.lo;
    const double chord = from_left * to_right;
    /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
    const double facing2 = alpha.hi * chord;
    const double s = x * x + r->s_row;   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const double d_dot_d = s + 1.0;
    const double facing = sqrt(facing2 > 0.0 ? facing2 : 0.0);   /* -n.D, how far the surface faces the ray: root / R */

    /* normal [5 mul 2 add 1 div] */
    const double inv_d2 = 1.0 / d_dot_d;
    const double along = inv_d2 * (along_frame - facing);   /* t / R: n = (t x, t y, e (1 - t)) / R */
    const double n_x = x * along;
    const double n_y = r->y * along;
    const double n_z = (s * depth.hi + facing) * inv_d2;   /* a sum, where e (1 - t) would cancel */

    /* light [7 mul 7 add 1 div 1 sqrt] */
    const double w_x = lamp_x - n_x;   /* w = (L - P) / R */
    const double w_y = lamp_y - n_y;
    const double w_z = lamp_z - n_z;
    const double w2 = w_x * w_x + w_y * w_y + w_z * w_z;   /* |w|^2 */
    const double inv_w2 = 1.0 / w2;
    const double n_dot_l = (n_x * w_x + n_y * w_y + n_z * w_z) * sqrt(inv_w2);   /* n.l = n.w / |w| */

    /* diffuse [1 mul 1 max]. Phong 1975, Illumination for computer generated pictures */
    const double diffuse = (n_dot_l > 0.0 ? n_dot_l : 0.0) * diffuse_gain;   /* k_d max(0, n.l) */

    /* specular [21 mul 11 add 2 select 4 call]. Phong 1975, Illumination for computer generated pictures */
    const double bounce = 2.0 * facing;
    /* the primary ray mirrored at the surface, D + 2 facing n, as long as D */
    const double mirror_x = x + n_x * bounce;
    const double mirror_y = r->y + n_y * bounce;
    const double mirror_z = n_z * bounce - 1.0;
    const double w_dot_mirror = w_x * mirror_x + w_y * mirror_y + w_z * mirror_z;   /* r.v = w . mirror / (|w| |D|) */
    const double inv_w2_d2 = inv_d2 * inv_w2;
    const double cos2 = w_dot_mirror * w_dot_mirror * inv_w2_d2;   /* (r.v)^2 */
    const double side_x = w_y * mirror_z - w_z * mirror_y;   /* w x mirror, short where the highlight is */
    const double side_y = w_z * mirror_x - w_x * mirror_z;
    const double side_z = w_x * mirror_y - w_y * mirror_x;
    /* 1 - (r.v)^2, accurate where r.v is near 1 */
    const double sin2 = inv_w2_d2 * (side_x * side_x + side_y * side_y + side_z * side_z);
    const double lobe = 0.5 > sin2 ? 1.0 - sin2 : cos2;   /* (r.v)^2, accurate where r.v is near 1 */
    const double lobe_2 = square(lobe);   /* lobe^2 */
    const double lobe_4 = square(lobe_2);   /* lobe^4 */
    const double lobe_8 = square(lobe_4);   /* lobe^8 */
    const double lobe_16 = square(lobe_8);   /* lobe^16 */
    const double highlight = lobe_16;   /* max(0, r.v)^n where r.v > 0 */
    const double specular = (w_dot_mirror > 0.0 ? highlight : 0.0) * specular_gain;   /* k_s max(0, r.v)^n */

    /* intensity [2 add 1 select]. Phong 1975, Illumination for computer generated pictures */
    const double lit = diffuse + specular;   /* what the light adds; the gains hold its intensity */
    const double value = 0.1 + (w2 > 0.0 ? lit : 0.0);   /* I = k_a + what the light adds */

    *sight = facing2;
    *sure = certainty(facing2, d_dot_d);
    return value;
}

static inline double at_most(double intensity, double white)
{
    return intensity > white ? white : intensity;
}

void centred_sphere_double_baked_rows(double *image, ptrdiff_t stride, const symrender_grid *grid,
    int row_begin, int row_end)
{
    const double unit = plane_unit;
    const double pixel = grid->pixel, step = pixel * unit;
    const double left = 0.5 - 0.5 * grid->width, top = 0.5 * grid->height - 0.5;
    const double white = grid->white;
    const double background_here = at_most(background, white);
    const int width = grid->width;

    for (int j = row_begin; j < row_end; ++j) {
        double *restrict out = image + j * stride;
        const double plane_y = (top - j) * pixel;
        const row r = row_of(plane_y * unit);

        /* the hits of a row are one span of pixels, its ends in closed form and settled by an exact test */
        const double left_end = r.x_left.hi / step - left, right_end = r.x_right.hi / step - left;
        pixel_span hits = span_between(left_end, right_end, width);
        while (hits.first > 0 && is_hit(hits.first - 1 + left, plane_y, &r, pixel, step))
            --hits.first;
        while (hits.last < width - 1 && is_hit(hits.last + 1 + left, plane_y, &r, pixel, step))
            ++hits.last;
        while (hits.first <= hits.last && !is_hit(hits.first + left, plane_y, &r, pixel, step))
            ++hits.first;
        while (hits.last >= hits.first && !is_hit(hits.last + left, plane_y, &r, pixel, step))
            --hits.last;

        const int begin = hits.first <= hits.last ? hits.first : width;
        const int end = hits.first <= hits.last ? hits.last + 1 : width;
        for (int i = 0; i < begin; ++i)
            out[i] = background_here;
        for (int i = begin; i < end; ++i) {
            double sight, sure;
            out[i] = at_most(shade((i + left) * step, &r, &sight, &sure), white);
        }
        for (int i = end; i < width; ++i)
            out[i] = background_here;
    }
}

void centred_sphere_double_baked_points(double *values, const double *x, const double *y,
    ptrdiff_t count, double white)
{
    const double unit = plane_unit;
    const double background_here = at_most(background, white);

    for (ptrdiff_t block = 0; block < count; block += POINTS) {
        const int length = count - block < POINTS ? (int)(count - block) : POINTS;
        const double *restrict block_x = x + block, *restrict block_y = y + block;
        double *restrict out = values + block;
        double doubt[POINTS];
        for (int i = 0; i < length; ++i) {
            const row r = row_of(block_y[i] * unit);
            double sight, sure;
            const double intensity = shade(block_x[i] * unit, &r, &sight, &sure);
            out[i] = at_most(sight > 0.0 ? intensity : background_here, white);
            doubt[i] = sure;
        }
        for (int i = 0; i < length; ++i)
            if (!(doubt[i] > 0.0)) {
                const row r = row_of(block_y[i] * unit);
                double sight, sure;
                const double intensity = shade(block_x[i] * unit, &r, &sight, &sure);
                out[i] = at_most(hits_exactly(block_x[i], block_y[i]) ? intensity : background_here, white);
            }
    }
}
