/* centred_sphere_double_baked: one Phong sphere, one point light
 * Accuracy "double" (symrender_cg 0.1.0)
 * Generated from the formula; do not edit. Regenerate with:
 *     python -m symrender_cg build chapter1 --accuracy double --bake
 *
 * promise  at most 1e-15 max(1, value) off where no light is within 1e-3 R of a surface and n <= 1000; another
 *          kernel draws what this one may not; no overflow; hit or miss never wrong
 * in       diffuse term
 *          specular term
 * out      sphere off the axis: the centre is the point looked at: disc depends on x^2 + y^2 alone
 *          sphere at the plane of the eye: the sphere lies wholly before the eye: depth of its centre 4 > R 1
 *          gated specular: the material asks for the specular term as Phong wrote it, not gated by n.l > 0
 *          shadow of the sphere on itself: a sphere is convex: where n.l > 0 the way to the light leaves it; where
 *          not, diffuse is 0
 * baked    eye 4, radius 1, light_intensity 1, k_ambient 0.1, k_diffuse 0.7, k_specular 0.5, shininess 32,
 *          background 0, center_x 0, light_x 5, center_y 0, light_y 5, center_z 0, light_z 10
 * ops      at build time: frame 5 call
 *          a row: 1 mul 5 call
 *          a pixel: 41 mul 32 add 2 div 2 sqrt 2 max 4 select 4 call
 *          of these, once for four of them, at x and -x, y and -y: 15 mul 14 add 1 div 1 sqrt 1 max 1 select
 *          and once for two, at x and -x: 8 mul 4 add
 */
#include "centred_sphere_double_baked.h"

#include "inline.h"
#include "span.h"
#include "square.h"
#include "block.h"
#include "double_double.h"
#include "exact_sign.h"
#include <math.h>

enum { POINTS = 128 };   /* pixels of a block: its arrays fit into the first level cache */

/* What does not change within a frame, computed to 200 bits and rounded once. */
static const double background = 0.0;   /* where no ray hits */
static const double plane_unit = 0.25;
static const double_double alpha = {15.0, 0.0};   /* alpha = kappa^2 - 1, free of cancellation */
/* the silhouette is the circle x^2 + y^2 = rho^2 = f^2 / alpha */
static const double_double rho2 = {0.06666666666666667, 9.251858538542971e-19};
static const double middle_s = 0.03333333333333333;   /* where the angle of incidence is 45 degrees */
static const double_double depth = {4.0, 0.0};   /* kappa = e / R: lengths of the scene in radii */
static const double along_frame = 4.0;   /* what is the same for a frame in along */
static const double lamp_x = 5.0;   /* (L - C) / R */
static const double lamp_y = 5.0;
static const double lamp_z = 10.0;
static const double diffuse_gain = 0.7;   /* I_L k_d */
static const double_double depth2 = {16.0, 0.0};
static const double_double depth_focal = {4.0, 0.0};
static const double specular_gain = 0.5;   /* I_L k_s */

/* What does not change within a row. */
typedef struct {
    double y, y2;
    double_double x_left, x_right;
} row;

