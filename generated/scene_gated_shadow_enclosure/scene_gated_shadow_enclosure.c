/* scene_gated_shadow_enclosure: enclosures of the image of a scene, every number an argument
 * Made by symrender_cg 0.1.0
 * Generated from the formula; do not edit. Regenerate with:
 *     python -m symrender_cg build shadow --accuracy certified
 *
 * promise  |true intensity - (hi + lo)| <= error for every point and channel, proved: every number is a ball of ball.h,
 *          every operation adds its own rounding, and where a decision is in doubt both outcomes are enclosed, or error
 *          is infinite. What a ray of the eye hits is exact.
 * in       sphere off the axis
 *          diffuse term
 *          specular term
 *          gated specular
 *          lights on surfaces
 *          shadows of spheres
 *          clipping at 1
 * out      sphere at the plane of the eye: 2 visible spheres wholly before the eye
 *          shadow of the sphere on itself: a sphere is convex: where n.l > 0 the way to the light leaves it; where
 *          not, diffuse is 0
 *          spheres behind the eye: no sphere of 2 wholly behind the plane of the eye
 *          spheres outside the window: no window: any point of the image plane may be asked for
 *          hidden spheres: no sphere of 2 wholly hidden
 *          order along the ray: 1 pair of visible spheres disjoint: the smaller power of the eye is in front on
 *          every ray
 *          the plane: the scene has no plane
 *          tiles of the plane: the scene has no plane
 *          shadow of the plane: the scene has no plane
 *          reflections: no surface that is seen mirrors anything
 *          reflections of reflections: 0 of 4 bounces: no longer chain of mirrors that may see one another
 *          lights that fade with distance: every light that lights anything is as strong at every distance
 *          lights from a direction: 0 of 1 light from a direction
 *          background in two colours: the background is 0.0 in every direction
 *          colour: every colour of the scene is grey: one channel
 *          numbers above are those of the scene it was written for; any scene with the same effects may call it
 * ops      on balls, a point: lamp 0, reach 11, matte 13, glossy 47, shadow 24, near 54
 */
#include "scene_gated_shadow_enclosure.h"

#include "inline.h"
#include "units.h"
#include "double_double.h"
#include "ball.h"
#include "settle.h"
#include "ball_power.h"
#include "exact_sign.h"
#include <math.h>
#include <stdlib.h>

enum {
    CHANNELS = 1,
    NOTHING = -1,    /* the background */
    IN_DOUBT = -2    /* nobody knows which surface: the intensity may be anything */
};

typedef scene_gated_shadow_enclosure_scene scene_type;

/* A ray of the eye, D = (x, y, -eye), in the unit of length of the tables. */
typedef struct {
    double x, y;
    double plane_x, plane_y;   /* the same in scene units */
    double length, size;       /* |D|, |x| + |y| + eye, in plain floating point */
} ray;

/* A point that is seen. */
typedef struct {
    int receiver;
    ball n_x, n_y, n_z;   /* outward normal */
    ball mirror_x, mirror_y, mirror_z, inv_d2;   /* the ray mirrored there; one over its length squared */
} site;

/* Centre and radius of a receiver; for the plane the eye and its height above it. */
typedef struct {
    ball x, y, z, radius;
} place;

/* What does not change within a sphere. */
typedef struct {
    double focal;
    ball focal2, depth, offset_y, cross_x_sphere, offset_x, cross_y_sphere, before_eye_sphere, power;
    double m_x, m_y, m_z, m_size;   /* C - E in radii, and |m_x| + |m_y| + |m_z|, in plain floating point */
} near_sphere;

enum { DIFFUSE = 1, SPECULAR = 2, GATED = 4 };   /* terms of a lamp */

/* A light as one receiver has it. */
typedef struct {
    ball lamp_x, lamp_y, lamp_z;   /* its place from the receiver's origin, in its unit; or a direction */
    double nearness;               /* 1; 0 for a light in parallel */
    int terms;
    ball diffuse_gain[CHANNELS];
    ball specular_gain[CHANNELS];
} lamp;

/* A sphere that may stand before a lamp. */
typedef struct {
    ball gap_x, gap_y, gap_z, ratio2;   /* from the receiver's origin, in its unit; its radius, squared */
    double error;                       /* of the gap, all three */
    ball_truth is_around;               /* the lamp is within it, or nowhere: its light comes from a direction */
} blocker;

