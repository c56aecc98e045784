/* off_axis_sphere_double: one Phong sphere, one point light
 * Accuracy "double" (symrender_cg 0.1.0)
 * Generated from the formula; do not edit. Regenerate with:
 *     python -m symrender_cg build off_axis --accuracy double
 *
 * promise  at most 1e-15 max(1, value) off where no light is within 1e-3 R of a surface and n <= 1000; another
 *          kernel draws what this one may not; no overflow; hit or miss never wrong
 * in       sphere off the axis
 *          diffuse term
 *          specular term
 * out      sphere at the plane of the eye: the sphere lies wholly before the eye: depth of its centre 4.49121 > R
 *          0.875
 *          gated specular: the material asks for the specular term as Phong wrote it, not gated by n.l > 0
 *          shadow of the sphere on itself: a sphere is convex: where n.l > 0 the way to the light leaves it; where
 *          not, diffuse is 0
 *          numbers above are those of the scene it was written for; any scene with the same effects may call it
 * ops      once: frame 3 mul 3 add 4 div 1 select 42 call
 *          a row: 5 mul 2 add 16 call
 *          a pixel: 54 mul 39 add 2 div 2 sqrt 2 max 2 select 2 call
 */
#include "off_axis_sphere_double.h"

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
    double zero_power, specular_gain, plane_unit, lamp_x, lamp_y, lamp_z, focal, d_dot_d_frame, tilt_frame,
        diffuse_gain, k_ambient, shininess;
    double_double offset_y, alpha, depth, offset_x, row_mid_frame, row_gap_frame, focal2, row_half_frame, x_left_frame,
        image_x, image_y, depth2;
} frame;

static frame frame_of(const off_axis_sphere_double_scene *scene)
{
    /* specular [1 mul 1 select 1 call] */
    const int half_exponent = half_of_whole(scene->shininess);   /* n / 2 where n is an even whole number, else 0 */
    const double zero_power = scene->shininess == 0.0 ? 1.0 : 0.0;   /* 0^n: 1 for n = 0 */
    const double specular_gain = scene->k_specular * scene->light_intensity;   /* I_L k_s */

    /* units of length, powers of two [8 call] */
    const int plane_exponent = unit_exponent(scene->eye);   /* f = e 2^k in [1, 2) */
    const double plane_unit = ldexp(1, plane_exponent);
    const int world_exponent = unit_exponent(scene->radius);   /* R 2^k in [1, 2) */
    const double eye = ldexp(scene->eye, world_exponent);
    const double radius = ldexp(scene->radius, world_exponent);
    const double center_x = ldexp(scene->center_x, world_exponent);
    const double center_y = ldexp(scene->center_y, world_exponent);
    const double center_z = ldexp(scene->center_z, world_exponent);

    /* light [3 add 3 div 4 call] */
    const double from_center_x = scene->light_x - scene->center_x;   /* L - C */
    const double from_center_y = scene->light_y - scene->center_y;
    const double from_center_z = scene->light_z - scene->center_z;
    /* farther than 2^60 R a light shines in parallel */
    const int lamp_exponent = light_exponent(world_exponent, scene->radius, from_center_x, from_center_y,
        from_center_z, 60);
    const double lamp_x = ldexp(from_center_x, lamp_exponent) / radius;   /* (L - C) / R */
    const double lamp_y = ldexp(from_center_y, lamp_exponent) / radius;
    const double lamp_z = ldexp(from_center_z, lamp_exponent) / radius;

    /* silhouette [28 call] */
    const double_double distance = dd_difference(eye, center_z);   /* of the eye from the plane of the centre */
    const double_double offset_y = dd_div(dd_from(center_y), dd_from(radius));
    /* disc / R^2 is -alpha x^2 + ... along a row; alpha = kappa^2 - 1 + offset_y^2 > 0 */
    const double_double alpha = dd_add(dd_div(dd_mul(dd_add_double(distance, -radius),
        dd_add_double(distance, radius)), dd_product(radius, radius)), dd_mul(offset_y, offset_y));
    /* rays D = (x, y, -f): f is e, in the unit of the image plane */
    const double focal = ldexp(scene->eye, plane_exponent);
    const double_double depth = dd_div(distance, dd_from(radius));   /* kappa: the same in radii */
    const double_double offset_x = dd_div(dd_from(center_x), dd_from(radius));
    const double_double row_mid_frame = dd_mul_double(depth, focal);   /* what is the same for a frame in row_mid */
    const double_double share_3 = dd_mul_double(offset_y, focal);
    const double_double row_gap_frame = dd_neg(share_3);   /* what is the same for a frame in row_gap */
    const double_double focal2 = dd_product(focal, focal);
    /* what is the same for a frame in row_half */
    const double_double row_half_frame = dd_add(alpha, dd_mul(offset_x, offset_x));
    const double_double x_left_frame = dd_div(dd_from(1.0), alpha);   /* what is the same for a frame in x_left */
    /* where the centre appears on the image plane */
    const double_double image_x = dd_div(dd_mul_double(offset_x, focal), depth);
    const double_double image_y = dd_div(share_3, depth);

    /* ray and sphere [1 mul] */
    const double d_dot_d_frame = focal * focal;   /* what is the same for a frame in d_dot_d */

    /* normal [1 div] */
    const double tilt_frame = 1.0 / focal;   /* what is the same for a frame in tilt */

    /* diffuse [1 mul] */
    const double diffuse_gain = scene->k_diffuse * scene->light_intensity;   /* I_L k_d */

    /* specular [1 call] */
    const double_double depth2 = dd_mul(depth, depth);

    const frame f = {
        .half_exponent = half_exponent,
        .zero_power = zero_power,
        .specular_gain = specular_gain,
        .plane_unit = plane_unit,
        .lamp_x = lamp_x,
        .lamp_y = lamp_y,
        .lamp_z = lamp_z,
        .offset_y = offset_y,
        .alpha = alpha,
        .focal = focal,
        .depth = depth,
        .offset_x = offset_x,
        .row_mid_frame = row_mid_frame,
        .row_gap_frame = row_gap_frame,
        .focal2 = focal2,
        .row_half_frame = row_half_frame,
        .x_left_frame = x_left_frame,
        .image_x = image_x,
        .image_y = image_y,
        .d_dot_d_frame = d_dot_d_frame,
        .tilt_frame = tilt_frame,
        .diffuse_gain = diffuse_gain,
        .depth2 = depth2,
        .k_ambient = scene->k_ambient,
        .shininess = scene->shininess,
    };
    return f;
}

