/* centred_sphere_single: one Phong sphere, one point light
 * Accuracy "single" (symrender_cg 0.1.0)
 * Generated from the formula; do not edit. Regenerate with:
 *     python -m symrender_cg build chapter1 --accuracy single
 *
 * promise  a few units of 1e-6 on the unclipped field, under the conditions of double; hit or miss never wrong
 * in       diffuse term
 *          specular term
 * out      sphere off the axis: the centre is the point looked at: disc depends on x^2 + y^2 alone
 *          sphere at the plane of the eye: the sphere lies wholly before the eye: depth of its centre 4 > R 1
 *          gated specular: the material asks for the specular term as Phong wrote it, not gated by n.l > 0
 *          shadow of the sphere on itself: a sphere is convex: where n.l > 0 the way to the light leaves it; where
 *          not, diffuse is 0
 *          numbers above are those of the scene it was written for; any scene with the same effects may call it
 * ops      once: frame 4 mul 3 div 1 select 21 call
 *          a row: 1 mul 5 call
 *          a pixel: 38 mul 27 add 2 div 2 sqrt 2 max 2 select 2 call
 *          of these, once for four of them, at x and -x, y and -y: 12 mul 7 add 1 div 1 sqrt 1 max
 *          and once for two, at x and -x: 12 mul 6 add
 */
#include "centred_sphere_single.h"

#include "inline.h"
#include "span.h"
#include "units.h"
#include "block.h"
#include "lobe_power.h"
#include "double_double.h"
#include "exact_sign.h"
#include <math.h>

enum { POINTS = 256 };   /* pixels of a block: its arrays fit into the first level cache */

/* What does not change within a frame. */
typedef struct {
    int half_exponent;
    float shininess_single, zero_power_single, lamp_x_single, lamp_y_single, lamp_z_single, alpha_single, focal_single,
        focal2, depth_single, along_frame, diffuse_gain, specular_gain, k_ambient_single;
    double plane_unit;
    double_double rho2;
} frame;

static frame frame_of(const centred_sphere_single_scene *scene)
{
    /* specular [1 select 1 call] */
    const int half_exponent = half_of_whole(scene->shininess);   /* n / 2 where n is an even whole number, else 0 */
    const float shininess_single = (float)scene->shininess;
    const double zero_power = scene->shininess == 0.0 ? 1.0 : 0.0;   /* 0^n: 1 for n = 0 */
    const float k_specular_single = (float)scene->k_specular;
    const float zero_power_single = (float)zero_power;

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
    const float alpha_single = (float)alpha.hi;
    const float focal_single = (float)focal;
    const float focal2 = focal_single * focal_single;

    /* normal [1 mul] */
    const float depth_single = (float)depth.hi;
    const float along_frame = focal_single * depth_single;   /* what is the same for a frame in along */

    /* diffuse [1 mul] */
    const float k_diffuse_single = (float)scene->k_diffuse;
    const float light_intensity_single = (float)scene->light_intensity;
    const float diffuse_gain = k_diffuse_single * light_intensity_single;   /* I_L k_d */

    /* specular [1 mul] */
    const float specular_gain = k_specular_single * light_intensity_single;   /* I_L k_s */

    /* intensity */
    const float k_ambient_single = (float)scene->k_ambient;

    const frame f = {
        .half_exponent = half_exponent,
        .shininess_single = shininess_single,
        .zero_power_single = zero_power_single,
        .plane_unit = plane_unit,
        .lamp_x_single = lamp_x_single,
        .lamp_y_single = lamp_y_single,
        .lamp_z_single = lamp_z_single,
        .rho2 = rho2,
        .alpha_single = alpha_single,
        .focal_single = focal_single,
        .focal2 = focal2,
        .depth_single = depth_single,
        .along_frame = along_frame,
        .diffuse_gain = diffuse_gain,
        .specular_gain = specular_gain,
        .k_ambient_single = k_ambient_single,
    };
    return f;
}

/* What does not change within a row. */
typedef struct {
    double_double x_left, x_right;
    float y_single, y2;
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
    const float y2 = y_single * y_single;

    const row r = {
        .x_left = x_left, .x_right = x_right, .y_single = y_single, .y2 = y2,
    };
    return r;
}

