/* Kernel functions are one expression cut into named pieces: a loop over them vectorises only once they are all
 * inlined, and a compiler's patience for that may end early. */
#ifndef SYMRENDER_INLINE_H
#define SYMRENDER_INLINE_H

#if defined(__GNUC__)
#define SYMRENDER_INLINE static inline __attribute__((always_inline))
#else
#define SYMRENDER_INLINE static inline
#endif

#endif
