/* centred_sphere_double: one Phong sphere, one point light
 * Accuracy "double" (symrender_cg 0.1.0)
 * Generated from the formula; do not edit. Regenerate with:
 *     python -m symrender_cg build chapter1 --accuracy double
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
 *          numbers above are those of the scene it was written for; any scene with the same effects may call it
 * ops      once: frame 5 mul 3 div 1 select 23 call
 *          a row: 1 mul 5 call
 *          a pixel: 43 mul 31 add 2 div 2 sqrt 2 max 3 select 2 call
 *          of these, once for four of them, at x and -x, y and -y: 17 mul 14 add 1 div 1 sqrt 1 max 1 select
 *          and once for two, at x and -x: 8 mul 4 add
 */
#include "centred_sphere_double.h"

#include "inline.h"
#include "span.h"
#include "units.h"
#include "block.h"
#include "lobe_power.h"
#include "double_double.h"
#include "exact_sign.h"
#include <math.h>

enum { POINTS = 128 };   /* pixels of a block: its arrays fit into the first level cache */

/* What does not change within a frame. */
typedef struct {
    int half_exponent;
    double zero_power, specular_gain, plane_unit, lamp_x, lamp_y, lamp_z, focal, middle_s, focal2, along_frame,
        diffuse_gain, k_ambient, shininess;
    double_double alpha, rho2, depth, depth2, depth_focal;
} frame;

static frame frame_of(const centred_sphere_double_scene *scene)
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

    /* light [3 div 4 call] */
    const double from_center_x = scene->light_x;   /* L - C */
    const double from_center_y = scene->light_y;
    const double from_center_z = scene->light_z;
    /* farther than 2^60 R a light shines in parallel */
    const int lamp_exponent = light_exponent(world_exponent, scene->radius, from_center_x, from_center_y,
        from_center_z, 60);
    const double lamp_x = ldexp(from_center_x, lamp_exponent) / radius;   /* (L - C) / R */
    const double lamp_y = ldexp(from_center_y, lamp_exponent) / radius;
    const double lamp_z = ldexp(from_center_z, lamp_exponent) / radius;

    /* silhouette [1 mul 11 call] */
    /* rays D = (x, y, -f): f is e, in the unit of the image plane */
    const double focal = ldexp(scene->eye, plane_exponent);
    /* alpha = kappa^2 - 1, free of cancellation */
    const double_double alpha = dd_div(dd_mul(dd_difference(eye, radius), dd_sum(eye, radius)),
        dd_product(radius, radius));
    /* the silhouette is the circle x^2 + y^2 = rho^2 = f^2 / alpha */
    const double_double rho2 = dd_div(dd_product(focal, focal), alpha);
    const double middle_s = 0.5 * rho2.hi;   /* where the angle of incidence is 45 degrees */
    /* kappa = e / R: lengths of the scene in radii */
    const double_double depth = dd_div(dd_from(eye), dd_from(radius));

    /* ray and sphere [1 mul] */
    const double focal2 = focal * focal;

    /* normal [1 mul] */
    const double along_frame = focal * depth.hi;   /* what is the same for a frame in along */

    /* diffuse [1 mul] */
    const double diffuse_gain = scene->k_diffuse * scene->light_intensity;   /* I_L k_d */

    /* specular [2 call] */
    const double_double depth2 = dd_mul(depth, depth);
    const double_double depth_focal = dd_mul_double(depth, focal);

    const frame f = {
        .half_exponent = half_exponent,
        .zero_power = zero_power,
        .specular_gain = specular_gain,
        .plane_unit = plane_unit,
        .lamp_x = lamp_x,
        .lamp_y = lamp_y,
        .lamp_z = lamp_z,
        .focal = focal,
        .alpha = alpha,
        .rho2 = rho2,
        .middle_s = middle_s,
        .depth = depth,
        .focal2 = focal2,
        .along_frame = along_frame,
        .diffuse_gain = diffuse_gain,
        .depth2 = depth2,
        .depth_focal = depth_focal,
        .k_ambient = scene->k_ambient,
        .shininess = scene->shininess,
    };
    return f;
}