/* Does the ray through (x, y) hit? Settled without rounding, as the sign of a polynomial in the inputs. */
static int hits_exactly(double x, double y, const centred_sphere_single_scene *scene)
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
    const float from_left_single = (float)from_left;
    const float to_right_single = (float)to_right;
    const float chord = from_left_single * to_right_single;
    /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
    const float facing2 = f->alpha_single * chord;
    const float x_single = (float)x;
    const float s = x_single * x_single + r->y2;   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const float d_dot_d = s + f->focal2;

    *sure = certainty(facing2, d_dot_d);
    return facing2;
}

/* Does the ray through the centre of a pixel of this row hit? The pixel is column pixels to the right of the axis. */
static int is_hit(double column, double plane_y, const row *r, const frame *f, double pixel, double step,
    const centred_sphere_single_scene *scene)
{
    double sure;
    const double facing2 = sight(column * step, r, f, &sure);

    return sure > 0.0 ? facing2 > 0.0 : hits_exactly(column * pixel, plane_y, scene);
}

/* Where a pixel lies in its row: numbers of float64, rounded. */
typedef struct {
    float from_left_single, to_right_single, x_single;
} place;

SYMRENDER_INLINE place place_of(double x, const row *r, const frame *f)
{
    /* ray and sphere [4 add] */
    /* distance to the two ends of the span, not negative inside it */
    const double from_left = x - r->x_left.hi - r->x_left.lo;
    const double to_right = r->x_right.hi - x + r->x_right.lo;
    const float from_left_single = (float)from_left;
    const float to_right_single = (float)to_right;
    const float x_single = (float)x;

    const place p = {
        .from_left_single = from_left_single,
        .to_right_single = to_right_single,
        .x_single = x_single,
    };
    (void)f;
    return p;
}

/* The hits of a row, the pixels [begin, end): where the first one lies, the last one, and the middle between them. */
typedef struct {
    place first, middle, last;
    float begin, end, pitch;
} row_hits;

SYMRENDER_INLINE row_hits hits_between(int begin, int end, double left, double step, const row *r, const frame *f)
{
    const row_hits h = {
        .first = place_of((begin + left) * step, r, f),
        .middle = place_of((0.5 * (begin + end - 1) + left) * step, r, f),
        .last = place_of((end - 1 + left) * step, r, f),
        .begin = (float)begin,
        .end = (float)end,
        .pitch = (float)step,
    };
    return h;
}

/* The place of pixel i, counted from them: what vanishes at an end is a sum of numbers that are not negative. */
SYMRENDER_INLINE place place_in(const row_hits *h, int i)
{
    const float column = (float)i, after_first = column - h->begin, before_last = h->end - 1.0f - column;
    const float from_first = after_first * h->pitch, to_last = before_last * h->pitch;
    const float aside = (after_first - before_last) * (0.5f * h->pitch);   /* from the middle, to the right */
    const place p = {
        .from_left_single = h->first.from_left_single + from_first,
        .to_right_single = h->last.to_right_single + to_last,
        .x_single = h->middle.x_single + aside,
    };
    return p;
}

/* Values of a block of pixels, from the stages that compute them to those that use them. */
typedef struct {
    float inv_d2[POINTS], along[POINTS], n_x[POINTS], n_z[POINTS], w_z[POINTS], bounce[POINTS], mirror_x[POINTS],
        mirror_z[POINTS], side_y_odd[POINTS], w2_even[POINTS], n_dot_l_even[POINTS], mirror_y[POINTS],
        w_dot_mirror_even[POINTS], side_z_odd[POINTS], sin2_even[POINTS], w2[POINTS], diffuse[POINTS],
        w_dot_mirror[POINTS], cos2[POINTS], sin2[POINTS], highlight_log2[POINTS], highlight[POINTS], value[POINTS];
} block;

/* Stage 1, the same for x and -x, y and -y: ray and sphere, normal, light, specular [12 mul 7 add 1 div 1 sqrt 1
 * max]. Leaves inv_d2, along, n_x, n_z, w_z, bounce, mirror_x, mirror_z, side_y_odd. */
