/* centred_sphere_fast: one Phong sphere, one point light
 * Accuracy "fast" (symrender_cg 0.1.0)
 * Generated from the formula; do not edit. Regenerate with:
 *     python -m symrender_cg build chapter1 --accuracy fast
 *
 * promise  right to within one grey level of 256 for n <= 1000; hit or miss never wrong
 * in       diffuse term
 *          specular term
 * out      sphere off the axis: the centre is the point looked at: disc depends on x^2 + y^2 alone
 *          sphere at the plane of the eye: the sphere lies wholly before the eye: depth of its centre 4 > R 1
 *          gated specular: the material asks for the specular term as Phong wrote it, not gated by n.l > 0
 *          shadow of the sphere on itself: a sphere is convex: where n.l > 0 the way to the light leaves it; where
 *          not, diffuse is 0
 *          numbers above are those of the scene it was written for; any scene with the same effects may call it
 * ops      once: frame 4 mul 3 div 1 select 20 call
 *          a row: 1 mul 5 call
 *          a pixel: 28 mul 23 add 2 div 2 sqrt 2 max 2 select 1 call
 */
#include "centred_sphere_fast.h"

#include "inline.h"
#include "span.h"
#include "units.h"
#include "fast_power.h"
#include "double_double.h"
#include "exact_sign.h"
#include <math.h>

enum { POINTS = 256 };   /* points shaded in one go, before the few doubtful ones among them are settled */

/* What does not change within a frame. */
typedef struct {
    double plane_unit;
    float lamp_x_single, lamp_y_single, lamp_z_single, focal_single, d_dot_d_frame, depth_single, along_frame,
        diffuse_gain, shininess_single, specular_gain, zero_power_single, k_ambient_single;
    double_double alpha, rho2;
} frame;

static frame frame_of(const centred_sphere_fast_scene *scene)
{
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
    /* farther than 2^30 R a light shines in parallel */
    const int lamp_exponent = light_exponent(world_exponent, scene->radius, from_center_x, from_center_y,
        from_center_z, 30);
    const double lamp_x = ldexp(from_center_x, lamp_exponent) / radius;   /* (L - C) / R */
    const float lamp_x_single = (float)lamp_x;
    const double lamp_y = ldexp(from_center_y, lamp_exponent) / radius;
    const float lamp_y_single = (float)lamp_y;
    const double lamp_z = ldexp(from_center_z, lamp_exponent) / radius;
    const float lamp_z_single = (float)lamp_z;

    /* silhouette [11 call] */
    /* alpha = kappa^2 - 1, free of cancellation */
    const double_double alpha = dd_div(dd_mul(dd_difference(eye, radius), dd_sum(eye, radius)),
        dd_product(radius, radius));
    /* rays D = (x, y, -f): f is e, in the unit of the image plane */
    const double focal = ldexp(scene->eye, plane_exponent);
    /* the silhouette is the circle x^2 + y^2 = rho^2 = f^2 / alpha */
    const double_double rho2 = dd_div(dd_product(focal, focal), alpha);
    /* kappa = e / R: lengths of the scene in radii */
    const double_double depth = dd_div(dd_from(eye), dd_from(radius));

    /* ray and sphere [1 mul] */
    const float focal_single = (float)focal;
    const float d_dot_d_frame = focal_single * focal_single;   /* what is the same for a frame in d_dot_d */

    /* normal [1 mul] */
    const float depth_single = (float)depth.hi;
    const float along_frame = focal_single * depth_single;   /* what is the same for a frame in along */

    /* diffuse [1 mul] */
    const float k_diffuse_single = (float)scene->k_diffuse;
    const float light_intensity_single = (float)scene->light_intensity;
    const float diffuse_gain = k_diffuse_single * light_intensity_single;   /* I_L k_d */

    /* specular [1 mul 1 select] */
    const float shininess_single = (float)scene->shininess;
    const double zero_power = scene->shininess == 0.0 ? 1.0 : 0.0;   /* 0^n: 1 for n = 0 */
    const float k_specular_single = (float)scene->k_specular;
    const float specular_gain = k_specular_single * light_intensity_single;   /* I_L k_s */
    const float zero_power_single = (float)zero_power;

    /* intensity */
    const float k_ambient_single = (float)scene->k_ambient;

    const frame f = {
        .plane_unit = plane_unit,
        .lamp_x_single = lamp_x_single,
        .lamp_y_single = lamp_y_single,
        .lamp_z_single = lamp_z_single,
        .alpha = alpha,
        .rho2 = rho2,
        .focal_single = focal_single,
        .d_dot_d_frame = d_dot_d_frame,
        .depth_single = depth_single,
        .along_frame = along_frame,
        .diffuse_gain = diffuse_gain,
        .shininess_single = shininess_single,
        .specular_gain = specular_gain,
        .zero_power_single = zero_power_single,
        .k_ambient_single = k_ambient_single,
    };
    return f;
}