/* What does not change within a row. */
typedef struct {
    double y, y2;
    double_double x_left, x_right;
} row;

SYMRENDER_INLINE row row_of(double y, const frame *f)
{
    /* ray and sphere [1 mul] */
    const double y2 = y * y;

    /* silhouette [5 call] */
    /* the row's hits are -reach <= x <= reach */
    const double_double reach = dd_sqrt(dd_positive_part(dd_sub(f->rho2, dd_product(y, y))));
    const double_double x_left = dd_neg(reach);
    const double_double x_right = reach;

    const row r = {
        .y = y, .y2 = y2, .x_left = x_left, .x_right = x_right,
    };
    return r;
}

/* Does the ray through (x, y) hit? Settled without rounding, as the sign of a polynomial in the inputs. */
static int hits_exactly(double x, double y, const centred_sphere_double_scene *scene)
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
    /* ray and sphere [4 mul 8 add 1 select] */
    const double s = x * x + r->y2;   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const double facing2_middle = f->focal2 - s * f->alpha.hi;   /* disc / R^2 where that takes little from f^2 */
    /* distance to the two ends of the span, not negative inside it */
    const double from_left = x - r->x_left.hi - r->x_left.lo;
    const double to_right = r->x_right.hi - x + r->x_right.lo;
    const double chord = from_left * to_right;
    /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
    const double facing2_edge = f->alpha.hi * chord;
    const double facing2 = f->middle_s - s > 0.0 ? facing2_middle : facing2_edge;
    const double d_dot_d = s + f->focal2;

    *sure = certainty(facing2, d_dot_d);
    return facing2;
}

/* Does the ray through the centre of a pixel of this row hit? The pixel is column pixels to the right of the axis. */
static int is_hit(double column, double plane_y, const row *r, const frame *f, double pixel, double step,
    const centred_sphere_double_scene *scene)
{
    double sure;
    const double facing2 = sight(column * step, r, f, &sure);

    return sure > 0.0 ? facing2 > 0.0 : hits_exactly(column * pixel, plane_y, scene);
}

/* Values of a block of pixels, from the stages that compute them to those that use them. */
typedef struct {
    double x[POINTS], s[POINTS], facing2[POINTS], along[POINTS], n_x[POINTS], n_z[POINTS], w_z[POINTS], spread[POINTS],
        mirror_x[POINTS], mirror_z[POINTS], inv_d6[POINTS], w_y[POINTS], w2_even[POINTS], n_dot_l_even[POINTS],
        mirror_y[POINTS], w_dot_mirror_even[POINTS], w2[POINTS], diffuse[POINTS], w_dot_mirror[POINTS], cos2[POINTS],
        sin2[POINTS], highlight_log2[POINTS], highlight[POINTS], value[POINTS];
} block;

/* Stage 1, the same for x and -x, y and -y: ray and sphere [4 mul 7 add 1 select]. Leaves x, s, facing2. */
SYMRENDER_INLINE void stage_1(double x, const row *r, const frame *f, block *b, int i)
{
    /* ray and sphere [4 mul 7 add 1 select] */
    const double s = x * x + r->y2;   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const double facing2_middle = f->focal2 - s * f->alpha.hi;   /* disc / R^2 where that takes little from f^2 */
    /* distance to the two ends of the span, not negative inside it */
    const double from_left = x - r->x_left.hi - r->x_left.lo;
    const double to_right = r->x_right.hi - x + r->x_right.lo;
    const double chord = from_left * to_right;
    /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
    const double facing2_edge = f->alpha.hi * chord;
    const double facing2 = f->middle_s - s > 0.0 ? facing2_middle : facing2_edge;

    b->x[i] = x;
    b->s[i] = s;
    b->facing2[i] = facing2;
}

