/* Rows of an image over threads that are kept between calls: the functions of pool.c, as C and as cffi read them.
 *
 * `rows` is the entry point of a kernel: it draws rows [begin, end) and may be called by several threads at once for
 * different rows. Each function below draws rows [begin, end) on `threads` threads, the calling one among them, and
 * returns when all are drawn. No thread takes fewer than `least` rows at a time while there are so many; which thread
 * draws which rows changes no value. Where a kernel has pointers to types of its own, these are pointers to void.
 */

/* image, stride, grid, scene */
typedef void symrender_sphere_rows(void *, ptrdiff_t, const void *, const void *, int, int);
void symrender_pool_sphere(symrender_sphere_rows *rows, void *image, ptrdiff_t stride, const void *grid,
    const void *scene, int begin, int end, int least, int threads);

/* image, stride, grid */
typedef void symrender_baked_rows(void *, ptrdiff_t, const void *, int, int);
void symrender_pool_baked(symrender_baked_rows *rows, void *image, ptrdiff_t stride, const void *grid,
    int begin, int end, int least, int threads);

/* images, image_stride, stride, grids, scenes */
typedef void symrender_batch_rows(void *, ptrdiff_t, ptrdiff_t, const void *, const void *, ptrdiff_t, ptrdiff_t);
void symrender_pool_batch(symrender_batch_rows *rows, void *images, ptrdiff_t image_stride, ptrdiff_t stride,
    const void *grids, const void *scenes, int begin, int end, int least, int threads);

/* Kernels that list pixels, of scenes (image, stride, frame, layers) or such that settle (image, stride, grid, scene).
 * unsettled: (end - begin) * width; found: end - begin zeros. Of the rows that a thread took at a time, the first one
 * being b, the pixels listed are the found[b - begin] from unsettled[(b - begin) * width] on. Returns how many there are
 * in all; a negative number says that there was no memory for some of the rows. */
typedef ptrdiff_t symrender_listing_rows(void *, ptrdiff_t, const void *, const void *, int, int, ptrdiff_t *);
ptrdiff_t symrender_pool_listing(symrender_listing_rows *rows, void *image, ptrdiff_t stride, const void *grid,
    const void *scene, int begin, int end, int least, int threads,
    ptrdiff_t *unsettled, ptrdiff_t width, ptrdiff_t *found);

/* How long a thread looks out for its next rows before it sleeps, and how many threads may be awake for that. */
void symrender_pool_set(long long spin_nanoseconds, int processors);

/* Threads that were started; and those that draw or look out for rows at this moment, callers too. */
int symrender_pool_started(void);
int symrender_pool_awake(void);