/* What does not change within a row. */
typedef struct {
    double_double x_left, x_right;
    float y_single, s_row;
} row;

SYMRENDER_INLINE row row_of(double y, const frame *f)
{
    /* silhouette [5 call] */
    /* the row's hits are -reach <= x <= reach */
    const double_double reach = dd_sqrt(dd_positive_part(dd_sub(f->rho2, dd_product(y, y))));
    const double_double x_left = dd_neg(reach);
    const double_double x_right = reach;

    /* ray and sphere [1 mul] */
    const float y_single = (float)y;
    const float s_row = y_single * y_single;   /* what is the same for a row in s */

    const row r = {
        .x_left = x_left, .x_right = x_right, .y_single = y_single, .s_row = s_row,
    };
    return r;
}

/* Does the ray through (x, y) hit? Settled without rounding, as the sign of a polynomial in the inputs. */
static int hits_exactly(double x, double y, const centred_sphere_fast_scene *scene)
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
    const centred_sphere_fast_scene *scene)
{
    const double x = column * step;

    /* ray and sphere [3 mul 6 add] */
    /* distance to the two ends of the span, not negative inside it */
    const double from_left = x - r->x_left.hi - r->x_left.lo;
    const double to_right = r->x_right.hi - x + r->x_right.lo;
    const double chord = from_left * to_right;
    /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
    const double facing2 = f->alpha.hi * chord;
    const float x_single = (float)x;
    const float s = x_single * x_single + r->s_row;   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const float d_dot_d = s + f->d_dot_d_frame;

    return certainty(facing2, d_dot_d) > 0.0 ? facing2 > 0.0 : hits_exactly(column * pixel, plane_y, scene);
}

/* Intensity of the sphere along the ray through x of this row, and in *sure how surely the ray hits or misses:
 * the sign of *sight says which. */