/* Stage 2, the same for x and -x, y and -y: ray and sphere, normal, light, specular [13 mul 7 add 1 div 1 sqrt 1
 * max]. Leaves along, n_x, n_z, w_z, spread, mirror_x, mirror_z, inv_d6. */
SYMRENDER_INLINE void stage_2(const frame *f, block *b, int i)
{
    /* ray and sphere [1 add 1 sqrt 1 max] */
    const double d_dot_d = b->s[i] + f->focal2;
    /* -n.D, how far the surface faces the ray: root / R */
    const double facing = sqrt(b->facing2[i] > 0.0 ? b->facing2[i] : 0.0);

    /* normal [5 mul 2 add 1 div] */
    const double inv_d2 = 1.0 / d_dot_d;
    const double along = inv_d2 * (f->along_frame - facing);   /* t / R: n = (t x, t y, e (1 - t)) / R */
    const double n_x = b->x[i] * along;
    const double share_1 = b->s[i] * f->depth.hi;
    const double n_z = inv_d2 * (f->focal * facing + share_1);   /* a sum, where e (1 - t) would cancel */

    /* light [1 add] */
    const double w_z = f->lamp_z - n_z;

    /* specular [8 mul 3 add] */
    const double bounce = 2.0 * facing;
    const double gap2 = b->s[i] * f->depth2.hi;   /* |m x D|^2 in radii = |D|^2 - facing^2, free of cancellation */
    const double turn = gap2 - b->facing2[i];   /* -|D|^2 cos 2a, a the angle of incidence */
    const double spread = turn + bounce * f->depth_focal.hi;
    /* the primary ray mirrored at the surface, times |D|^2: turn D + bounce F, F = kappa (f x, f y, s) */
    const double mirror_x = b->x[i] * spread;
    const double mirror_z = share_1 * bounce - f->focal * turn;
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
SYMRENDER_INLINE void stage_3(const row *r, const frame *f, block *b, int i)
{
    /* normal [1 mul] */
    const double n_y = r->y * b->along[i];

    /* light [4 mul 3 add] */
    const double w_y = f->lamp_y - n_y;
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

/* Stage 4: light, diffuse, specular [17 mul 11 add 1 div 1 sqrt 1 max]. Leaves w2, diffuse, w_dot_mirror, cos2,
 * sin2. */
SYMRENDER_INLINE void stage_4(double side, const frame *f, block *b, int i)
{
    const double n_x = side * b->n_x[i];
    const double mirror_x = side * b->mirror_x[i];

    /* light [3 mul 3 add 1 div 1 sqrt] */
    const double w_x = f->lamp_x - n_x;   /* w = (L - P) / R */
    const double w2 = w_x * w_x + b->w2_even[i];   /* |w|^2 */
    const double inv_w2 = 1.0 / w2;
    const double n_dot_l = sqrt(inv_w2) * (n_x * w_x + b->n_dot_l_even[i]);   /* n.l = n.w / |w| */

    /* diffuse [1 mul 1 max]. Phong 1975, Illumination for computer generated pictures */
    const double diffuse = (n_dot_l > 0.0 ? n_dot_l : 0.0) * f->diffuse_gain;   /* k_d max(0, n.l) */

    /* specular [13 mul 8 add] */
    const double w_dot_mirror = w_x * mirror_x + b->w_dot_mirror_even[i];   /* r.v = w . mirror / (|w| |D|^3) */
    const double along_w = inv_w2 * w_dot_mirror;   /* mirror = along_w w + across */
    const double near_cos2 = w_dot_mirror * along_w * b->inv_d6[i];   /* (r.v)^2, but for its scale */
    /* what of mirror is at right angles to w, short where the highlight is */
    const double across_x = mirror_x - w_x * along_w;
    const double across_y = b->mirror_y[i] - b->w_y[i] * along_w;
    const double across_z = b->mirror_z[i] - b->w_z[i] * along_w;
    const double near_sin2 = b->inv_d6[i] * (across_x * across_x + across_y * across_y + across_z * across_z);
    /* 1 / (cos^2 + sin^2): 2 - a is 1 / a where a is within rounding of 1 */
    const double rescale = 2.0 - near_cos2 - near_sin2;
    const double cos2 = near_cos2 * rescale;   /* (r.v)^2 */
    const double sin2 = near_sin2 * rescale;   /* 1 - (r.v)^2, accurate where r.v is near 1 */

    b->w2[i] = w2;
    b->diffuse[i] = diffuse;
    b->w_dot_mirror[i] = w_dot_mirror;
    b->cos2[i] = cos2;
    b->sin2[i] = sin2;
}

/* Stage 5: specular [1 call]. Leaves highlight_log2. */
SYMRENDER_INLINE void stage_5(block *b, int i)
{
    /* specular [1 call] */
    const double highlight_log2 = log2_of_lobe(b->cos2[i], b->sin2[i]);   /* log2 (r.v)^2 */

    b->highlight_log2[i] = highlight_log2;
}

/* Stage 6: specular [1 call]. Leaves highlight. */
SYMRENDER_INLINE void stage_6(const frame *f, block *b, int i)
{
    /* specular [1 call]. Phong 1975, Illumination for computer generated pictures */
    const double highlight = power_of_lobe(b->highlight_log2[i], f->shininess);   /* max(0, r.v)^n where r.v > 0 */

    b->highlight[i] = highlight;
}

/* Stage 7: specular, intensity [1 mul 2 add 2 select]. Leaves value. */
SYMRENDER_INLINE void stage_7(const frame *f, block *b, int i)
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
        stage_4(side, f, b, i);
    if (f->half_exponent > 0) {
        whole_powers_of_lobe(b->sin2, b->highlight_log2, b->highlight, f->half_exponent, count);
    } else {
        for (int i = 0; i < count; ++i)
            stage_5(b, i);
        for (int i = 0; i < count; ++i)
            stage_6(f, b, i);
    }
    for (int i = 0; i < count; ++i)
        stage_7(f, b, i);
    (void)r;
}

static inline double at_most(double intensity, double white)
{
    return intensity > white ? white : intensity;
}

/* Rows [row_begin, row_end), and where `twins` is not 0 those at -y with them: what does not change with the sign of y
 * is computed once for both. */
static void draw_rows(double *image, ptrdiff_t stride, const symrender_grid *grid,
    const centred_sphere_double_scene *scene, int row_begin, int row_end, int twins)
{
    if (row_begin >= row_end)
        return;
    const frame f = frame_of(scene);
    const double unit = f.plane_unit;
    const double pixel = grid->pixel, step = pixel * unit;
    const double left = 0.5 - 0.5 * grid->width, top = 0.5 * grid->height - 0.5;
    const double white = grid->white;
    const double background = at_most(scene->background, white);
    const int width = grid->width, height = grid->height;
    block b SYMRENDER_ALIGNED;
    row next = row_of((top - row_begin) * pixel * unit, &f);

    for (int j = row_begin; j < row_end; ++j) {
        const int rows = twins && 2 * j + 1 != height ? 2 : 1;
        double *const row_at[2] = {image + j * stride, image + (height - 1 - j) * stride};
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
                out[i] = background;
            for (int i = vectors_begin(end); i < width; ++i)
                out[i] = background;
        }
        /* the right half of the span, and pixel by pixel its mirror image */
        for (int at = begin < end ? width / 2 : end, count; at < end; at += count) {
            count = end - at < POINTS ? end - at : POINTS;
            const int vectors = whole_vectors(count);
            for (int i = 0; i < vectors; ++i)
                stage_1((at + i + left) * step, &r, &f, &b, i);
            for (int i = 0; i < vectors; ++i)
                stage_2(&f, &b, i);
            for (int k = 0; k < rows; ++k) {
                double *restrict out = row_at[k];
                for (int i = 0; i < vectors; ++i)
                    stage_3(&r_of[k], &f, &b, i);
                finish(1.0, vectors, &r_of[k], &f, &b);
                for (int i = 0; i < count; ++i)
                    out[at + i] = at_most(b.value[i], white);
                finish(-1.0, vectors, &r_of[k], &f, &b);
                for (int i = 0; i < count; ++i)
                    out[width - 1 - at - i] = at_most(b.value[i], white);
            }
        }
    }
}