/* What does not change within a row. */
typedef struct {
    double y, y2, tilt_row, foot_y_row, foot_z_row, dy2;
    double_double x_left, x_right;
} row;

SYMRENDER_INLINE row row_of(double y, const frame *f)
{
    /* silhouette [16 call] */
    /* alpha times the span's middle */
    const double_double row_mid = dd_mul(f->offset_x, dd_add(dd_mul_double(f->offset_y, y), f->row_mid_frame));
    /* by how much the row misses the centre */
    const double_double row_gap = dd_add(dd_mul_double(f->depth, y), f->row_gap_frame);
    /* positive where the plane through eye and row cuts the sphere */
    const double_double row_disc = dd_sub(dd_add(dd_product(y, y), f->focal2), dd_mul(row_gap, row_gap));
    /* alpha times half the span's length */
    const double_double row_half = dd_sqrt(dd_positive_part(dd_mul(row_disc, f->row_half_frame)));
    /* the row's hits are x_left <= x <= x_right */
    const double_double x_left = dd_mul(dd_sub(row_mid, row_half), f->x_left_frame);
    const double_double x_right = dd_mul(dd_add(row_mid, row_half), f->x_left_frame);

    /* ray and sphere [1 mul] */
    const double y2 = y * y;

    /* normal [3 mul 2 add] */
    const double dy = y - f->image_y.hi - f->image_y.lo;
    const double tilt_row = f->image_x.hi * dy;   /* what is the same for a row in tilt */
    const double foot_y_row = f->focal * dy;   /* what is the same for a row in foot_y */
    const double foot_z_row = y * dy;   /* what is the same for a row in foot_z */

    /* specular [1 mul] */
    const double dy2 = dy * dy;

    const row r = {
        .y = y, .x_left = x_left, .x_right = x_right, .y2 = y2, .tilt_row = tilt_row, .foot_y_row = foot_y_row,
        .foot_z_row = foot_z_row, .dy2 = dy2,
    };
    return r;
}