/* The scene in balls. Lengths in units of 2^-exponent, in which the eye's distance is in [1, 2). */
typedef struct {
    const scene_type *scene;
    int exponent;
    double eye, unit;   /* unit = 2^exponent */
    place *places;      /* [receivers] */
    near_sphere *nears;   /* [visible] */
    lamp *lamps;
    blocker *blockers;   /* of each lamp: blockers_begin */
} tables;

/* ---- the scene in balls ---- */

static ball length_of(double length, const tables *h)
{
    return ball_ldexp(length, h->exponent);
}

static near_sphere near_of(const place *c, double eye)
{
    /* ray and sphere [10 call] */
    const double focal = eye;   /* rays D = (x, y, -f): f is e, in the unit of the image plane */
    const ball focal2 = ball_product(focal, focal);
    const ball distance = ball_add_double(ball_neg(c->z), eye);   /* of the eye from the plane of the centre */
    const ball depth = ball_div(distance, c->radius);   /* kappa: the same in radii */
    const ball offset_y = ball_div(c->y, c->radius);
    /* what is the same for a sphere in cross_x */
    const ball cross_x_sphere = ball_neg(ball_mul_double(offset_y, focal));
    const ball offset_x = ball_div(c->x, c->radius);
    const ball cross_y_sphere = ball_mul_double(offset_x, focal);   /* what is the same for a sphere in cross_y */
    const ball before_eye_sphere = ball_mul_double(depth, focal);   /* what is the same for a sphere in before_eye */

    /* distance [6 call] */
    /* |m|^2 - 1: the power of the eye in radii, squared */
    const ball power = ball_add_double(ball_add(ball_add(ball_square(depth), ball_square(offset_y)),
        ball_square(offset_x)), -1.0);

    const near_sphere sphere = {
        .focal = focal,
        .focal2 = focal2,
        .depth = depth,
        .offset_y = offset_y,
        .cross_x_sphere = cross_x_sphere,
        .offset_x = offset_x,
        .cross_y_sphere = cross_y_sphere,
        .before_eye_sphere = before_eye_sphere,
        .power = power,
        .m_x = offset_x.hi,
        .m_y = offset_y.hi,
        .m_z = -depth.hi,
        .m_size = fabs(offset_x.hi) + fabs(offset_y.hi) + fabs(depth.hi),
    };
    return sphere;
}

/* Of a light that was brought from L to s L, 0 < s < 1, w is known up to a multiple: s (L - P) = (s L - P) + (1 - s) P,
 * and in radii P is at most |C| / R + 1. */
static ball brought(ball w, ball centre, ball radius, double is_nearer)
{
    const ball size = ball_add_double(ball_div(centre, radius), centre.hi < 0.0 ? -1.0 : 1.0);
    w.error += is_nearer > 0.0 ? (fabs(size.hi) + size.error) * (1.0 + 0x1p-20) : 0.0;
    return w;
}

static lamp lamp_of(const tables *h, int k, int light, int terms)
{
    const scene_type *scene = h->scene;
    const place *c = &h->places[k];
    lamp l = {.nearness = scene->nearness[light], .terms = terms};
    if (l.nearness > 0.0) {
        const ball light_x = length_of(scene->light_x[light], h);
        const ball light_y = length_of(scene->light_y[light], h);
        const ball light_z = length_of(scene->light_z[light], h);
        /* light [6 call] */
        const ball from_center_x = ball_sub(light_x, c->x);   /* L - C */
        const ball lamp_x = ball_div(from_center_x, c->radius);   /* (L - C) / R */
        const ball from_center_y = ball_sub(light_y, c->y);
        const ball lamp_y = ball_div(from_center_y, c->radius);
        const ball from_center_z = ball_sub(light_z, c->z);
        const ball lamp_z = ball_div(from_center_z, c->radius);

        l.lamp_x = brought(lamp_x, c->x, c->radius, scene->nearer[light]);
        l.lamp_y = brought(lamp_y, c->y, c->radius, scene->nearer[light]);
        l.lamp_z = brought(lamp_z, c->z, c->radius, scene->nearer[light]);
    } else {
        /* of a direction, w is any multiple */
        const double x = scene->light_x[light], y = scene->light_y[light], z = scene->light_z[light];
        const int shorter = unit_exponent(fmax(fmax(fabs(x), fabs(y)), fabs(z)));
        l.lamp_x = ball_ldexp(x, shorter);
        l.lamp_y = ball_ldexp(y, shorter);
        l.lamp_z = ball_ldexp(z, shorter);
    }
    for (int i = 0; i < CHANNELS; ++i) {
        const double intensity = scene->light_intensity[CHANNELS * light + i];
        l.diffuse_gain[i] = ball_product(intensity, scene->diffuse[CHANNELS * k + i]);
        l.specular_gain[i] = ball_product(intensity, scene->specular[CHANNELS * k + i]);
    }
    return l;
}

