/* centred_sphere_fast: the image of one Phong-shaded sphere
 * Accuracy "fast" (symrender_cg 0.1.0)
 * Generated from the formula; do not edit. Regenerate with:
 *     python -m symrender_cg build chapter1 --accuracy fast
 */
#ifndef CENTRED_SPHERE_FAST_H
#define CENTRED_SPHERE_FAST_H

#include "grid.h"
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The scene in the camera's frame: eye at (0, 0, eye), image plane z = 0, view along -z. Lengths in scene units.
 * 0 < radius, and the eye lies outside the sphere. */
typedef struct {
    double eye;             /* distance of the eye from the image plane */
    double radius;          /* radius of the sphere */
    double light_x;         /* position of the point light */
    double light_y;         /* position of the point light */
    double light_z;         /* position of the point light */
    double light_intensity; /* intensity of the point light */
    double k_ambient;       /* ambient coefficient */
    double k_diffuse;       /* diffuse coefficient */
    double k_specular;      /* specular coefficient */
    double shininess;       /* exponent of the specular term */
    double background;      /* intensity where no ray hits */
} centred_sphere_fast_scene;

/* Writes rows [row_begin, row_end) of the image; row j starts at image + j * stride. Threads may share an image. */
void centred_sphere_fast_rows(float *image, ptrdiff_t stride, const symrender_grid *grid,
    const centred_sphere_fast_scene *scene, int row_begin, int row_end);

/* The same for rows j and height - 1 - j, row_begin <= j < row_end <= (height + 1) / 2: those at y and -y share what
 * they have in common, as they do in centred_sphere_fast_rows where both are asked for. */
void centred_sphere_fast_row_pairs(float *image, ptrdiff_t stride, const symrender_grid *grid,
    const centred_sphere_fast_scene *scene, int row_begin, int row_end);

/* Writes the intensities at points (x[i], y[i]) of the image plane; above white they are written as white. */
void centred_sphere_fast_points(float *values, const double *x, const double *y,
    ptrdiff_t count, double white, const centred_sphere_fast_scene *scene);

/* Writes rows [row_begin, row_end) of many images of one size, counted through: row j of image k is row k * height + j
 * and starts at images + k * image_stride + j * stride. Each image has its own scene and grid. */
void centred_sphere_fast_batch(float *images, ptrdiff_t image_stride, ptrdiff_t stride,
    const symrender_grid *grids, const centred_sphere_fast_scene *scenes,
    ptrdiff_t row_begin, ptrdiff_t row_end);

#ifdef __cplusplus
}
#endif

#endif