/* Does the ray through (x, y) hit? Settled without rounding, as the sign of a polynomial in the inputs. */
static int hits_exactly(double x, double y, const off_axis_sphere_double_scene *scene)
{
    exact_sum sum;
    exact_sum_clear(&sum);   /* disc */
    exact_sum_add_product(&sum, -1, scene->center_x, scene->center_x, scene->eye, scene->eye);
    exact_sum_add_product(&sum, -1, scene->center_x, scene->center_x, y, y);
    exact_sum_add_product(&sum,  2, scene->center_x, scene->center_y, x, y);
    exact_sum_add_product(&sum, -2, scene->center_x, scene->center_z, scene->eye, x);
    exact_sum_add_product(&sum,  2, scene->center_x, scene->eye, scene->eye, x);
    exact_sum_add_product(&sum, -1, scene->center_y, scene->center_y, scene->eye, scene->eye);
    exact_sum_add_product(&sum, -1, scene->center_y, scene->center_y, x, x);
    exact_sum_add_product(&sum, -2, scene->center_y, scene->center_z, scene->eye, y);
    exact_sum_add_product(&sum,  2, scene->center_y, scene->eye, scene->eye, y);
    exact_sum_add_product(&sum, -1, scene->center_z, scene->center_z, x, x);
    exact_sum_add_product(&sum, -1, scene->center_z, scene->center_z, y, y);
    exact_sum_add_product(&sum,  2, scene->center_z, scene->eye, x, x);
    exact_sum_add_product(&sum,  2, scene->center_z, scene->eye, y, y);
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
    const double d_dot_d = s + f->d_dot_d_frame;

    *sure = certainty(facing2, d_dot_d);
    return facing2;
}

/* Does the ray through the centre of a pixel of this row hit? The pixel is column pixels to the right of the axis. */
static int is_hit(double column, double plane_y, const row *r, const frame *f, double pixel, double step,
    const off_axis_sphere_double_scene *scene)
{
    double sure;
    const double facing2 = sight(column * step, r, f, &sure);

    return sure > 0.0 ? facing2 > 0.0 : hits_exactly(column * pixel, plane_y, scene);
}

/* Values of a block of pixels, from the stages that compute them to those that use them. */
typedef struct {
    double x[POINTS], facing2[POINTS], facing[POINTS], inv_d2[POINTS], dx[POINTS], tilt[POINTS], foot_x[POINTS],
        n_x[POINTS], foot_y[POINTS], foot_z[POINTS], w_x[POINTS], w_y[POINTS], w_z[POINTS], w2[POINTS], inv_w2[POINTS],
        diffuse[POINTS], bounce[POINTS], turn[POINTS], w_dot_mirror[POINTS], cos2[POINTS], sin2[POINTS],
        highlight_log2[POINTS], highlight[POINTS], value[POINTS];
} block;

/* Stage 1: ray and sphere, normal [10 mul 11 add 1 div 1 sqrt 1 max]. Leaves x, facing2, facing, inv_d2, dx, tilt,
 * foot_x, n_x. */
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
    const double d_dot_d = s + f->d_dot_d_frame;
    const double facing = sqrt(facing2 > 0.0 ? facing2 : 0.0);   /* -n.D, how far the surface faces the ray: root / R */

    /* normal [7 mul 5 add 1 div] */
    const double inv_d2 = 1.0 / d_dot_d;
    const double dx = x - f->image_x.hi - f->image_x.lo;   /* the pixel seen from the image of the centre */
    const double tilt = f->tilt_frame * (r->tilt_row - dx * f->image_y.hi);
    /* F, the foot point of the ray times |D|^2, is at right angles to D */
    const double foot_x = f->depth.hi * (f->focal * dx - r->y * tilt);
    const double n_x = inv_d2 * (foot_x - x * facing);   /* n is F less facing D, over |D|^2 */

    b->x[i] = x;
    b->facing2[i] = facing2;
    b->facing[i] = facing;
    b->inv_d2[i] = inv_d2;
    b->dx[i] = dx;
    b->tilt[i] = tilt;
    b->foot_x[i] = foot_x;
    b->n_x[i] = n_x;
}

/* Stage 2: normal, light, diffuse, specular [20 mul 14 add 1 div 1 sqrt 1 max]. Leaves foot_y, foot_z, w_x, w_y,
 * w_z, w2, inv_w2, diffuse, bounce, turn. */