/* Sphere b as it may stand before lamp l of receiver k. */
static blocker blocker_of(const tables *h, const lamp *l, int k, int b)
{
    const place *c = &h->places[k], *of = &h->places[b];
    blocker q = {
        .gap_x = ball_div(ball_sub(of->x, c->x), c->radius),
        .gap_y = ball_div(ball_sub(of->y, c->y), c->radius),
        .gap_z = ball_div(ball_sub(of->z, c->z), c->radius),
        .ratio2 = ball_square(ball_div(of->radius, c->radius)),
        .is_around = BALL_YES,
    };
    if (l->nearness > 0.0) {
        const ball past_x = ball_sub(l->lamp_x, q.gap_x), past_y = ball_sub(l->lamp_y, q.gap_y);
        const ball past_z = ball_sub(l->lamp_z, q.gap_z);
        const ball past2 = ball_add(ball_add(ball_square(past_x), ball_square(past_y)), ball_square(past_z));
        q.is_around = ball_less(past2, q.ratio2);
    }
    q.error = q.gap_x.error + q.gap_y.error + q.gap_z.error;
    return q;
}

static void drop(tables *h)
{
    free(h->places);
    free(h->nears);
    free(h->lamps);
    free(h->blockers);
    (void)h;
}

static void *array(int count, size_t size)
{
    return malloc(count > 0 ? (size_t)count * size : size);
}

/* Fills the tables. Returns 0 where there is no memory. */
static int take(tables *h, const scene_type *scene)
{
    const tables none = {0};
    *h = none;
    h->scene = scene;
    h->exponent = unit_exponent(scene->eye);
    h->eye = ldexp(scene->eye, h->exponent);
    h->unit = ldexp(1.0, h->exponent);
    h->places = array(scene->receivers, sizeof *h->places);
    h->nears = array(scene->visible, sizeof *h->nears);
    h->lamps = array(scene->lamps_begin[scene->receivers], sizeof *h->lamps);
    h->blockers = array(scene->blockers_begin[scene->lamps_begin[scene->receivers]], sizeof *h->blockers);
    if (!h->places || !h->nears || !h->lamps || !h->blockers)
        return 0;
    for (int k = 0; k < scene->receivers; ++k) {
        h->places[k].x = length_of(scene->center_x[k], h);
        h->places[k].y = length_of(scene->center_y[k], h);
        h->places[k].z = length_of(scene->center_z[k], h);
        h->places[k].radius = length_of(scene->radius[k], h);
    }
    for (int k = 0; k < scene->visible; ++k)
        h->nears[k] = near_of(&h->places[k], h->eye);
    for (int k = 0; k < scene->receivers; ++k)
        for (int i = scene->lamps_begin[k]; i < scene->lamps_begin[k + 1]; ++i) {
            h->lamps[i] = lamp_of(h, k, scene->lamp_light[i], scene->lamp_terms[i]);
            for (int q = scene->blockers_begin[i]; q < scene->blockers_begin[i + 1]; ++q)
                h->blockers[q] = blocker_of(h, &h->lamps[i], k, scene->blockers[q]);
        }
    return 1;
}

/* ---- spheres and a ray of the eye ---- */