SYMRENDER_INLINE void stage_1(place p, const row *r, const frame *f, block *b, int i)
{
    /* ray and sphere [3 mul 2 add 1 sqrt 1 max] */
    const float chord = p.from_left_single * p.to_right_single;
    /* disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette */
    const float facing2 = f->alpha_single * chord;
    const float s = p.x_single * p.x_single + r->y2;   /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const float d_dot_d = s + f->focal2;
    /* -n.D, how far the surface faces the ray: root / R */
    const float facing = sqrtf(facing2 > 0.0f ? facing2 : 0.0f);

    /* normal [5 mul 2 add 1 div] */
    const float inv_d2 = 1.0f / d_dot_d;
    const float along = inv_d2 * (f->along_frame - facing);   /* t / R: n = (t x, t y, e (1 - t)) / R */
    const float n_x = p.x_single * along;
    /* a sum, where e (1 - t) would cancel */
    const float n_z = (s * f->depth_single + f->focal_single * facing) * inv_d2;

    /* light [1 add] */
    const float w_z = f->lamp_z_single - n_z;

    /* specular [4 mul 2 add] */
    const float bounce = 2.0f * facing;
    /* the primary ray mirrored at the surface, D + 2 facing n, as long as D */
    const float mirror_x = p.x_single + n_x * bounce;
    const float mirror_z = n_z * bounce - f->focal_single;
    const float side_y_odd = w_z * mirror_x;   /* what x and -x share up to the sign in side_y */

    b->inv_d2[i] = inv_d2;
    b->along[i] = along;
    b->n_x[i] = n_x;
    b->n_z[i] = n_z;
    b->w_z[i] = w_z;
    b->bounce[i] = bounce;
    b->mirror_x[i] = mirror_x;
    b->mirror_z[i] = mirror_z;
    b->side_y_odd[i] = side_y_odd;
}

/* Stage 2, the same for x and -x: normal, light, specular [12 mul 6 add]. Leaves w2_even, n_dot_l_even, mirror_y,
 * w_dot_mirror_even, side_z_odd, sin2_even. */
SYMRENDER_INLINE void stage_2(const row *r, const frame *f, block *b, int i)
{
    /* normal [1 mul] */
    const float n_y = r->y_single * b->along[i];

    /* light [4 mul 3 add] */
    const float w_y = f->lamp_y_single - n_y;
    const float w2_even = w_y * w_y + b->w_z[i] * b->w_z[i];   /* what x and -x share in w2 */
    const float n_dot_l_even = n_y * w_y + b->n_z[i] * b->w_z[i];   /* what x and -x share in n_dot_l */

    /* specular [7 mul 3 add] */
    const float mirror_y = r->y_single + n_y * b->bounce[i];
    /* what x and -x share in w_dot_mirror */
    const float w_dot_mirror_even = w_y * mirror_y + b->w_z[i] * b->mirror_z[i];
    const float side_x = w_y * b->mirror_z[i] - b->w_z[i] * mirror_y;   /* w x mirror, short where the highlight is */
    const float side_z_odd = -(w_y * b->mirror_x[i]);   /* what x and -x share up to the sign in side_z */
    const float sin2_even = side_x * side_x;   /* what x and -x share in sin2 */

    b->w2_even[i] = w2_even;
    b->n_dot_l_even[i] = n_dot_l_even;
    b->mirror_y[i] = mirror_y;
    b->w_dot_mirror_even[i] = w_dot_mirror_even;
    b->side_z_odd[i] = side_z_odd;
    b->sin2_even[i] = sin2_even;
}

/* Stage 3: light, diffuse, specular [13 mul 8 add 1 div 1 sqrt 1 max]. Leaves w2, diffuse, w_dot_mirror, cos2, sin2. */
SYMRENDER_INLINE void stage_3(float side, const frame *f, block *b, int i)
{
    const float n_x = side * b->n_x[i];
    const float mirror_x = side * b->mirror_x[i];
    const float side_y_odd = side * b->side_y_odd[i];
    const float side_z_odd = side * b->side_z_odd[i];

    /* light [3 mul 3 add 1 div 1 sqrt] */
    const float w_x = f->lamp_x_single - n_x;   /* w = (L - P) / R */
    const float w2 = w_x * w_x + b->w2_even[i];   /* |w|^2 */
    const float inv_w2 = 1.0f / w2;
    const float n_dot_l = sqrtf(inv_w2) * (n_x * w_x + b->n_dot_l_even[i]);   /* n.l = n.w / |w| */

    /* diffuse [1 mul 1 max]. Phong 1975, Illumination for computer generated pictures */
    const float diffuse = (n_dot_l > 0.0f ? n_dot_l : 0.0f) * f->diffuse_gain;   /* k_d max(0, n.l) */

    /* specular [9 mul 5 add] */
    const float w_dot_mirror = w_x * mirror_x + b->w_dot_mirror_even[i];   /* r.v = w . mirror / (|w| |D|) */
    const float inv_w2_d2 = b->inv_d2[i] * inv_w2;
    const float cos2 = w_dot_mirror * w_dot_mirror * inv_w2_d2;   /* (r.v)^2 */
    const float side_y = side_y_odd - w_x * b->mirror_z[i];
    const float side_z = w_x * b->mirror_y[i] + side_z_odd;
    /* 1 - (r.v)^2, accurate where r.v is near 1 */
    const float sin2 = inv_w2_d2 * (side_y * side_y + side_z * side_z + b->sin2_even[i]);

    b->w2[i] = w2;
    b->diffuse[i] = diffuse;
    b->w_dot_mirror[i] = w_dot_mirror;
    b->cos2[i] = cos2;
    b->sin2[i] = sin2;
}

