/* centred_sphere_double_baked: the image of one Phong-shaded sphere
 * Accuracy "double" (symrender_cg 0.1.0)
 * Generated from the formula; do not edit. Regenerate with:
 *     python -m symrender_cg build chapter1 --accuracy double --bake
 */
#ifndef CENTRED_SPHERE_DOUBLE_BAKED_H
#define CENTRED_SPHERE_DOUBLE_BAKED_H

#include "grid.h"
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Writes rows [row_begin, row_end) of the image; row j starts at image + j * stride. Threads may share an image. */
void centred_sphere_double_baked_rows(double *image, ptrdiff_t stride, const symrender_grid *grid,
    int row_begin, int row_end);

/* The same for rows j and height - 1 - j, row_begin <= j < row_end <= (height + 1) / 2: those at y and -y share what
 * they have in common, as they do in centred_sphere_double_baked_rows where both are asked for. */
void centred_sphere_double_baked_row_pairs(double *image, ptrdiff_t stride, const symrender_grid *grid,
    int row_begin, int row_end);

/* Writes the intensities at points (x[i], y[i]) of the image plane; above white they are written as white. */
void centred_sphere_double_baked_points(double *values, const double *x, const double *y,
    ptrdiff_t count, double white);

#ifdef __cplusplus
}
#endif

#endif