/* Does the ray through (x, y) hit sphere k? Settled without rounding, as the sign of a polynomial in the inputs. */
static int near_hits_exactly(double x, double y, const scene_type *scene, int k)
{
    exact_sum sum;
    exact_sum_clear(&sum);   /* disc */
    exact_sum_add_product(&sum, -1, scene->center_x[k], scene->center_x[k], scene->eye, scene->eye);
    exact_sum_add_product(&sum, -1, scene->center_x[k], scene->center_x[k], y, y);
    exact_sum_add_product(&sum,  2, scene->center_x[k], scene->center_y[k], x, y);
    exact_sum_add_product(&sum, -2, scene->center_x[k], scene->center_z[k], scene->eye, x);
    exact_sum_add_product(&sum,  2, scene->center_x[k], scene->eye, scene->eye, x);
    exact_sum_add_product(&sum, -1, scene->center_y[k], scene->center_y[k], scene->eye, scene->eye);
    exact_sum_add_product(&sum, -1, scene->center_y[k], scene->center_y[k], x, x);
    exact_sum_add_product(&sum, -2, scene->center_y[k], scene->center_z[k], scene->eye, y);
    exact_sum_add_product(&sum,  2, scene->center_y[k], scene->eye, scene->eye, y);
    exact_sum_add_product(&sum, -1, scene->center_z[k], scene->center_z[k], x, x);
    exact_sum_add_product(&sum, -1, scene->center_z[k], scene->center_z[k], y, y);
    exact_sum_add_product(&sum,  2, scene->center_z[k], scene->eye, x, x);
    exact_sum_add_product(&sum,  2, scene->center_z[k], scene->eye, y, y);
    exact_sum_add_product(&sum,  1, scene->eye, scene->eye, scene->radius[k], scene->radius[k]);
    exact_sum_add_product(&sum, -1, scene->eye, scene->eye, x, x);
    exact_sum_add_product(&sum, -1, scene->eye, scene->eye, y, y);
    exact_sum_add_product(&sum,  1, scene->radius[k], scene->radius[k], x, x);
    exact_sum_add_product(&sum,  1, scene->radius[k], scene->radius[k], y, y);
    if (!(exact_sum_sign(&sum) >= 0))
        return 0;
    exact_sum_clear(&sum);   /* m_dot_d */
    exact_sum_add_product(&sum,  1, scene->center_x[k], x, 1.0, 1.0);
    exact_sum_add_product(&sum,  1, scene->center_y[k], y, 1.0, 1.0);
    exact_sum_add_product(&sum, -1, scene->center_z[k], scene->eye, 1.0, 1.0);
    exact_sum_add_product(&sum,  1, scene->eye, scene->eye, 1.0, 1.0);
    return exact_sum_sign(&sum) > 0;
}

/* Hit where |m x D| <= |D| and m.D > 0, as far as plain floating point can tell. The coordinates of m are 2^-52 of
 * themselves off at most, each product and difference of the cross product has one rounding more, so that all of it is
 * off by less than 2^-50 |m|_1 |D|_1; so is m.D. `room` is four times that, and the factors are for what follows. */
static ball_truth near_sight(const ray *r, double eye, const near_sphere *sphere)
{
    const double room = 0x1p-48 * sphere->m_size * r->size;
    const double most = r->length * (1.0 + 0x1p-40) + room, least = r->length * (1.0 - 0x1p-40) - room;
    const double cross_x = sphere->m_z * r->y + sphere->m_y * eye;
    const double cross_y = sphere->m_x * eye + sphere->m_z * r->x;
    const double cross_z = sphere->m_x * r->y - sphere->m_y * r->x;
    const double cross2 = cross_x * cross_x + cross_y * cross_y + cross_z * cross_z;
    const double ahead = sphere->m_x * r->x + sphere->m_y * r->y - sphere->m_z * eye;
    if (cross2 > most * most * (1.0 + 0x1p-40) || ahead < -room)
        return BALL_NO;
    return cross2 < least * least * (1.0 - 0x1p-40) && least > 0.0 && ahead > room ? BALL_YES : BALL_UNKNOWN;
}

static int near_hits(const ray *r, const tables *h, int k)
{
    const near_sphere *sphere = &h->nears[k];
    const ball_truth plain = near_sight(r, h->eye, sphere);
    if (plain != BALL_UNKNOWN)
        return plain == BALL_YES;
    /* ray and sphere [21 call] */
    /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const ball s = ball_add(ball_product(r->x, r->x), ball_product(r->y, r->y));
    const ball d_dot_d = ball_add(s, sphere->focal2);
    const ball cross_x = ball_add(ball_mul_double(sphere->depth, r->y), sphere->cross_x_sphere);
    const ball cross_y = ball_sub(sphere->cross_y_sphere, ball_mul_double(sphere->depth, r->x));   /* m x D in radii */
    const ball cross_z = ball_sub(ball_mul_double(sphere->offset_x, r->y), ball_mul_double(sphere->offset_y, r->x));
    /* disc / R^2 = |D|^2 - |m x D|^2 / R^2: a hit where >= 0 */
    const ball facing2 = ball_sub(ball_sub(ball_sub(d_dot_d, ball_square(cross_x)), ball_square(cross_y)),
        ball_square(cross_z));
    /* m.D: positive before the eye */
    const ball before_eye = ball_add(ball_add(ball_mul_double(sphere->offset_y, r->y),
        ball_mul_double(sphere->offset_x, r->x)), sphere->before_eye_sphere);

    const ball_truth faces = ball_positive(facing2), is_before = ball_positive(before_eye);
    if (faces == BALL_UNKNOWN || (faces == BALL_YES && is_before == BALL_UNKNOWN))
        return near_hits_exactly(r->plane_x, r->plane_y, h->scene, k);
    return faces == BALL_YES && is_before == BALL_YES;
}

