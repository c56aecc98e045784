/* Blocks: values of a few hundred pixels on their way from one loop to the next, held in the first level cache. */
#ifndef SYMRENDER_BLOCK_H
#define SYMRENDER_BLOCK_H

/* Arrays begin with a line of the cache; else each vector of 64 bytes would straddle two. */
#if defined(__GNUC__)
#define SYMRENDER_ALIGNED __attribute__((aligned(64)))
#else
#define SYMRENDER_ALIGNED
#endif

#include <stddef.h>

/* Asks for the memory of a row that is written next, so that it is in the cache by then: the values of a block are
 * written in one go, which else waits for each line. */
static inline void fetch_ahead(const void *row, size_t bytes)
{
#if defined(__GNUC__)
    for (size_t at = 0; at < bytes; at += 64)
        __builtin_prefetch((const char *)row + at, 1, 2);
#else
    (void)row, (void)bytes;
#endif
}

/* n / 2 for an even whole number n from 8 to 1024, else 0: a lower power of 1 - sin^2 is less accurate than one of
 * cos^2 where the cosine is small */
static inline int half_of_whole(double n)
{
    const int h = n >= 8.0 && n <= 1024.0 ? (int)(0.5 * n) : 0;
    return 2.0 * h == n ? h : 0;
}

/* count, up to whole vectors: what lies beyond the last pixel is computed with the others, and not written */
static inline int whole_vectors(int count)
{
    return (count + 15) & ~15;
}

/* count, down to whole vectors */
static inline int vectors_begin(int count)
{
    return count & ~15;
}

#endif
