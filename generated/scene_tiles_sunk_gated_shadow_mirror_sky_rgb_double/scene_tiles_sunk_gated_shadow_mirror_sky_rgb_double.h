/* scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double: the image of a scene of spheres on a plane
 * Accuracy "double" (symrender_cg 0.1.0)
 * Generated from the formula; do not edit. Regenerate with:
 *     python -m symrender_cg build mirrors --accuracy double
 */
#ifndef SCENE_TILES_SUNK_GATED_SHADOW_MIRROR_SKY_RGB_DOUBLE_H
#define SCENE_TILES_SUNK_GATED_SHADOW_MIRROR_SKY_RGB_DOUBLE_H

#include "grid.h"
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The scene in the camera's frame: eye at (0, 0, eye), image plane z = 0, view along -z. Lengths in scene units.
 * Colours have three channels, red first. What belongs to entry i of an array is [begin[i], begin[i + 1]) of a list. */
typedef struct {
    double eye;                                      /* distance of the eye from the image plane */
    int spheres;                                     /* how many spheres the arrays hold, */
    int visible;                                     /* and how many the eye may see: the first, front to back */
    int receivers;                                   /* spheres, then the plane's materials: what may be lit */
    const double *center_x, *center_y, *center_z;    /* [receivers] centre of a sphere; for the plane the eye */
    const double *radius;                            /* [receivers] radius; for the plane the eye's height above it */
    const double *radius_low;                        /* [receivers] what rounding left of that height; else 0 */
    const int *crosses_plane;                        /* [spheres] the sphere may lie on both sides of the plane */
    const double *ambient;                           /* [receivers][3] ambient coefficient */
    const double *diffuse;                           /* [receivers][3] diffuse coefficient */
    const double *specular;                          /* [receivers][3] specular coefficient */
    const double *shininess;                         /* [receivers] exponent of the specular term */
    const double *light_x, *light_y, *light_z;       /* [lights] place; for a light in parallel unit vector to it */
    const double *nearness;                          /* [lights] 1 for a point light, 0 for one in parallel */
    const double *light_intensity;                   /* [lights][3] */
    const int *lamps_begin;                          /* [receivers + 1] lists of lamps, lights of a receiver */
    const int *lamp_light;                           /* which light, */
    const int *lamp_terms;                           /* terms: 1 diffuse, 2 specular, 4 that where n.l > 0 alone */
    const int *blockers_begin, *blockers;            /* [lamps + 1] lists of spheres that may be before it */
    const double *reflect;                           /* [receivers] how much of the mirrored ray's intensity is added */
    int bounces;                                     /* how often a ray is mirrored at most */
    const int *mirrors_begin, *mirrors;              /* [receivers + 1] lists of spheres seen in it */
    const int *mirror_plane;                         /* [receivers] the plane may be seen in it */
    int plane_seen;                                  /* the eye may see the plane, not only mirrors */
    double plane_x, plane_y, plane_z;                /* unit normal of the plane, on the eye's side */
    double plane_x_low, plane_y_low, plane_z_low;    /* and what rounding left of it */
    double across_x, across_y, across_z, across_0;   /* a tile's number across: floor(across.p + across_0) */
    double along_x, along_y, along_z, along_0;       /* and along */
    const double *background;                        /* [3] intensity where no ray hits, straight down */
    const double *background_top;                    /* [3] straight up */
    double up_x, up_y, up_z;                         /* unit vector upwards */
} scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_scene;

/* What is written beside the image, where the pointer is not null: arrays of height x width pixels, row 0 at the top,
 * which hold zeros before: what a pixel does not have is not written. */
typedef struct {
    double *depth;    /* distance from the eye, in scene units; INFINITY where nothing is hit */
    double *normal;   /* [3] outward, in the camera's frame */
    int *index;       /* which sphere of the arrays, or `spheres` and above for the plane; -1 where nothing is hit */
    double *background, *ambient, *reflected;   /* [3] terms of the image, which is their sum */
    double *diffuse, *specular;                 /* [3] for each light in turn, height x width x 3 apart */
} scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_layers;

/* What a scene needs to be computed once, for an image or for points; it refers to the scene, which must outlive it. */
typedef struct scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_frame
    scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_frame;

/* Null where there is no memory. grid->white is the intensity above which white is written. */
scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_frame *scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_prepare(
    const scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_scene *scene, const symrender_grid *grid);
void scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_release(
    scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_frame *frame);

/* Writes rows [row_begin, row_end) of the image; row j starts at image + j * stride. Threads may share a frame and an
 * image. `layers` may be null.
 *
 * Lists in `unsettled` the pixels, row * width + column, where rounding may have decided what is seen or lit, or done
 * more than the level promises; it has room for every pixel of these rows, or is null. What is written there is the
 * kernel's best guess. Returns how many it listed, or -1 where there is no memory. */
ptrdiff_t scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_rows(double *image, ptrdiff_t stride,
    const scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_frame *frame,
    const scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_layers *layers, int row_begin, int row_end, ptrdiff_t *unsettled);

/* Writes the intensities at points (x[i], y[i]) of the image plane. `unsettled`, and what is returned, as for
 * rows, by the numbers of points. */
ptrdiff_t scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_points(double *values, const double *x, const double *y,
    ptrdiff_t count, const scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_frame *frame, ptrdiff_t *unsettled);

/* Many scenes of one structure, each with its grid: all their frames, or -1 and none where there is no memory. */
int scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_prepare_many(scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_frame **frames,
    const scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_scene *scenes, ptrdiff_t count, const symrender_grid *grids);
void scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_release_many(
    scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_frame **frames, ptrdiff_t count);

/* Writes rows [row_begin, row_end) of many images of one size, counted through: row j of image k is row k * height + j
 * and starts at images[k] + j * stride. `unsettled`, and what is returned, as for rows, with the pixels counted
 * through: (k * height + row) * width + column. */
ptrdiff_t scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_batch(double *const *images, ptrdiff_t stride,
    scene_tiles_sunk_gated_shadow_mirror_sky_rgb_double_frame *const *frames, ptrdiff_t row_begin, ptrdiff_t row_end,
    ptrdiff_t *unsettled);

#ifdef __cplusplus
}
#endif

#endif