/* Where the ray hits sphere k. */
SYMRENDER_INLINE void near_surface(site *at, const ray *r, const near_sphere *sphere)
{
    /* ray and sphere [18 call] */
    /* s = x^2 + y^2, A = |D|^2 = s + f^2 */
    const ball s = ball_add(ball_product(r->x, r->x), ball_product(r->y, r->y));
    const ball d_dot_d = ball_add(s, sphere->focal2);
    const ball cross_x = ball_add(ball_mul_double(sphere->depth, r->y), sphere->cross_x_sphere);
    const ball cross_y = ball_sub(sphere->cross_y_sphere, ball_mul_double(sphere->depth, r->x));   /* m x D in radii */
    const ball cross_z = ball_sub(ball_mul_double(sphere->offset_x, r->y), ball_mul_double(sphere->offset_y, r->x));
    /* disc / R^2 = |D|^2 - |m x D|^2 / R^2: a hit where >= 0 */
    const ball facing2 = ball_sub(ball_sub(ball_sub(d_dot_d, ball_square(cross_x)), ball_square(cross_y)),
        ball_square(cross_z));
    const ball facing = ball_sqrt(facing2);   /* -n.D, how far the surface faces the ray: root / R */

    /* normal [21 call] */
    const ball inv_d2 = ball_div(ball_from(1.0), d_dot_d);
    /* the foot point (D x (D x m)) / |D|^2 lies on the ray, nearest to the centre; n is it less facing D / |D|^2 */
    const ball foot_x = ball_sub(ball_neg(ball_mul_double(cross_y, sphere->focal)), ball_mul_double(cross_z, r->y));
    const ball n_x = ball_mul(inv_d2, ball_sub(foot_x, ball_mul_double(facing, r->x)));
    const ball foot_y = ball_add(ball_mul_double(cross_x, sphere->focal), ball_mul_double(cross_z, r->x));
    const ball n_y = ball_mul(inv_d2, ball_sub(foot_y, ball_mul_double(facing, r->y)));
    const ball foot_z = ball_sub(ball_mul_double(cross_x, r->y), ball_mul_double(cross_y, r->x));
    const ball n_z = ball_mul(inv_d2, ball_add(ball_mul_double(facing, sphere->focal), foot_z));

    /* specular [7 call] */
    const ball bounce = ball_mul_double(facing, 2.0);
    /* the primary ray mirrored at the surface, D + 2 facing n, as long as D */
    const ball mirror_x = ball_add_double(ball_mul(n_x, bounce), r->x);
    const ball mirror_y = ball_add_double(ball_mul(n_y, bounce), r->y);
    const ball mirror_z = ball_add_double(ball_mul(n_z, bounce), -sphere->focal);

    at->n_x = n_x;
    at->n_y = n_y;
    at->n_z = n_z;
    at->mirror_x = mirror_x;
    at->mirror_y = mirror_y;
    at->mirror_z = mirror_z;
    at->inv_d2 = inv_d2;
}

/* The sphere that a ray of the eye meets first. Disjoint spheres are tried front to back. */
static int first_sphere(const ray *r, const tables *h)
{
    const scene_type *scene = h->scene;
    int owner = NOTHING;
    for (int k = 0; k < scene->visible; ++k) {
        if (!near_hits(r, h, k))
            continue;
        owner = k;
        break;
    }
    return owner;
}

/* What a ray of the eye sees: fills the site. */
static int first_hit(site *at, const ray *r, const tables *h)
{
    at->receiver = first_sphere(r, h);
    if (at->receiver >= 0)
        near_surface(at, r, &h->nears[at->receiver]);
    return at->receiver;
}

/* ---- light ---- */

/* Does a sphere surely not stand before the lamp: |b x w| > ratio |w|, or b.w < 0, or b.w > |w|^2 where the lamp is
 * outside of it? In plain floating point, where point and w are known to that: each term of b = gap - p is off by less
 * than 2^-50 of itself, so is w, and all of it by less than 2^-48 |b|_1 |w|_1, a quarter of `room`. */