SYMRENDER_INLINE void stage_2(const row *r, const frame *f, block *b, int i)
{
    /* normal [8 mul 4 add] */
    const double foot_y = f->depth.hi * (b->x[i] * b->tilt[i] + r->foot_y_row);
    const double n_y = b->inv_d2[i] * (foot_y - r->y * b->facing[i]);
    const double foot_z = f->depth.hi * (b->x[i] * b->dx[i] + r->foot_z_row);
    const double n_z = b->inv_d2[i] * (f->focal * b->facing[i] + foot_z);

    /* light [7 mul 7 add 1 div 1 sqrt] */
    const double w_x = f->lamp_x - b->n_x[i];   /* w = (L - P) / R */
    const double w_y = f->lamp_y - n_y;
    const double w_z = f->lamp_z - n_z;
    const double w2 = w_x * w_x + w_y * w_y + w_z * w_z;   /* |w|^2 */
    const double inv_w2 = 1.0 / w2;
    const double n_dot_l = (b->n_x[i] * w_x + n_y * w_y + n_z * w_z) * sqrt(inv_w2);   /* n.l = n.w / |w| */

    /* diffuse [1 mul 1 max]. Phong 1975, Illumination for computer generated pictures */
    const double diffuse = (n_dot_l > 0.0 ? n_dot_l : 0.0) * f->diffuse_gain;   /* k_d max(0, n.l) */

    /* specular [4 mul 3 add] */
    const double bounce = 2.0 * b->facing[i];
    /* |m x D|^2 in radii = |D|^2 - facing^2, free of cancellation */
    const double gap2 = f->depth2.hi * (b->dx[i] * b->dx[i] + b->tilt[i] * b->tilt[i] + r->dy2);
    const double turn = gap2 - b->facing2[i];   /* -|D|^2 cos 2a, a the angle of incidence */

    b->foot_y[i] = foot_y;
    b->foot_z[i] = foot_z;
    b->w_x[i] = w_x;
    b->w_y[i] = w_y;
    b->w_z[i] = w_z;
    b->w2[i] = w2;
    b->inv_w2[i] = inv_w2;
    b->diffuse[i] = diffuse;
    b->bounce[i] = bounce;
    b->turn[i] = turn;
}

/* Stage 3: specular [23 mul 12 add]. Leaves w_dot_mirror, cos2, sin2. */
SYMRENDER_INLINE void stage_3(const row *r, const frame *f, block *b, int i)
{
    /* specular [23 mul 12 add] */
    /* the primary ray mirrored at the surface, times |D|^2 */
    const double mirror_x = b->foot_x[i] * b->bounce[i] + b->x[i] * b->turn[i];
    const double mirror_y = b->foot_y[i] * b->bounce[i] + r->y * b->turn[i];
    const double mirror_z = b->foot_z[i] * b->bounce[i] - f->focal * b->turn[i];
    /* r.v = w . mirror / (|w| |D|^3) */
    const double w_dot_mirror = b->w_x[i] * mirror_x + b->w_y[i] * mirror_y + b->w_z[i] * mirror_z;
    const double along_w = b->inv_w2[i] * w_dot_mirror;   /* mirror = along_w w + across */
    const double inv_d4 = b->inv_d2[i] * b->inv_d2[i];
    const double inv_d6 = b->inv_d2[i] * inv_d4;   /* 1 / |mirror|^2 */
    const double near_cos2 = w_dot_mirror * along_w * inv_d6;   /* (r.v)^2, but for its scale */
    /* what of mirror is at right angles to w, short where the highlight is */
    const double across_x = mirror_x - b->w_x[i] * along_w;
    const double across_y = mirror_y - b->w_y[i] * along_w;
    const double across_z = mirror_z - b->w_z[i] * along_w;
    const double near_sin2 = inv_d6 * (across_x * across_x + across_y * across_y + across_z * across_z);
    /* 1 / (cos^2 + sin^2): 2 - a is 1 / a where a is within rounding of 1 */
    const double rescale = 2.0 - near_cos2 - near_sin2;
    const double cos2 = near_cos2 * rescale;   /* (r.v)^2 */
    const double sin2 = near_sin2 * rescale;   /* 1 - (r.v)^2, accurate where r.v is near 1 */

    b->w_dot_mirror[i] = w_dot_mirror;
    b->cos2[i] = cos2;
    b->sin2[i] = sin2;
}

/* Stage 4: specular [1 call]. Leaves highlight_log2. */
SYMRENDER_INLINE void stage_4(block *b, int i)
{
    /* specular [1 call] */
    const double highlight_log2 = log2_of_lobe(b->cos2[i], b->sin2[i]);   /* log2 (r.v)^2 */

    b->highlight_log2[i] = highlight_log2;
}

/* Stage 5: specular [1 call]. Leaves highlight. */
SYMRENDER_INLINE void stage_5(const frame *f, block *b, int i)
{
    /* specular [1 call]. Phong 1975, Illumination for computer generated pictures */
    const double highlight = power_of_lobe(b->highlight_log2[i], f->shininess);   /* max(0, r.v)^n where r.v > 0 */

    b->highlight[i] = highlight;
}

/* Stage 6: specular, intensity [1 mul 2 add 2 select]. Leaves value. */
SYMRENDER_INLINE void stage_6(const frame *f, block *b, int i)
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