/* Stage 4: specular [1 call]. Leaves highlight_log2. */
SYMRENDER_INLINE void stage_4(block *b, int i)
{
    /* specular [1 call] */
    const float highlight_log2 = log2_of_lobef(b->cos2[i], b->sin2[i]);   /* log2 (r.v)^2 */

    b->highlight_log2[i] = highlight_log2;
}

/* Stage 5: specular [1 call]. Leaves highlight. */
SYMRENDER_INLINE void stage_5(const frame *f, block *b, int i)
{
    /* specular [1 call]. Phong 1975, Illumination for computer generated pictures */
    /* max(0, r.v)^n where r.v > 0 */
    const float highlight = power_of_lobef(b->highlight_log2[i], f->shininess_single);

    b->highlight[i] = highlight;
}

/* Stage 6: specular, intensity [1 mul 2 add 2 select]. Leaves value. */
SYMRENDER_INLINE void stage_6(const frame *f, block *b, int i)
{
    const float highlight = b->highlight[i];
    const float zero_power_single = f->zero_power_single;

    /* specular [1 mul 1 select]. Phong 1975, Illumination for computer generated pictures */
    /* k_s max(0, r.v)^n */
    const float specular = (b->w_dot_mirror[i] > 0.0f ? highlight : zero_power_single) * f->specular_gain;

    /* intensity [2 add 1 select]. Phong 1975, Illumination for computer generated pictures */
    const float lit = b->diffuse[i] + specular;   /* what the light adds; the gains hold its intensity */
    const float value = f->k_ambient_single + (b->w2[i] > 0.0f ? lit : 0.0f);   /* I = k_a + what the light adds */

    b->value[i] = value;
}

/* The stages that differ between x and -x, for pixels right (side 1) or left (side -1) of the middle of the row. */
SYMRENDER_INLINE void finish(float side, int count, const row *r, const frame *f, block *b)
{
    for (int i = 0; i < count; ++i)
        stage_3(side, f, b, i);
    if (f->half_exponent > 0) {
        whole_powers_of_lobef(b->sin2, b->highlight_log2, b->highlight, f->half_exponent, count);
    } else {
        for (int i = 0; i < count; ++i)
            stage_4(b, i);
        for (int i = 0; i < count; ++i)
            stage_5(f, b, i);
    }
    for (int i = 0; i < count; ++i)
        stage_6(f, b, i);
    (void)r;
}

static inline float at_most(float intensity, float white)
{
    return intensity > white ? white : intensity;
}

/* Rows [row_begin, row_end), and where `twins` is not 0 those at -y with them: what does not change with the sign of y
 * is computed once for both. */