static int is_clear(const site *at, const blocker *q, ball w_x, ball w_y, ball w_z)
{
    const double p_size = fabs(at->n_x.hi) + fabs(at->n_y.hi) + fabs(at->n_z.hi);
    const double p_error = at->n_x.error + at->n_y.error + at->n_z.error;
    const double w_size = fabs(w_x.hi) + fabs(w_y.hi) + fabs(w_z.hi), w_error = w_x.error + w_y.error + w_z.error;
    const double b_x = q->gap_x.hi - at->n_x.hi, b_y = q->gap_y.hi - at->n_y.hi;
    const double b_z = q->gap_z.hi - at->n_z.hi;
    const double b_size = fabs(q->gap_x.hi) + fabs(q->gap_y.hi) + fabs(q->gap_z.hi) + p_size;
    const double cross_x = b_y * w_z.hi - b_z * w_y.hi, cross_y = b_z * w_x.hi - b_x * w_z.hi;
    const double cross_z = b_x * w_y.hi - b_y * w_x.hi, toward = b_x * w_x.hi + b_y * w_y.hi + b_z * w_z.hi;
    const double w2 = w_x.hi * w_x.hi + w_y.hi * w_y.hi + w_z.hi * w_z.hi;
    const double room = 0x1p-46 * b_size * w_size, most2 = q->ratio2.hi * w2 * (1.0 + 0x1p-40);
    const double least = sqrt(cross_x * cross_x + cross_y * cross_y + cross_z * cross_z) * (1.0 - 0x1p-40) - room;
    const int is_known = p_error < 0x1p-54 * p_size && w_error < 0x1p-54 * w_size && q->error < 0x1p-54 * b_size
                         && b_size < 0x1p200 && w_size < 0x1p200 && w2 > 0x1p-900;
    return is_known && ((least > 0.0 && least * least > most2) || toward < -room
                        || (q->is_around == BALL_NO && toward - w2 > room + 0x1p-46 * w_size * w_size));
}

/* Does a sphere stand between the point and the lamp? b, its centre seen from the point, lies before the point, not
 * beyond the lamp, and the line to the lamp meets the sphere. */
static ball_truth is_dark(const site *at, const tables *h, int number, ball w_x, ball w_y, ball w_z, ball w2)
{
    ball_truth dark = BALL_NO;
    for (int i = h->scene->blockers_begin[number]; i < h->scene->blockers_begin[number + 1]; ++i) {
        const blocker *q = &h->blockers[i];
        if (is_clear(at, q, w_x, w_y, w_z))
            continue;
        /* shadow [24 call]. Lagrange's identity |m|^2 |D|^2 - (m.D)^2 = |m x D|^2 */
        const ball b_x = ball_sub(q->gap_x, at->n_x);   /* b, the blocker's centre seen from the point */
        const ball b_y = ball_sub(q->gap_y, at->n_y);
        const ball b_z = ball_sub(q->gap_z, at->n_z);
        const ball cross_x = ball_sub(ball_mul(w_z, b_y), ball_mul(w_y, b_z));   /* b x w */
        const ball cross_y = ball_sub(ball_mul(w_x, b_z), ball_mul(w_z, b_x));
        const ball cross_z = ball_sub(ball_mul(w_y, b_x), ball_mul(w_x, b_y));
        const ball toward = ball_add(ball_add(ball_mul(w_x, b_x), ball_mul(w_y, b_y)), ball_mul(w_z, b_z));   /* b.w */
        /* positive where the line to the light meets the blocker */
        const ball inside2 = ball_sub(ball_sub(ball_sub(ball_mul(q->ratio2, w2), ball_square(cross_x)),
            ball_square(cross_y)), ball_square(cross_z));

        const ball_truth ends_beyond = ball_either(q->is_around, ball_less(toward, w2));
        const ball_truth meets = ball_both(ball_positive(inside2), ball_positive(toward));
        dark = ball_either(dark, ball_both(meets, ends_beyond));
        if (dark == BALL_YES)
            break;
    }
    return dark;
}

