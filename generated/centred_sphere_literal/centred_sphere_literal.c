/* centred_sphere_literal: one Phong sphere, one point light
 * Accuracy "literal" (symrender_cg 0.1.0)
 * Generated from the formula; do not edit. Regenerate with:
 *     python -m symrender_cg build chapter1 --accuracy literal
 *
 * promise  none: the seed's formula as it stands, in float64
 * in       diffuse term
 *          specular term
 * out      sphere off the axis: the centre is the point looked at: disc depends on x^2 + y^2 alone
 *          sphere at the plane of the eye: the sphere lies wholly before the eye: depth of its centre 4 > R 1
 *          gated specular: the material asks for the specular term as Phong wrote it, not gated by n.l > 0
 *          shadow of the sphere on itself: a sphere is convex: where n.l > 0 the way to the light leaves it; where
 *          not, diffuse is 0
 *          numbers above are those of the scene it was written for; any scene with the same effects may call it
 * ops      once: frame 3 mul 1 add 1 div
 *          a row: 1 mul
 *          a pixel: 23 mul 17 add 8 div 3 sqrt 3 max 1 select 1 call
 */
#include "centred_sphere_literal.h"

#include "inline.h"
#include "phong_power.h"
#include <math.h>

/* What does not change within a frame. */
typedef struct {
    double disc_frame, disc_frame_1, eye2, m_dot_d, n_x_frame, eye, light_x, light_y, light_z, light_intensity,
        k_ambient, k_diffuse, k_specular, shininess;
} frame;

static frame frame_of(const centred_sphere_literal_scene *scene)
{
    /* ray and sphere [3 mul 1 add] */
    const double share_1 = scene->eye * scene->eye;
    const double share_2 = scene->radius * scene->radius;
    const double disc_frame = share_1 * share_2;   /* what is the same for a frame in disc */
    const double disc_frame_1 = share_2 - share_1;   /* what is the same for a frame in disc */
    const double eye2 = share_1;
    const double m_dot_d = share_1;   /* positive where the sphere lies before the eye */

    /* hit point and normal [1 div] */
    const double n_x_frame = 1.0 / scene->radius;   /* what is the same for a frame in n_x */

    const frame f = {
        .disc_frame = disc_frame,
        .disc_frame_1 = disc_frame_1,
        .eye2 = eye2,
        .m_dot_d = m_dot_d,
        .n_x_frame = n_x_frame,
        .eye = scene->eye,
        .light_x = scene->light_x,
        .light_y = scene->light_y,
        .light_z = scene->light_z,
        .light_intensity = scene->light_intensity,
        .k_ambient = scene->k_ambient,
        .k_diffuse = scene->k_diffuse,
        .k_specular = scene->k_specular,
        .shininess = scene->shininess,
    };
    return f;
}

/* What does not change within a row. */
typedef struct {
    double y, y2;
} row;

SYMRENDER_INLINE row row_of(double y, const frame *f)
{
    /* ray and sphere [1 mul] */
    const double y2 = y * y;
    (void)f;

    const row r = {
        .y = y, .y2 = y2,
    };
    return r;
}

