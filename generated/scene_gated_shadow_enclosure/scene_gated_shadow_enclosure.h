/* scene_gated_shadow_enclosure: enclosures of the image of a scene of spheres
 * Generated from the formula by symrender_cg 0.1.0; do not edit. Regenerate with:
 *     python -m symrender_cg build shadow --accuracy certified
 */
#ifndef SCENE_GATED_SHADOW_ENCLOSURE_H
#define SCENE_GATED_SHADOW_ENCLOSURE_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The scene in the camera's frame: eye at (0, 0, eye), image plane z = 0, view along -z. Lengths in scene units.
 * Colours have one channel. What belongs to entry i of an array is [begin[i], begin[i + 1]) of a list.
 * What the doubles of a scene do not give exactly, such as a unit vector, is three numbers: hi, lo, error. */
typedef struct {
    double eye;                                     /* distance of the eye from the image plane */
    int spheres;                                    /* how many spheres the arrays hold, */
    int visible;                                    /* and how many the eye may see: the first, front to back */
    int receivers;                                  /* spheres, then the plane's materials: what may be lit */
    const double *center_x, *center_y, *center_z;   /* [receivers] centre of a sphere; for the plane the eye */
    const double *radius;                           /* [receivers] radius; for the plane the eye's height above it */
    const double *ambient;                          /* [receivers][1] ambient coefficient */
    const double *diffuse;                          /* [receivers][1] diffuse coefficient */
    const double *specular;                         /* [receivers][1] specular coefficient */
    const double *shininess;                        /* [receivers] exponent of the specular term */
    const double *light_x, *light_y, *light_z;      /* place; for a light in parallel direction to it, of any length */
    const double *nearness;                         /* [lights] 1 for a point light, 0 for one in parallel */
    const double *light_intensity;                  /* [lights][1] */
    const int *lamps_begin;                         /* [receivers + 1] lists of lamps, lights of a receiver */
    const int *lamp_light;                          /* which light, */
    const int *lamp_terms;                          /* terms: 1 diffuse, 2 specular, 4 that where n.l > 0 alone */
    const int *blockers_begin, *blockers;           /* [lamps + 1] lists of spheres that may be before it */
    const double *background;                       /* [1] intensity where no ray hits */
    const double *nearer;                           /* [lights] 1 for a light that was brought nearer, else 0 */
} scene_gated_shadow_enclosure_scene;

/* Encloses the intensity at points (x[i], y[i]) of the image plane:
 *     |true intensity - (hi + lo)| <= error
 * for each of the [count][1] entries; error is infinite, and hi and lo are 0, where nothing is known.
 * Returns 0, or -1 where there is no memory. */
int scene_gated_shadow_enclosure_points(double *hi, double *lo, double *error,
    const double *x, const double *y, ptrdiff_t count, const scene_gated_shadow_enclosure_scene *scene);

/* Settles the intensities at those points: writes values [count][1] by a rule, at most `white`, and which points have
 * all of theirs settled. Returns the largest error of those, or -1 where there is no memory.
 *     rule  0: within 4 ulp   1: the nearest float64   2: the nearest float32   3: the grey level of 0 to 255 */
double scene_gated_shadow_enclosure_settle(double *values, unsigned char *is_settled,
    const double *x, const double *y, ptrdiff_t count, int rule, double white, const scene_gated_shadow_enclosure_scene *scene);

/* The same for many scenes of one structure: points begin[k] <= i < begin[k + 1] are those of scene k, k < count. */
double scene_gated_shadow_enclosure_batch(double *values, unsigned char *is_settled, const double *x, const double *y,
    const ptrdiff_t *begin, int rule, double white, const scene_gated_shadow_enclosure_scene *scenes, ptrdiff_t count);

#ifdef __cplusplus
}
#endif

#endif