void centred_sphere_double_rows(double *image, ptrdiff_t stride, const symrender_grid *grid,
    const centred_sphere_double_scene *scene, int row_begin, int row_end)
{
    /* rows [first, last) have their twins among them */
    const int height = grid->height, first = row_begin > height - row_end ? row_begin : height - row_end;
    const int last = height - first;

    draw_rows(image, stride, grid, scene, row_begin, first < last ? first : row_end, 0);
    draw_rows(image, stride, grid, scene, first, first < last ? height - height / 2 : first, 1);
    draw_rows(image, stride, grid, scene, first < last ? last : row_end, row_end, 0);
}

void centred_sphere_double_row_pairs(double *image, ptrdiff_t stride, const symrender_grid *grid,
    const centred_sphere_double_scene *scene, int row_begin, int row_end)
{
    draw_rows(image, stride, grid, scene, row_begin, row_end, 1);
}

void centred_sphere_double_points(double *values, const double *x, const double *y,
    ptrdiff_t count, double white, const centred_sphere_double_scene *scene)
{
    const frame f = frame_of(scene);
    const double unit = f.plane_unit;
    const double background = at_most(scene->background, white);
    block b SYMRENDER_ALIGNED;

    for (ptrdiff_t at = 0; at < count; at += POINTS) {
        const int length = count - at < POINTS ? (int)(count - at) : POINTS;
        const double *restrict block_x = x + at, *restrict block_y = y + at;
        double *restrict out = values + at;
        double facing[POINTS], doubt[POINTS];
        for (int i = 0; i < length; ++i) {
            const row r = row_of(block_y[i] * unit, &f);
            facing[i] = sight(block_x[i] * unit, &r, &f, &doubt[i]);
            stage_1(block_x[i] * unit, &r, &f, &b, i);
        }
        for (int i = 0; i < length; ++i)
            stage_2(&f, &b, i);
        for (int i = 0; i < length; ++i) {
            const row r = row_of(block_y[i] * unit, &f);
            stage_3(&r, &f, &b, i);
        }
        for (int i = 0; i < length; ++i)
            stage_4(1.0, &f, &b, i);
        if (f.half_exponent > 0) {
            whole_powers_of_lobe(b.sin2, b.highlight_log2, b.highlight, f.half_exponent, length);
        } else {
            for (int i = 0; i < length; ++i)
                stage_5(&b, i);
            for (int i = 0; i < length; ++i)
                stage_6(&f, &b, i);
        }
        for (int i = 0; i < length; ++i)
            stage_7(&f, &b, i);
        for (int i = 0; i < length; ++i)
            out[i] = at_most(facing[i] > 0.0 ? b.value[i] : background, white);
        for (int i = 0; i < length; ++i)
            if (!(doubt[i] > 0.0))
                out[i] = at_most(hits_exactly(block_x[i], block_y[i], scene) ? b.value[i] : background, white);
    }
}

void centred_sphere_double_batch(double *images, ptrdiff_t image_stride, ptrdiff_t stride,
    const symrender_grid *grids, const centred_sphere_double_scene *scenes,
    ptrdiff_t row_begin, ptrdiff_t row_end)
{
    const int height = grids->height;

    for (ptrdiff_t k = row_begin / height; k * height < row_end; ++k) {
        const ptrdiff_t top = k * height;
        const int begin = row_begin > top ? (int)(row_begin - top) : 0;
        const int end = row_end - top < height ? (int)(row_end - top) : height;
        centred_sphere_double_rows(
            images + k * image_stride, stride, &grids[k], &scenes[k], begin, end);
    }
}