/* What one lamp adds. */
static void add_light(ball colour[CHANNELS], const site *at, const tables *h, int number)
{
    const lamp *l = &h->lamps[number];
    /* light [11 call] */
    /* w = (L - P) in the receiver's unit; nearness is 0 for a light in parallel, else 1 */
    const ball w_x = ball_sub(l->lamp_x, ball_mul_double(at->n_x, l->nearness));
    const ball w_y = ball_sub(l->lamp_y, ball_mul_double(at->n_y, l->nearness));
    const ball w_z = ball_sub(l->lamp_z, ball_mul_double(at->n_z, l->nearness));
    const ball w2 = ball_add(ball_add(ball_square(w_x), ball_square(w_y)), ball_square(w_z));   /* |w|^2 */

    const ball_truth dark = is_dark(at, h, number, w_x, w_y, w_z, w2);
    if (dark == BALL_YES)
        return;
    ball lambert = ball_from(0.0), shine = ball_from(0.0);
    if (l->terms & SPECULAR) {
        const double shininess = h->scene->shininess[at->receiver];
        /* light [9 call] */
        const ball inv_w2 = ball_div(ball_from(1.0), w2);
        /* n.l = n.w / |w| */
        const ball n_dot_l = ball_mul(ball_add(ball_add(ball_mul(at->n_x, w_x), ball_mul(at->n_y, w_y)),
            ball_mul(at->n_z, w_z)), ball_sqrt(inv_w2));

        /* specular [34 call]. Phong 1975, Illumination for computer generated pictures */
        /* r.v = w . mirror / (|w| |D|) */
        const ball w_dot_mirror = ball_add(ball_add(ball_mul(at->mirror_x, w_x), ball_mul(at->mirror_y, w_y)),
            ball_mul(at->mirror_z, w_z));
        const ball inv_w2_d2 = ball_mul(at->inv_d2, inv_w2);
        const ball cos2 = ball_mul(ball_square(w_dot_mirror), inv_w2_d2);   /* (r.v)^2 */
        /* w x mirror, short where the highlight is */
        const ball side_x = ball_sub(ball_mul(at->mirror_z, w_y), ball_mul(at->mirror_y, w_z));
        const ball side_y = ball_sub(ball_mul(at->mirror_x, w_z), ball_mul(at->mirror_z, w_x));
        const ball side_z = ball_sub(ball_mul(at->mirror_y, w_x), ball_mul(at->mirror_x, w_y));
        /* 1 - (r.v)^2, accurate where r.v is near 1 */
        const ball sin2 = ball_mul(inv_w2_d2,
            ball_add(ball_add(ball_square(side_x), ball_square(side_y)), ball_square(side_z)));
        const ball highlight = ball_power_of_cosine(cos2, sin2, shininess);   /* max(0, r.v)^n where r.v > 0 */
        /* 0^n: 1 for n = 0 */
        const ball zero_power = ball_select(ball_zero(ball_from(shininess)), ball_from(1.0), ball_from(0.0));
        const ball leaf = ball_select(ball_positive(w_dot_mirror), highlight, zero_power);   /* max(0, r.v)^n */
        const ball lobe = ball_select(ball_positive(w2), leaf, ball_from(0.0));

        /* diffuse [4 call]. Phong 1975, Illumination for computer generated pictures */
        /* max(0, n.l); a light at the point itself adds nothing */
        const ball cosine = ball_select(ball_positive(w2), ball_positive_part(n_dot_l), ball_from(0.0));

        shine = l->terms & GATED ? ball_select(ball_positive(cosine), lobe, ball_from(0.0)) : lobe;
        lambert = cosine;
    } else {
        /* light [9 call] */
        const ball inv_w2 = ball_div(ball_from(1.0), w2);
        /* n.l = n.w / |w| */
        const ball n_dot_l = ball_mul(ball_add(ball_add(ball_mul(at->n_x, w_x), ball_mul(at->n_y, w_y)),
            ball_mul(at->n_z, w_z)), ball_sqrt(inv_w2));

        /* diffuse [4 call]. Phong 1975, Illumination for computer generated pictures */
        /* max(0, n.l); a light at the point itself adds nothing */
        const ball cosine = ball_select(ball_positive(w2), ball_positive_part(n_dot_l), ball_from(0.0));

        lambert = cosine;
    }
    for (int i = 0; i < CHANNELS; ++i) {
        ball term = l->terms & DIFFUSE ? ball_mul(l->diffuse_gain[i], lambert) : ball_from(0.0);
        if (l->terms & SPECULAR)
            term = ball_add(term, ball_mul(l->specular_gain[i], shine));
        term = ball_select(dark, ball_from(0.0), term);
        colour[i] = ball_add(colour[i], term);
    }
}

