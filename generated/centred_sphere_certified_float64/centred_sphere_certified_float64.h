/* centred_sphere_certified_float64: the image of one Phong-shaded sphere
 * Accuracy "certified_float64" (symrender_cg 0.1.0)
 * Generated from the formula; do not edit. Regenerate with:
 *     python -m symrender_cg build chapter1 --accuracy certified
 */
#ifndef CENTRED_SPHERE_CERTIFIED_FLOAT64_H
#define CENTRED_SPHERE_CERTIFIED_FLOAT64_H

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
} centred_sphere_certified_float64_scene;

/* Writes rows [row_begin, row_end) of the image; row j starts at image + j * stride. Threads may share an image.
 * Every pixel is what the accuracy promises, but for those whose numbers, row times width plus column, are written to
 * `unsettled`, which has room for all of these rows' pixels. Returns how many those are. */
ptrdiff_t centred_sphere_certified_float64_rows(
    double *image, ptrdiff_t stride, const symrender_grid *grid,
    const centred_sphere_certified_float64_scene *scene,
    int row_begin, int row_end, ptrdiff_t *unsettled);

/* The same for rows j and height - 1 - j, row_begin <= j < row_end <= (height + 1) / 2: those at y and -y share what
 * they have in common, as they do in centred_sphere_certified_float64_rows where both are asked for. */
ptrdiff_t centred_sphere_certified_float64_row_pairs(
    double *image, ptrdiff_t stride, const symrender_grid *grid,
    const centred_sphere_certified_float64_scene *scene,
    int row_begin, int row_end, ptrdiff_t *unsettled);

/* Writes the pixels of a box alone that lie in rows [row_begin, row_end); the others of the image stay as they are.
 * `unsettled`, and what is returned, as for rows, with room for the pixels of the box in these rows. */
ptrdiff_t centred_sphere_certified_float64_box(
    double *image, ptrdiff_t stride, const symrender_box *box,
    const centred_sphere_certified_float64_scene *scene,
    int row_begin, int row_end, ptrdiff_t *unsettled);

/* As for rows, at points (x[i], y[i]) of the image plane; above white they are written as white. */
ptrdiff_t centred_sphere_certified_float64_points(
    double *values, const double *x, const double *y, ptrdiff_t count, double white,
    const centred_sphere_certified_float64_scene *scene, ptrdiff_t *unsettled);

/* The kernel's own values of points, hi + lo, and bounds of their errors: INFINITY where nothing is known. */
void centred_sphere_certified_float64_enclose(
    double *hi, double *lo, double *error, const double *x, const double *y, ptrdiff_t count,
    const centred_sphere_certified_float64_scene *scene);

/* How far the kernel's own value of any pixel that it settles can be from the true one. */
double centred_sphere_certified_float64_bound(
    const symrender_grid *grid, const centred_sphere_certified_float64_scene *scene);

/* Writes rows [row_begin, row_end) of many images of one size, counted through: row j of image k is row k * height + j
 * and starts at images + k * image_stride + j * stride. Each image has its own scene and grid. `unsettled`, and what is
 * returned, as for rows, with the pixels counted through: (k * height + row) * width + column. */
ptrdiff_t centred_sphere_certified_float64_batch(
    double *images, ptrdiff_t image_stride, ptrdiff_t stride,
    const symrender_grid *grids, const centred_sphere_certified_float64_scene *scenes,
    ptrdiff_t row_begin, ptrdiff_t row_end, ptrdiff_t *unsettled);

/* The same for a box of each image. */
ptrdiff_t centred_sphere_certified_float64_boxes(
    double *images, ptrdiff_t image_stride, ptrdiff_t stride,
    const symrender_box *boxes, const centred_sphere_certified_float64_scene *scenes,
    ptrdiff_t row_begin, ptrdiff_t row_end, ptrdiff_t *unsettled);

#ifdef __cplusplus
}
#endif

#endif
