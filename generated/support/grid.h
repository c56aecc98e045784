/* The grid of pixels that a kernel's rows are written to.
 *
 * Pixels are square. The centre of pixel (column i, row j) lies at
 *     x = (i + 1/2 - width / 2) pixel,     y = (height / 2 - j - 1/2) pixel
 * on the image plane, row 0 at the top; each is one rounding, so the grid is exactly symmetric about both axes.
 */
#ifndef SYMRENDER_GRID_H
#define SYMRENDER_GRID_H

#include <math.h>
#include <stddef.h>

typedef struct {
    int width, height;
    double pixel;   /* side of a pixel, in scene units                                                */
    double white;   /* intensities above it are written as it: 1 for a picture, INFINITY for the field */
} symrender_grid;

/* Some pixels of a grid: columns [column_begin, column_end) of rows [row_begin, row_end), none beyond its edges. */
typedef struct {
    symrender_grid grid;
    int column_begin, column_end, row_begin, row_end;
} symrender_box;

#endif