/* The intensity of a point without what it mirrors. */
static void shade(ball colour[CHANNELS], const site *at, const tables *h)
{
    for (int i = 0; i < CHANNELS; ++i)
        colour[i] = ball_from(h->scene->ambient[CHANNELS * at->receiver + i]);
    for (int i = h->scene->lamps_begin[at->receiver]; i < h->scene->lamps_begin[at->receiver + 1]; ++i)
        add_light(colour, at, h, i);
}

/* The background in direction d. */
static void backdrop(ball colour[CHANNELS], const tables *h)
{
    const scene_type *scene = h->scene;
    for (int i = 0; i < CHANNELS; ++i)
        colour[i] = ball_from(scene->background[i]);
}

/* The intensity of the ray through a point of the image plane. Returns 0 where it may be anything. */
static int look(ball total[CHANNELS], const ray *r, const tables *h)
{
    site at;
    const int receiver = first_hit(&at, r, h);
    if (receiver == IN_DOUBT)
        return 0;
    if (receiver == NOTHING) {
        backdrop(total, h);
        return 1;
    }
    shade(total, &at, h);
    return 1;
}

/* A coordinate that the unit of the tables holds exactly, and whose products stay in range. */
static int is_in_range(double scaled, double unit, double coordinate)
{
    return scaled / unit == coordinate && fabs(scaled) < 0x1p200;
}

/* The intensity at a point of the image plane; what is unknown may be anything. */
static void enclose(ball total[CHANNELS], double x, double y, const tables *h)
{
    ray r = {.x = x * h->unit, .y = y * h->unit, .plane_x = x, .plane_y = y};
    r.length = sqrt(r.x * r.x + r.y * r.y + h->eye * h->eye);
    r.size = fabs(r.x) + fabs(r.y) + h->eye;
    const int is_known = is_in_range(r.x, h->unit, x) && is_in_range(r.y, h->unit, y) && look(total, &r, h);
    for (int c = 0; c < CHANNELS; ++c)
        if (!(is_known && total[c].error < INFINITY))
            total[c] = ball_unknown();
}

int scene_gated_shadow_enclosure_points(double *hi, double *lo, double *error,
    const double *x, const double *y, ptrdiff_t count, const scene_type *scene)
{
    tables h;
    if (!take(&h, scene)) {
        drop(&h);
        return -1;
    }
    for (ptrdiff_t i = 0; i < count; ++i) {
        ball total[CHANNELS];
        enclose(total, x[i], y[i], &h);
        for (int c = 0; c < CHANNELS; ++c) {
            hi[CHANNELS * i + c] = total[c].hi;
            lo[CHANNELS * i + c] = total[c].lo;
            error[CHANNELS * i + c] = total[c].error;
        }
    }
    drop(&h);
    return 0;
}

double scene_gated_shadow_enclosure_settle(double *values, unsigned char *is_settled,
    const double *x, const double *y, ptrdiff_t count, int rule, double white, const scene_type *scene)
{
    tables h;
    if (!take(&h, scene)) {
        drop(&h);
        return -1.0;
    }
    double largest = 0.0;
    for (ptrdiff_t i = 0; i < count; ++i) {
        ball total[CHANNELS];
        enclose(total, x[i], y[i], &h);
        int all = 1;
        double error = 0.0;
        for (int c = 0; c < CHANNELS; ++c) {
            const settled_value found = settled_by((settling_rule)rule, ball_centre(total[c]), total[c].error);
            values[CHANNELS * i + c] = found.value > white ? white : found.value;
            all &= found.is_settled;
            error = fmax(error, total[c].error);
        }
        is_settled[i] = (unsigned char)all;
        largest = all ? fmax(largest, error) : largest;
    }
    drop(&h);
    return largest;
}

double scene_gated_shadow_enclosure_batch(double *values, unsigned char *is_settled, const double *x, const double *y,
    const ptrdiff_t *begin, int rule, double white, const scene_gated_shadow_enclosure_scene *scenes, ptrdiff_t count)
{
    double largest = 0.0;
    for (ptrdiff_t k = 0; k < count; ++k) {
        const ptrdiff_t at = begin[k], points = begin[k + 1] - at;
        const double error = points > 0
            ? scene_gated_shadow_enclosure_settle(values + at * 1, is_settled + at, x + at, y + at, points, rule, white, &scenes[k])
            : 0.0;
        if (error < 0.0)
            return -1.0;
        largest = fmax(largest, error);
    }
    return largest;
}