static void draw_rows(float *image, ptrdiff_t stride, const symrender_grid *grid,
    const centred_sphere_single_scene *scene, int row_begin, int row_end, int twins)
{
    if (row_begin >= row_end)
        return;
    const frame f = frame_of(scene);
    const double unit = f.plane_unit;
    const double pixel = grid->pixel, step = pixel * unit;
    const double left = 0.5 - 0.5 * grid->width, top = 0.5 * grid->height - 0.5;
    const float white = (float)grid->white;
    const float background = at_most((float)scene->background, white);
    const int width = grid->width, height = grid->height;
    block b SYMRENDER_ALIGNED;
    row next = row_of((top - row_begin) * pixel * unit, &f);

    for (int j = row_begin; j < row_end; ++j) {
        const int rows = twins && 2 * j + 1 != height ? 2 : 1;
        float *const row_at[2] = {image + j * stride, image + (height - 1 - j) * stride};
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
            float *restrict out = row_at[k];
            for (int i = 0; i < before; ++i)
                out[i] = background;
            for (int i = vectors_begin(end); i < width; ++i)
                out[i] = background;
        }
        const row_hits h = hits_between(begin, end, left, step, &r, &f);
        /* the right half of the span, and pixel by pixel its mirror image */
        for (int at = begin < end ? width / 2 : end, count; at < end; at += count) {
            count = end - at < POINTS ? end - at : POINTS;
            const int vectors = whole_vectors(count);
            for (int i = 0; i < vectors; ++i)
                stage_1(place_in(&h, at + i), &r, &f, &b, i);
            for (int k = 0; k < rows; ++k) {
                float *restrict out = row_at[k];
                for (int i = 0; i < vectors; ++i)
                    stage_2(&r_of[k], &f, &b, i);
                finish(1.0f, vectors, &r_of[k], &f, &b);
                for (int i = 0; i < count; ++i)
                    out[at + i] = at_most(b.value[i], white);
                finish(-1.0f, vectors, &r_of[k], &f, &b);
                for (int i = 0; i < count; ++i)
                    out[width - 1 - at - i] = at_most(b.value[i], white);
            }
        }
    }
}

void centred_sphere_single_rows(float *image, ptrdiff_t stride, const symrender_grid *grid,
    const centred_sphere_single_scene *scene, int row_begin, int row_end)
{
    /* rows [first, last) have their twins among them */
    const int height = grid->height, first = row_begin > height - row_end ? row_begin : height - row_end;
    const int last = height - first;

    draw_rows(image, stride, grid, scene, row_begin, first < last ? first : row_end, 0);
    draw_rows(image, stride, grid, scene, first, first < last ? height - height / 2 : first, 1);
    draw_rows(image, stride, grid, scene, first < last ? last : row_end, row_end, 0);
}

void centred_sphere_single_row_pairs(float *image, ptrdiff_t stride, const symrender_grid *grid,
    const centred_sphere_single_scene *scene, int row_begin, int row_end)
{
    draw_rows(image, stride, grid, scene, row_begin, row_end, 1);
}

void centred_sphere_single_points(float *values, const double *x, const double *y,
    ptrdiff_t count, double white_limit, const centred_sphere_single_scene *scene)
{
    const frame f = frame_of(scene);
    const double unit = f.plane_unit;
    const float white = (float)white_limit;
    const float background = at_most((float)scene->background, white);
    block b SYMRENDER_ALIGNED;

    for (ptrdiff_t at = 0; at < count; at += POINTS) {
        const int length = count - at < POINTS ? (int)(count - at) : POINTS;
        const double *restrict block_x = x + at, *restrict block_y = y + at;
        float *restrict out = values + at;
        double facing[POINTS], doubt[POINTS];
        for (int i = 0; i < length; ++i) {
            const row r = row_of(block_y[i] * unit, &f);
            facing[i] = sight(block_x[i] * unit, &r, &f, &doubt[i]);
            stage_1(place_of(block_x[i] * unit, &r, &f), &r, &f, &b, i);
        }
        for (int i = 0; i < length; ++i) {
            const row r = row_of(block_y[i] * unit, &f);
            stage_2(&r, &f, &b, i);
        }
        for (int i = 0; i < length; ++i)
            stage_3(1.0f, &f, &b, i);
        if (f.half_exponent > 0) {
            whole_powers_of_lobef(b.sin2, b.highlight_log2, b.highlight, f.half_exponent, length);
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

void centred_sphere_single_batch(float *images, ptrdiff_t image_stride, ptrdiff_t stride,
    const symrender_grid *grids, const centred_sphere_single_scene *scenes,
    ptrdiff_t row_begin, ptrdiff_t row_end)
{
    const int height = grids->height;

    for (ptrdiff_t k = row_begin / height; k * height < row_end; ++k) {
        const ptrdiff_t top = k * height;
        const int begin = row_begin > top ? (int)(row_begin - top) : 0;
        const int end = row_end - top < height ? (int)(row_end - top) : height;
        centred_sphere_single_rows(
            images + k * image_stride, stride, &grids[k], &scenes[k], begin, end);
    }
}