SYMRENDER_INLINE float shade(double x, const row *r, const frame *f, double *sight, double *sure)
{
    /* ray and sphere [3 mul 6 add 1 sqrt 1 max] */
    /* distance to the two ends of the span, not negative inside it */
    const double from_left = x - r->x_left.hi - r->x_left.lo;
    const double to_right = r->x_right.hi - x + r->x_right.lo;
    const double chord = from_left * to_right;
    /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
    const double facing2 = f->alpha.hi * chord;
    const float x_single = (float)x;
    const float s = x_single * x_single + r->s_row;   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const float d_dot_d = s + f->d_dot_d_frame;
    const float facing2_single = (float)facing2;
    /* -n.D, how far the surface faces the ray: root / R */
    const float facing = sqrtf(facing2_single > 0.0f ? facing2_single : 0.0f);

    /* normal [6 mul 2 add 1 div] */
    const float inv_d2 = 1.0f / d_dot_d;
    const float along = inv_d2 * (f->along_frame - facing);   /* t / R: n = (t x, t y, e (1 - t)) / R */
    const float n_x = x_single * along;
    const float n_y = r->y_single * along;
    /* a sum, where e (1 - t) would cancel */
    const float n_z = (s * f->depth_single + f->focal_single * facing) * inv_d2;

    /* light [7 mul 7 add 1 div 1 sqrt] */
    const float w_x = f->lamp_x_single - n_x;   /* w = (L - P) / R */
    const float w_y = f->lamp_y_single - n_y;
    const float w_z = f->lamp_z_single - n_z;
    const float w2 = w_x * w_x + w_y * w_y + w_z * w_z;   /* |w|^2 */
    const float inv_w2 = 1.0f / w2;
    const float n_dot_l = (n_x * w_x + n_y * w_y + n_z * w_z) * sqrtf(inv_w2);   /* n.l = n.w / |w| */

    /* diffuse [1 mul 1 max]. Phong 1975, Illumination for computer generated pictures */
    const float diffuse = (n_dot_l > 0.0f ? n_dot_l : 0.0f) * f->diffuse_gain;   /* k_d max(0, n.l) */

    /* specular [11 mul 6 add 1 select 1 call]. Phong 1975, Illumination for computer generated pictures */
    const float bounce = 2.0f * facing;
    /* the primary ray mirrored at the surface, D + 2 facing n, as long as D */
    const float mirror_x = x_single + n_x * bounce;
    const float mirror_y = r->y_single + n_y * bounce;
    const float mirror_z = n_z * bounce - f->focal_single;
    const float w_dot_mirror = w_x * mirror_x + w_y * mirror_y + w_z * mirror_z;   /* r.v = w . mirror / (|w| |D|) */
    const float inv_w2_d2 = inv_d2 * inv_w2;
    const float cos2 = w_dot_mirror * w_dot_mirror * inv_w2_d2;   /* (r.v)^2 */
    const float sin2 = 1.0f - cos2;   /* 1 - (r.v)^2 as a difference: what cancels is paid for */
    const float highlight = fast_power_of_cosinef(cos2, sin2, f->shininess_single);   /* max(0, r.v)^n where r.v > 0 */
    /* k_s max(0, r.v)^n */
    const float specular = (w_dot_mirror > 0.0f ? highlight : f->zero_power_single) * f->specular_gain;

    /* intensity [2 add 1 select]. Phong 1975, Illumination for computer generated pictures */
    const float lit = diffuse + specular;   /* what the light adds; the gains hold its intensity */
    const float value = f->k_ambient_single + (w2 > 0.0f ? lit : 0.0f);   /* I = k_a + what the light adds */

    *sight = facing2;
    *sure = certainty(facing2, d_dot_d);
    return value;
}

static inline float at_most(float intensity, float white)
{
    return intensity > white ? white : intensity;
}

void centred_sphere_fast_rows(float *image, ptrdiff_t stride, const symrender_grid *grid,
    const centred_sphere_fast_scene *scene, int row_begin, int row_end)
{
    const frame f = frame_of(scene);
    const double unit = f.plane_unit;
    const double pixel = grid->pixel, step = pixel * unit;
    const double left = 0.5 - 0.5 * grid->width, top = 0.5 * grid->height - 0.5;
    const float white = (float)grid->white;
    const float background = at_most((float)scene->background, white);
    const int width = grid->width;

    for (int j = row_begin; j < row_end; ++j) {
        float *restrict out = image + j * stride;
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
        for (int i = begin; i < end; ++i) {
            double sight, sure;
            out[i] = at_most(shade((i + left) * step, &r, &f, &sight, &sure), white);
        }
        for (int i = end; i < width; ++i)
            out[i] = background;
    }
}

void centred_sphere_fast_points(float *values, const double *x, const double *y,
    ptrdiff_t count, double white_limit, const centred_sphere_fast_scene *scene)
{
    const frame f = frame_of(scene);
    const double unit = f.plane_unit;
    const float white = (float)white_limit;
    const float background = at_most((float)scene->background, white);

    for (ptrdiff_t block = 0; block < count; block += POINTS) {
        const int length = count - block < POINTS ? (int)(count - block) : POINTS;
        const double *restrict block_x = x + block, *restrict block_y = y + block;
        float *restrict out = values + block;
        double doubt[POINTS];
        for (int i = 0; i < length; ++i) {
            const row r = row_of(block_y[i] * unit, &f);
            double sight, sure;
            const float intensity = shade(block_x[i] * unit, &r, &f, &sight, &sure);
            out[i] = at_most(sight > 0.0 ? intensity : background, white);
            doubt[i] = sure;
        }
        for (int i = 0; i < length; ++i)
            if (!(doubt[i] > 0.0)) {
                const row r = row_of(block_y[i] * unit, &f);
                double sight, sure;
                const float intensity = shade(block_x[i] * unit, &r, &f, &sight, &sure);
                out[i] = at_most(hits_exactly(block_x[i], block_y[i], scene) ? intensity : background, white);
            }
    }
}