/* All stages after the first. */
SYMRENDER_INLINE void finish(int count, const row *r, const frame *f, block *b)
{
    for (int i = 0; i < count; ++i)
        stage_2(r, f, b, i);
    for (int i = 0; i < count; ++i)
        stage_3(r, f, b, i);
    if (f->half_exponent > 0) {
        whole_powers_of_lobe(b->sin2, b->highlight_log2, b->highlight, f->half_exponent, count);
    } else {
        for (int i = 0; i < count; ++i)
            stage_4(b, i);
        for (int i = 0; i < count; ++i)
            stage_5(f, b, i);
    }
    for (int i = 0; i < count; ++i)
        stage_6(f, b, i);
}

static inline double at_most(double intensity, double white)
{
    return intensity > white ? white : intensity;
}

void off_axis_sphere_double_rows(double *image, ptrdiff_t stride, const symrender_grid *grid,
    const off_axis_sphere_double_scene *scene, int row_begin, int row_end)
{
    const frame f = frame_of(scene);
    const double unit = f.plane_unit;
    const double pixel = grid->pixel, step = pixel * unit;
    const double left = 0.5 - 0.5 * grid->width, top = 0.5 * grid->height - 0.5;
    const double white = grid->white;
    const double background = at_most(scene->background, white);
    const int width = grid->width;
    block b SYMRENDER_ALIGNED;
    row next = row_of((top - row_begin) * pixel * unit, &f);

    for (int j = row_begin; j < row_end; ++j) {
        double *restrict out = image + j * stride;
        const double plane_y = (top - j) * pixel;
        const row r = next;
        next = row_of((top - (j + 1)) * pixel * unit, &f);   /* begun here, it is ready when this row is done */

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
        if (j + 1 < row_end)
            fetch_ahead(out + stride, (size_t)width * sizeof *out);
        /* the background, in whole vectors: it may run into the hits, which are written over it */
        const int before = whole_vectors(begin) < width ? whole_vectors(begin) : width;
        for (int i = 0; i < before; ++i)
            out[i] = background;
        for (int i = vectors_begin(end); i < width; ++i)
            out[i] = background;
        for (int at = begin, count; at < end; at += count) {
            count = end - at < POINTS ? end - at : POINTS;
            const int vectors = whole_vectors(count);
            for (int i = 0; i < vectors; ++i)
                stage_1((at + i + left) * step, &r, &f, &b, i);
            finish(vectors, &r, &f, &b);
            for (int i = 0; i < count; ++i)
                out[at + i] = at_most(b.value[i], white);
        }
    }
}

void off_axis_sphere_double_points(double *values, const double *x, const double *y,
    ptrdiff_t count, double white, const off_axis_sphere_double_scene *scene)
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
        for (int i = 0; i < length; ++i) {
            const row r = row_of(block_y[i] * unit, &f);
            stage_2(&r, &f, &b, i);
        }
        for (int i = 0; i < length; ++i) {
            const row r = row_of(block_y[i] * unit, &f);
            stage_3(&r, &f, &b, i);
        }
        if (f.half_exponent > 0) {
            whole_powers_of_lobe(b.sin2, b.highlight_log2, b.highlight, f.half_exponent, length);
        } else {
            for (int i = 0; i < length; ++i)
                stage_4(&b, i);
            for (int i = 0; i < length; ++i)
                stage_5(&f, &b, i);
        }
        for (int i = 0; i < length; ++i)
            stage_6(&f, &b, i);
        for (int i = 0; i < length; ++i)
            out[i] = at_most(facing[i] > 0.0 ? b.value[i] : background, white);
        for (int i = 0; i < length; ++i)
            if (!(doubt[i] > 0.0))
                out[i] = at_most(hits_exactly(block_x[i], block_y[i], scene) ? b.value[i] : background, white);
    }
}

void off_axis_sphere_double_batch(double *images, ptrdiff_t image_stride, ptrdiff_t stride,
    const symrender_grid *grids, const off_axis_sphere_double_scene *scenes,
    ptrdiff_t row_begin, ptrdiff_t row_end)
{
    const int height = grids->height;

    for (ptrdiff_t k = row_begin / height; k * height < row_end; ++k) {
        const ptrdiff_t top = k * height;
        const int begin = row_begin > top ? (int)(row_begin - top) : 0;
        const int end = row_end - top < height ? (int)(row_end - top) : height;
        off_axis_sphere_double_rows(
            images + k * image_stride, stride, &grids[k], &scenes[k], begin, end);
    }
}
