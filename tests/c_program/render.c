/* Renders Chapter 1's scene to a file of raw numbers, row 0 at the top:
 *
 *     render <accuracy> <width> <height> <file>
 *
 * accuracy   literal, double or baked (writes doubles) or single (writes floats)
 *
 * The numbers are the unclipped field. Exit status: 0 done, 1 not written, 2 usage.
 */
#include <symrender_cg/centred_sphere_double.h>
#include <symrender_cg/centred_sphere_double_baked.h>
#include <symrender_cg/centred_sphere_literal.h>
#include <symrender_cg/centred_sphere_single.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Each kernel has a scene structure of its own; those of one plan have the same fields. */
#define CHAPTER_1                                                                                                      \
    {                                                                                                                  \
        .eye = 4.0, .radius = 1.0, .light_x = 5.0, .light_y = 5.0, .light_z = 10.0, .light_intensity = 1.0,            \
        .k_ambient = 0.1, .k_diffuse = 0.7, .k_specular = 0.5, .shininess = 32.0, .background = 0.0                    \
    }

static int write_numbers(const char *path, const void *numbers, size_t size, size_t count)
{
    FILE *file = fopen(path, "wb");
    if (!file)
        return 1;
    const int failed = fwrite(numbers, size, count, file) != count;
    return fclose(file) != 0 || failed;
}

int main(int argc, char **argv)
{
    const int width = argc == 5 ? atoi(argv[2]) : 0, height = argc == 5 ? atoi(argv[3]) : 0;
    if (width < 1 || height < 1) {
        fprintf(stderr, "usage: render literal|single|double|baked <width> <height> <file>\n");
        return 2;
    }
    const char *accuracy = argv[1], *path = argv[4];
    const size_t count = (size_t)width * (size_t)height;

    /* The outline has the radius 4 / sqrt(15) on the image plane; a quarter more is in view. */
    const double half_height = 5.0 / sqrt(15.0);
    const symrender_grid grid = {width, height, 2.0 * half_height / height, INFINITY};

    double *doubles = calloc(count, sizeof *doubles);
    float *floats = calloc(count, sizeof *floats);
    int status = 1;
    if (doubles && floats) {
        if (strcmp(accuracy, "single") == 0) {
            const centred_sphere_single_scene scene = CHAPTER_1;
            centred_sphere_single_rows(floats, width, &grid, &scene, 0, height);
            status = write_numbers(path, floats, sizeof *floats, count);
        } else {
            if (strcmp(accuracy, "double") == 0) {
                const centred_sphere_double_scene scene = CHAPTER_1;
                centred_sphere_double_rows(doubles, width, &grid, &scene, 0, height);
                status = 0;
            } else if (strcmp(accuracy, "literal") == 0) {
                const centred_sphere_literal_scene scene = CHAPTER_1;
                centred_sphere_literal_rows(doubles, width, &grid, &scene, 0, height);
                status = 0;
            } else if (strcmp(accuracy, "baked") == 0) {
                centred_sphere_double_baked_rows(doubles, width, &grid, 0, height);
                status = 0;
            } else {
                fprintf(stderr, "render: there is no accuracy \"%s\"\n", accuracy);
                status = 2;
            }
            if (status == 0)
                status = write_numbers(path, doubles, sizeof *doubles, count);
        }
    }
    free(floats);
    free(doubles);
    return status;
}