SYMRENDER_INLINE row row_of(double y)
{
    /* ray and sphere [1 mul] */
    const double y2 = y * y;

    /* silhouette [5 call] */
    /* the row's hits are -reach <= x <= reach */
    const double_double reach = dd_sqrt(dd_positive_part(dd_sub(rho2, dd_product(y, y))));
    const double_double x_left = dd_neg(reach);
    const double_double x_right = reach;

    const row r = {
        .y = y, .y2 = y2, .x_left = x_left, .x_right = x_right,
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

/* facing2 of the ray through x of this row: its sign says whether the ray hits, for sure where *sure is positive. */
SYMRENDER_INLINE double sight(double x, const row *r, double *sure)
{
    /* ray and sphere [4 mul 8 add 1 select] */
    const double s = x * x + r->y2;   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const double facing2_middle = 1.0 - s * alpha.hi;   /* disc / R^2 where that takes little from f^2 */
    /* distance to the two ends of the span, not negative inside it */
    const double from_left = x - r->x_left.hi - r->x_left.lo;
    const double to_right = r->x_right.hi - x + r->x_right.lo;
    const double chord = from_left * to_right;
    /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
    const double facing2_edge = alpha.hi * chord;
    const double facing2 = middle_s - s > 0.0 ? facing2_middle : facing2_edge;
    const double d_dot_d = s + 1.0;

    *sure = certainty(facing2, d_dot_d);
    return facing2;
}

/* Does the ray through the centre of a pixel of this row hit? The pixel is column pixels to the right of the axis. */
static int is_hit(double column, double plane_y, const row *r, double pixel, double step)
{
    double sure;
    const double facing2 = sight(column * step, r, &sure);

    return sure > 0.0 ? facing2 > 0.0 : hits_exactly(column * pixel, plane_y);
}

/* Values of a block of pixels, from the stages that compute them to those that use them. */
typedef struct {
    double x[POINTS], s[POINTS], facing2[POINTS], along[POINTS], n_x[POINTS], n_z[POINTS], w_z[POINTS], spread[POINTS],
        mirror_x[POINTS], mirror_z[POINTS], inv_d6[POINTS], w_y[POINTS], w2_even[POINTS], n_dot_l_even[POINTS],
        mirror_y[POINTS], w_dot_mirror_even[POINTS], w_x[POINTS], w2[POINTS], inv_w2[POINTS], diffuse[POINTS],
        value[POINTS];
} block;

/* Stage 1, the same for x and -x, y and -y: ray and sphere [4 mul 7 add 1 select]. Leaves x, s, facing2. */
SYMRENDER_INLINE void stage_1(double x, const row *r, block *b, int i)
{
    /* ray and sphere [4 mul 7 add 1 select] */
    const double s = x * x + r->y2;   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const double facing2_middle = 1.0 - s * alpha.hi;   /* disc / R^2 where that takes little from f^2 */
    /* distance to the two ends of the span, not negative inside it */
    const double from_left = x - r->x_left.hi - r->x_left.lo;
    const double to_right = r->x_right.hi - x + r->x_right.lo;
    const double chord = from_left * to_right;
    /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
    const double facing2_edge = alpha.hi * chord;
    const double facing2 = middle_s - s > 0.0 ? facing2_middle : facing2_edge;

    b->x[i] = x;
    b->s[i] = s;
    b->facing2[i] = facing2;
}

/* Stage 2, the same for x and -x, y and -y: ray and sphere, normal, light, specular [11 mul 7 add 1 div 1 sqrt 1
 * max]. Leaves along, n_x, n_z, w_z, spread, mirror_x, mirror_z, inv_d6. */
SYMRENDER_INLINE void stage_2(block *b, int i)
{
    /* ray and sphere [1 add 1 sqrt 1 max] */
    const double d_dot_d = b->s[i] + 1.0;
    /* -n.D, how far the surface faces the ray: root / R */
    const double facing = sqrt(b->facing2[i] > 0.0 ? b->facing2[i] : 0.0);

    /* normal [4 mul 2 add 1 div] */
    const double inv_d2 = 1.0 / d_dot_d;
    const double along = inv_d2 * (along_frame - facing);   /* t / R: n = (t x, t y, e (1 - t)) / R */
    const double n_x = b->x[i] * along;
    const double share_1 = b->s[i] * depth.hi;
    const double n_z = inv_d2 * (facing + share_1);   /* a sum, where e (1 - t) would cancel */

    /* light [1 add] */
    const double w_z = lamp_z - n_z;

    /* specular [7 mul 3 add] */
    const double bounce = 2.0 * facing;
    const double gap2 = b->s[i] * depth2.hi;   /* |m x D|^2 in radii = |D|^2 - facing^2, free of cancellation */
    const double turn = gap2 - b->facing2[i];   /* -|D|^2 cos 2a, a the angle of incidence */
    const double spread = turn + bounce * depth_focal.hi;
    /* the primary ray mirrored at the surface, times |D|^2: turn D + bounce F, F = kappa (f x, f y, s) */
    const double mirror_x = b->x[i] * spread;
    const double mirror_z = share_1 * bounce - turn;
    const double inv_d4 = inv_d2 * inv_d2;
    const double inv_d6 = inv_d2 * inv_d4;   /* 1 / |mirror|^2 */

    b->along[i] = along;
    b->n_x[i] = n_x;
    b->n_z[i] = n_z;
    b->w_z[i] = w_z;
    b->spread[i] = spread;
    b->mirror_x[i] = mirror_x;
    b->mirror_z[i] = mirror_z;
    b->inv_d6[i] = inv_d6;
}

/* Stage 3, the same for x and -x: normal, light, specular [8 mul 4 add]. Leaves w_y, w2_even, n_dot_l_even,
 * mirror_y, w_dot_mirror_even. */
SYMRENDER_INLINE void stage_3(const row *r, block *b, int i)
{
    /* normal [1 mul] */
    const double n_y = r->y * b->along[i];

    /* light [4 mul 3 add] */
    const double w_y = lamp_y - n_y;
    const double w2_even = w_y * w_y + b->w_z[i] * b->w_z[i];   /* what x and -x share in w2 */
    const double n_dot_l_even = n_y * w_y + b->n_z[i] * b->w_z[i];   /* what x and -x share in n_dot_l */

    /* specular [3 mul 1 add] */
    const double mirror_y = r->y * b->spread[i];
    /* what x and -x share in w_dot_mirror */
    const double w_dot_mirror_even = w_y * mirror_y + b->w_z[i] * b->mirror_z[i];

    b->w_y[i] = w_y;
    b->w2_even[i] = w2_even;
    b->n_dot_l_even[i] = n_dot_l_even;
    b->mirror_y[i] = mirror_y;
    b->w_dot_mirror_even[i] = w_dot_mirror_even;
}

/* Stage 4: light, diffuse [4 mul 3 add 1 div 1 sqrt 1 max]. Leaves w_x, w2, inv_w2, diffuse. */
SYMRENDER_INLINE void stage_4(double side, block *b, int i)
{
    const double n_x = side * b->n_x[i];

    /* light [3 mul 3 add 1 div 1 sqrt] */
    const double w_x = lamp_x - n_x;   /* w = (L - P) / R */
    const double w2 = w_x * w_x + b->w2_even[i];   /* |w|^2 */
    const double inv_w2 = 1.0 / w2;
    const double n_dot_l = sqrt(inv_w2) * (n_x * w_x + b->n_dot_l_even[i]);   /* n.l = n.w / |w| */

    /* diffuse [1 mul 1 max]. Phong 1975, Illumination for computer generated pictures */
    const double diffuse = (n_dot_l > 0.0 ? n_dot_l : 0.0) * diffuse_gain;   /* k_d max(0, n.l) */

    b->w_x[i] = w_x;
    b->w2[i] = w2;
    b->inv_w2[i] = inv_w2;
    b->diffuse[i] = diffuse;
}

/* Stage 5: specular, intensity [14 mul 11 add 3 select 4 call]. Leaves value. */
SYMRENDER_INLINE void stage_5(double side, block *b, int i)
{
    const double mirror_x = side * b->mirror_x[i];

    /* specular [14 mul 9 add 2 select 4 call]. Phong 1975, Illumination for computer generated pictures */
    const double w_dot_mirror = b->w_x[i] * mirror_x + b->w_dot_mirror_even[i];   /* r.v = w . mirror / (|w| |D|^3) */
    const double along_w = b->inv_w2[i] * w_dot_mirror;   /* mirror = along_w w + across */
    const double near_cos2 = w_dot_mirror * along_w * b->inv_d6[i];   /* (r.v)^2, but for its scale */
    /* what of mirror is at right angles to w, short where the highlight is */
    const double across_x = mirror_x - b->w_x[i] * along_w;
    const double across_y = b->mirror_y[i] - b->w_y[i] * along_w;
    const double across_z = b->mirror_z[i] - b->w_z[i] * along_w;
    const double near_sin2 = b->inv_d6[i] * (across_x * across_x + across_y * across_y + across_z * across_z);
    /* 1 / (cos^2 + sin^2): 2 - a is 1 / a where a is within rounding of 1 */
    const double rescale = 2.0 - near_cos2 - near_sin2;
    const double cos2 = near_cos2 * rescale;   /* (r.v)^2 */
    const double sin2 = near_sin2 * rescale;   /* 1 - (r.v)^2, accurate where r.v is near 1 */
    const double lobe = 0.5 > sin2 ? 1.0 - sin2 : cos2;   /* (r.v)^2, accurate where r.v is near 1 */
    const double lobe_2 = square(lobe);   /* lobe^2 */
    const double lobe_4 = square(lobe_2);   /* lobe^4 */
    const double lobe_8 = square(lobe_4);   /* lobe^8 */
    const double lobe_16 = square(lobe_8);   /* lobe^16 */
    const double highlight = lobe_16;   /* max(0, r.v)^n where r.v > 0 */
    const double specular = (w_dot_mirror > 0.0 ? highlight : 0.0) * specular_gain;   /* k_s max(0, r.v)^n */

    /* intensity [2 add 1 select]. Phong 1975, Illumination for computer generated pictures */
    const double lit = b->diffuse[i] + specular;   /* what the light adds; the gains hold its intensity */
    const double value = 0.1 + (b->w2[i] > 0.0 ? lit : 0.0);   /* I = k_a + what the light adds */

    b->value[i] = value;
}

/* The stages that differ between x and -x, for pixels right (side 1) or left (side -1) of the middle of the row. */
SYMRENDER_INLINE void finish(double side, int count, const row *r, block *b)
{
    for (int i = 0; i < count; ++i)
        stage_4(side, b, i);
    for (int i = 0; i < count; ++i)
        stage_5(side, b, i);
    (void)r;
}

static inline double at_most(double intensity, double white)
{
    return intensity > white ? white : intensity;
}

/* Rows [row_begin, row_end), and where `twins` is not 0 those at -y with them: what does not change with the sign of y
 * is computed once for both. */
static void draw_rows(double *image, ptrdiff_t stride, const symrender_grid *grid,
    int row_begin, int row_end, int twins)
{
    if (row_begin >= row_end)
        return;
    const double unit = plane_unit;
    const double pixel = grid->pixel, step = pixel * unit;
    const double left = 0.5 - 0.5 * grid->width, top = 0.5 * grid->height - 0.5;
    const double white = grid->white;
    const double background_here = at_most(background, white);
    const int width = grid->width, height = grid->height;
    block b SYMRENDER_ALIGNED;
    row next = row_of((top - row_begin) * pixel * unit);

    for (int j = row_begin; j < row_end; ++j) {
        const int rows = twins && 2 * j + 1 != height ? 2 : 1;
        double *const row_at[2] = {image + j * stride, image + (height - 1 - j) * stride};
        const double plane_y = (top - j) * pixel;
        const row r = next;
        next = row_of((top - (j + 1)) * pixel * unit);   /* begun here, it is ready when this row is done */
        const row r_of[2] = {r, rows == 2 ? row_of(-plane_y * unit) : r};

        /* the hits of a row are one span of pixels, as many left of its middle as right of it; the right end is in
         * closed form and settled by an exact test */
        int last = span_between(0.0, r.x_right.hi / step - left, width).last;
        while (last < width - 1 && is_hit(last + 1 + left, plane_y, &r, pixel, step))
            ++last;
        while (last >= width / 2 && !is_hit(last + left, plane_y, &r, pixel, step))
            --last;

        const int end = last >= width / 2 ? last + 1 : width;
        const int begin = last >= width / 2 ? width - end : width;
        if (j + 1 < row_end) {
            fetch_ahead(row_at[0] + stride, (size_t)width * sizeof *image);
            if (twins)
                fetch_ahead(row_at[1] - stride, (size_t)width * sizeof *image);
        }
        /* the background, in whole vectors: it may run into the hits, which are written over it */
        const int before = whole_vectors(begin) < width ? whole_vectors(begin) : width;
        for (int k = 0; k < rows; ++k) {
            double *restrict out = row_at[k];
            for (int i = 0; i < before; ++i)
                out[i] = background_here;
            for (int i = vectors_begin(end); i < width; ++i)
                out[i] = background_here;
        }
        /* the right half of the span, and pixel by pixel its mirror image */
        for (int at = begin < end ? width / 2 : end, count; at < end; at += count) {
            count = end - at < POINTS ? end - at : POINTS;
            const int vectors = whole_vectors(count);
            for (int i = 0; i < vectors; ++i)
                stage_1((at + i + left) * step, &r, &b, i);
            for (int i = 0; i < vectors; ++i)
                stage_2(&b, i);
            for (int k = 0; k < rows; ++k) {
                double *restrict out = row_at[k];
                for (int i = 0; i < vectors; ++i)
                    stage_3(&r_of[k], &b, i);
                finish(1.0, vectors, &r_of[k], &b);
                for (int i = 0; i < count; ++i)
                    out[at + i] = at_most(b.value[i], white);
                finish(-1.0, vectors, &r_of[k], &b);
                for (int i = 0; i < count; ++i)
                    out[width - 1 - at - i] = at_most(b.value[i], white);
            }
        }
    }
}

void centred_sphere_double_baked_rows(double *image, ptrdiff_t stride, const symrender_grid *grid,
    int row_begin, int row_end)
{
    /* rows [first, last) have their twins among them */
    const int height = grid->height, first = row_begin > height - row_end ? row_begin : height - row_end;
    const int last = height - first;

    draw_rows(image, stride, grid, row_begin, first < last ? first : row_end, 0);
    draw_rows(image, stride, grid, first, first < last ? height - height / 2 : first, 1);
    draw_rows(image, stride, grid, first < last ? last : row_end, row_end, 0);
}

void centred_sphere_double_baked_row_pairs(double *image, ptrdiff_t stride, const symrender_grid *grid,
    int row_begin, int row_end)
{
    draw_rows(image, stride, grid, row_begin, row_end, 1);
}

void centred_sphere_double_baked_points(double *values, const double *x, const double *y,
    ptrdiff_t count, double white)
{
    const double unit = plane_unit;
    const double background_here = at_most(background, white);
    block b SYMRENDER_ALIGNED;

    for (ptrdiff_t at = 0; at < count; at += POINTS) {
        const int length = count - at < POINTS ? (int)(count - at) : POINTS;
        const double *restrict block_x = x + at, *restrict block_y = y + at;
        double *restrict out = values + at;
        double facing[POINTS], doubt[POINTS];
        for (int i = 0; i < length; ++i) {
            const row r = row_of(block_y[i] * unit);
            facing[i] = sight(block_x[i] * unit, &r, &doubt[i]);
            stage_1(block_x[i] * unit, &r, &b, i);
        }
        for (int i = 0; i < length; ++i)
            stage_2(&b, i);
        for (int i = 0; i < length; ++i) {
            const row r = row_of(block_y[i] * unit);
            stage_3(&r, &b, i);
        }
        for (int i = 0; i < length; ++i)
            stage_4(1.0, &b, i);
        for (int i = 0; i < length; ++i)
            stage_5(1.0, &b, i);
        for (int i = 0; i < length; ++i)
            out[i] = at_most(facing[i] > 0.0 ? b.value[i] : background_here, white);
        for (int i = 0; i < length; ++i)
            if (!(doubt[i] > 0.0))
                out[i] = at_most(hits_exactly(block_x[i], block_y[i]) ? b.value[i] : background_here, white);
    }
}