/* Intensity along the ray through x of this row. */
SYMRENDER_INLINE double shade(double x, const row *r, const frame *f, double background)
{
    /* ray and sphere [2 mul 3 add 1 sqrt 1 max] */
    const double share_3 = x * x + r->y2;
    /* disc = e^2 R^2 - (e^2 - R^2)(x^2 + y^2): a hit where >= 0 */
    const double disc = f->disc_frame + f->disc_frame_1 * share_3;
    const double d_dot_d = share_3 + f->eye2;   /* D = (x, y, -e), A = |D|^2 */
    const double root = sqrt(disc > 0.0 ? disc : 0.0);

    /* hit point and normal [6 mul 2 add 1 div] */
    const double t = (f->m_dot_d - root) / d_dot_d;   /* nearer root of the quadratic */
    const double hit_x = x * t;   /* P = E + t D */
    const double hit_y = r->y * t;
    const double hit_z = f->eye * (1.0 - t);
    const double n_x = hit_x * f->n_x_frame;   /* n = (P - C) / R, of length 1 */
    const double n_y = hit_y * f->n_x_frame;
    const double n_z = hit_z * f->n_x_frame;

    /* light [6 mul 7 add 3 div 1 sqrt] */
    const double w_x = f->light_x - hit_x;   /* w = L - P */
    const double w_y = f->light_y - hit_y;
    const double w_z = f->light_z - hit_z;
    const double w_length = sqrt(w_x * w_x + w_y * w_y + w_z * w_z);
    const double l_x = w_x / w_length;   /* l = w / |w| */
    const double l_y = w_y / w_length;
    const double l_z = w_z / w_length;
    const double n_dot_l = n_x * l_x + n_y * l_y + n_z * l_z;   /* n.l */

    /* diffuse [1 mul 1 max]. Phong 1975, Illumination for computer generated pictures */
    const double diffuse = f->k_diffuse * (n_dot_l > 0.0 ? n_dot_l : 0.0);   /* k_d max(0, n.l) */

    /* specular [7 mul 3 add 4 div 1 sqrt 1 max 1 call]. Phong 1975, Illumination for computer generated pictures */
    const double d_length = sqrt(d_dot_d);
    const double v_x = -(x / d_length);   /* v = (E - P) / |E - P| = -D / |D|: no hit point in it */
    const double v_y = -(r->y / d_length);
    const double v_z = f->eye / d_length;
    const double l_dot_v = l_x * v_x + l_y * v_y + l_z * v_z;   /* l.v */
    const double n_dot_v = root * f->n_x_frame / d_length;   /* n.v = root / (R |D|) */
    /* r.v with r = 2 (n.l) n - l, the light mirrored at the normal */
    const double r_dot_v = 2.0 * n_dot_l * n_dot_v - l_dot_v;
    /* k_s max(0, r.v)^n */
    const double specular = f->k_specular * power(r_dot_v > 0.0 ? r_dot_v : 0.0, f->shininess);

    /* intensity [1 mul 2 add 1 select]. Phong 1975, Illumination for computer generated pictures */
    const double lit = f->light_intensity * (diffuse + specular);   /* what the light adds: I_L (diffuse + specular) */
    const double value = f->k_ambient + (w_length > 0.0 ? lit : 0.0);   /* I = k_a + what the light adds */

    return disc >= 0.0 ? value : background;
}

static inline double at_most(double intensity, double white)
{
    return intensity > white ? white : intensity;
}

void centred_sphere_literal_rows(double *image, ptrdiff_t stride, const symrender_grid *grid,
    const centred_sphere_literal_scene *scene, int row_begin, int row_end)
{
    const frame f = frame_of(scene);
    const double unit = 1.0;
    const double pixel = grid->pixel, step = pixel * unit;
    const double left = 0.5 - 0.5 * grid->width, top = 0.5 * grid->height - 0.5;
    const double white = grid->white;
    const double background = at_most(scene->background, white);
    const int width = grid->width;

    for (int j = row_begin; j < row_end; ++j) {
        double *restrict out = image + j * stride;
        const row r = row_of((top - j) * step, &f);
        for (int i = 0; i < width; ++i)
            out[i] = at_most(shade((i + left) * step, &r, &f, background), white);
    }
}

void centred_sphere_literal_points(double *values, const double *x, const double *y,
    ptrdiff_t count, double white, const centred_sphere_literal_scene *scene)
{
    const frame f = frame_of(scene);
    const double unit = 1.0;
    const double background = at_most(scene->background, white);

    for (ptrdiff_t i = 0; i < count; ++i) {
        const row r = row_of(y[i] * unit, &f);
        values[i] = at_most(shade(x[i] * unit, &r, &f, background), white);
    }
}

void centred_sphere_literal_batch(double *images, ptrdiff_t image_stride, ptrdiff_t stride,
    const symrender_grid *grids, const centred_sphere_literal_scene *scenes,
    ptrdiff_t row_begin, ptrdiff_t row_end)
{
    const int height = grids->height;

    for (ptrdiff_t k = row_begin / height; k * height < row_end; ++k) {
        const ptrdiff_t top = k * height;
        const int begin = row_begin > top ? (int)(row_begin - top) : 0;
        const int end = row_end - top < height ? (int)(row_end - top) : height;
        centred_sphere_literal_rows(
            images + k * image_stride, stride, &grids[k], &scenes[k], begin, end);
    }
}
