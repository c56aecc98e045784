/* A pool of threads that wakes in a fraction of a microsecond.
 *
 * Comes in: the entry point of a kernel with its arguments, rows [begin, end), a number of threads. Goes out: all rows
 * drawn, each once. Never here: what a row is, Python, memory that the caller has given back.
 *
 * Waiting. A thread that has drawn looks out for more (it spins) for a bounded time, then sleeps on a condition
 * variable. A word in shared memory reaches a thread that looks out in 0.1 us; the system takes 20 to 50 us to wake one
 * that sleeps. Nobody spins while more threads are awake than there are processors, nor on the processor where the
 * thread ran that it waits for.
 *
 * Sharing. Every thread has a part of the rows of its own, the same in each call, so that the next image finds in the
 * caches of a processor the rows that it wrote before. A thread takes a quarter of what is left of its part at a time;
 * whose part is drawn takes half of the fullest other one. (Affinity scheduling, Markatos and LeBlanc 1994.)
 *
 * Leaving. A worker that is called takes its call by one compare-and-swap, and so does the caller that has done without
 * it: a thread that wakes late finds nothing, is not waited for, and never sees the caller's memory.
 *
 * The types of pointers in pool.h stand for the kernels' own: a function is called through a type that differs from its
 * own in what its pointers point to. C leaves that open; on every system with pthreads all pointers are passed alike.
 */
#ifdef __linux__
#define _GNU_SOURCE /* sched_getcpu */
#else
#define _POSIX_C_SOURCE 200809L
#endif
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <time.h>

#include "pool.h"

#if defined(__x86_64__) || defined(__i386__)
#define PAUSE() __asm__ volatile("pause")
#elif defined(__aarch64__)
#define PAUSE() __asm__ volatile("isb")
#else
#define PAUSE() atomic_signal_fence(memory_order_seq_cst)
#endif

enum {
    CACHE_LINE = 64,
    MOST_THREADS = 256,
    SHARE = 4,            /* a thread takes this fraction of what is left of its part */
    PAUSES_A_LOOK = 16,   /* between two looks at the clock */
    STACK_BYTES = 4 << 20 /* where the system's default is less, as it is outside glibc */
};

/* ---- rows that are left -------------------------------------------------------------------------------------- */

/* Rows [begin, end) as one word, begin in the high half, so that one compare-and-swap takes some of them. */
typedef struct {
    _Alignas(CACHE_LINE) _Atomic uint64_t rows;
} part;

static uint64_t packed(int begin, int end)
{
    return (uint64_t)(uint32_t)begin << 32 | (uint32_t)end;
}

static int begin_of(uint64_t rows)
{
    return (int)(rows >> 32);
}

static int end_of(uint64_t rows)
{
    return (int)(rows & 0xffffffffu);
}

static int left_in(uint64_t rows)
{
    return end_of(rows) - begin_of(rows);
}

typedef struct job job;
struct job {
    void (*draw)(const job *task, int begin, int end);
    union {
        symrender_sphere_rows *sphere;
        symrender_baked_rows *baked;
        symrender_batch_rows *batch;
        symrender_listing_rows *listing;
    } rows;
    void *image;
    ptrdiff_t image_stride, stride;
    const void *grid, *scene;
    ptrdiff_t *unsettled, *found, width;
    _Atomic ptrdiff_t *total;
    atomic_bool *failed;
    int begin, least, threads;
    part *parts; /* one a thread */
};

/* Parts of the rows [task->begin, end) of one length, in the order of the seats. */
static void deal(job *task, int end)
{
    const long long height = end - task->begin;
    for (int i = 0; i < task->threads; ++i) {
        const int first = task->begin + (int)(height * i / task->threads);
        const int last = task->begin + (int)(height * (i + 1) / task->threads);
        atomic_init(&task->parts[i].rows, packed(first, last));
    }
}

/* A share of so many rows: 1/divisor of them, `least` where that is more, all where hardly any would be left. */
static int share_of(int left, int divisor, int least)
{
    const int share = left / divisor > least ? left / divisor : least;
    return share < left - least / 2 ? share : left;
}

/* Rows from the front of the thread's own part. */
static bool take_own(job *task, int seat, int *begin, int *end)
{
    part *own = &task->parts[seat];
    uint64_t rows = atomic_load(&own->rows);
    while (left_in(rows) > 0) {
        const int first = begin_of(rows), last = end_of(rows);
        const int next = first + share_of(last - first, SHARE, task->least);
        if (atomic_compare_exchange_weak(&own->rows, &rows, packed(next, last))) {
            *begin = first;
            *end = next;
            return true;
        }
    }
    return false;
}

/* Half of the fullest part, from its back: some rows to draw at once, the rest for the thread's own part, which is empty
 * and which nobody else writes to while it is. */
static bool take_over(job *task, int seat, int *begin, int *end)
{
    for (;;) {
        part *fullest = NULL;
        uint64_t rows = 0;
        for (int i = 0; i < task->threads; ++i) {
            const uint64_t there = atomic_load(&task->parts[i].rows);
            if (left_in(there) > left_in(rows)) {
                fullest = &task->parts[i];
                rows = there;
            }
        }
        if (!fullest)
            return false;
        const int last = end_of(rows), first = last - share_of(left_in(rows), 2, task->least);
        if (atomic_compare_exchange_strong(&fullest->rows, &rows, packed(begin_of(rows), first))) {
            *begin = first;
            *end = first + share_of(last - first, SHARE, task->least);
            atomic_store(&task->parts[seat].rows, packed(*end, last));
            return true;
        }
    }
}

static void draw_until_none_is_left(job *task, int seat)
{
    int begin, end;
    while (take_own(task, seat, &begin, &end) || take_over(task, seat, &begin, &end))
        task->draw(task, begin, end);
}

/* ---- threads that wait ----------------------------------------------------------------------------------------- */

static _Atomic long long spin_nanoseconds = 100000;
static atomic_int processors = 1, started, awake;

enum { IDLE, CALLED, AT_IT, DONE };

/* IDLE -> CALLED by the caller that has it, -> AT_IT by itself -> DONE -> IDLE by the caller; or CALLED -> IDLE by the
 * caller, where it has not begun. `task` and `seat` are the worker's from CALLED to DONE. */
typedef struct worker worker;
struct worker {
    _Alignas(CACHE_LINE) atomic_int state;
    atomic_bool asleep, caller_asleep;
    atomic_int processor, caller_processor;
    job *task;
    int seat;
    worker *next;
    pthread_mutex_t guard;
    pthread_cond_t called, done;
};

static long long nanoseconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return 1000000000LL * now.tv_sec + now.tv_nsec;
}

/* The processor that this thread runs on; below 0 where nobody knows. */
static int this_processor(void)
{
#ifdef __linux__
    return sched_getcpu();
#else
    return -1;
#endif
}

/* Whether the state came while this thread was looking out for it; `other`: the processor of the thread that sets it. */
static bool seen_soon(worker *w, int state, int other)
{
    const long long limit = atomic_load(&spin_nanoseconds);
    if (atomic_load(&w->state) == state)
        return true;
    if (limit <= 0 || (other >= 0 && other == this_processor()))
        return false;
    const long long begun = nanoseconds();
    do {
        for (int i = 0; i < PAUSES_A_LOOK; ++i) {
            if (atomic_load_explicit(&w->state, memory_order_acquire) == state)
                return true;
            PAUSE();
        }
    } while (atomic_load(&awake) <= atomic_load(&processors) && nanoseconds() - begun < limit);
    return false;
}

/* Sleeps until the state is there. Who sets it looks at `asleep` afterwards, and here it is the other way round: one of
 * the two sees what the other did. */
static void sleep_until(worker *w, int state, atomic_bool *asleep, pthread_cond_t *condition)
{
    pthread_mutex_lock(&w->guard);
    atomic_store(asleep, true);
    while (atomic_load(&w->state) != state)
        pthread_cond_wait(condition, &w->guard);
    atomic_store(asleep, false);
    pthread_mutex_unlock(&w->guard);
}

static void set_state(worker *w, int state, atomic_bool *asleep, pthread_cond_t *condition)
{
    atomic_store(&w->state, state);
    if (atomic_load(asleep)) {
        pthread_mutex_lock(&w->guard); /* it has begun to wait, or will see the state */
        pthread_mutex_unlock(&w->guard);
        pthread_cond_signal(condition); /* after the lock: it may run here and now, and needs it */
    }
}

static void *serve(void *given)
{
    worker *w = given;
    bool counted = false;
    for (;;) {
        if (!seen_soon(w, CALLED, atomic_load(&w->caller_processor))) {
            if (counted)
                atomic_fetch_sub(&awake, 1);
            counted = false;
            sleep_until(w, CALLED, &w->asleep, &w->called);
        }
        int state = CALLED;
        if (!atomic_compare_exchange_strong(&w->state, &state, AT_IT))
            continue;
        if (!counted)
            atomic_fetch_add(&awake, 1);
        counted = true;
        atomic_store(&w->processor, this_processor());
        draw_until_none_is_left(w->task, w->seat);
        set_state(w, DONE, &w->caller_asleep, &w->done);
    }
    return NULL;
}

/* A new worker that is called already; NULL where the system gives no thread. It takes no signal: those are for the
 * threads that somebody waits for. */
static worker *started_worker(job *task, int seat)
{
    worker *w = aligned_alloc(CACHE_LINE, sizeof *w);
    if (!w)
        return NULL;
    atomic_init(&w->state, CALLED);
    atomic_init(&w->asleep, false);
    atomic_init(&w->caller_asleep, false);
    atomic_init(&w->processor, -1);
    atomic_init(&w->caller_processor, this_processor());
    w->task = task;
    w->seat = seat;
    w->next = NULL;
    pthread_mutex_init(&w->guard, NULL);
    pthread_cond_init(&w->called, NULL);
    pthread_cond_init(&w->done, NULL);

    size_t stack = 0;
    pthread_attr_t how;
    pthread_attr_init(&how);
    pthread_attr_setdetachstate(&how, PTHREAD_CREATE_DETACHED);
    if (pthread_attr_getstacksize(&how, &stack) == 0 && stack < STACK_BYTES)
        pthread_attr_setstacksize(&how, STACK_BYTES);
    sigset_t every, before;
    sigfillset(&every);
    pthread_sigmask(SIG_SETMASK, &every, &before);
    pthread_t thread;
    const int problem = pthread_create(&thread, &how, serve, w);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    pthread_attr_destroy(&how);
    if (problem) {
        pthread_cond_destroy(&w->done);
        pthread_cond_destroy(&w->called);
        pthread_mutex_destroy(&w->guard);
        free(w);
        return NULL;
    }
    atomic_fetch_add(&started, 1);
    return w;
}

/* ---- the pool -------------------------------------------------------------------------------------------------- */

static pthread_mutex_t idle_guard = PTHREAD_MUTEX_INITIALIZER;
static worker *idle; /* the one that was put back last is first: it may still look out */

static void before_fork(void)
{
    pthread_mutex_lock(&idle_guard);
}

static void after_fork_in_parent(void)
{
    pthread_mutex_unlock(&idle_guard);
}

/* The child has none of the threads. What it inherits of them is left alone: a lock in it may be held for ever. */
static void after_fork_in_child(void)
{
    idle = NULL;
    atomic_store(&started, 0);
    atomic_store(&awake, 0);
    pthread_mutex_unlock(&idle_guard);
}

static void watch_forks(void)
{
    pthread_atfork(before_fork, after_fork_in_parent, after_fork_in_child);
}

/* Calls workers for the seats from 1 on, starting those that are missing. How many there are. */
static int call_workers(job *task, worker **called)
{
    const int wanted = task->threads - 1;
    int count = 0;
    pthread_mutex_lock(&idle_guard);
    for (; count < wanted && idle; ++count) {
        called[count] = idle;
        idle = idle->next;
    }
    pthread_mutex_unlock(&idle_guard);
    const int here = this_processor();
    for (int i = 0; i < count; ++i) {
        atomic_store(&called[i]->caller_processor, here);
        called[i]->task = task;
        called[i]->seat = i + 1;
        set_state(called[i], CALLED, &called[i]->asleep, &called[i]->called);
    }
    while (count < wanted && (called[count] = started_worker(task, count + 1)) != NULL)
        ++count;
    return count;
}

/* Waits for the workers that have begun; all are idle then. */
static void dismiss_workers(worker **called, int count)
{
    for (int i = 0; i < count; ++i) {
        worker *w = called[i];
        int state = CALLED;
        if (atomic_compare_exchange_strong(&w->state, &state, IDLE))
            continue;
        if (!seen_soon(w, DONE, atomic_load(&w->processor)))
            sleep_until(w, DONE, &w->caller_asleep, &w->done);
        atomic_store(&w->state, IDLE);
    }
    pthread_mutex_lock(&idle_guard);
    for (int i = count; i-- > 0;) {
        called[i]->next = idle;
        idle = called[i];
    }
    pthread_mutex_unlock(&idle_guard);
}

/* Draws rows [task->begin, end) on task->threads threads. */
static void share(job *task, int end)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, watch_forks);
    const int height = end - task->begin;
    if (height <= 0)
        return;
    const int most = height / task->least + (height % task->least != 0);
    task->threads = task->threads < most ? task->threads : most;
    task->threads = task->threads < MOST_THREADS ? task->threads : MOST_THREADS;
    part parts[MOST_THREADS];
    task->parts = parts;
    deal(task, end);
    worker *called[MOST_THREADS];
    atomic_fetch_add(&awake, 1);
    const int count = call_workers(task, called);
    draw_until_none_is_left(task, 0);
    dismiss_workers(called, count);
    atomic_fetch_sub(&awake, 1);
}

void symrender_pool_set(long long nanoseconds_to_spin, int count)
{
    atomic_store(&spin_nanoseconds, nanoseconds_to_spin);
    atomic_store(&processors, count);
}

int symrender_pool_started(void)
{
    return atomic_load(&started);
}

int symrender_pool_awake(void)
{
    return atomic_load(&awake);
}

/* ---- the kinds of kernels -------------------------------------------------------------------------------------- */

static void draw_sphere(const job *task, int begin, int end)
{
    task->rows.sphere(task->image, task->stride, task->grid, task->scene, begin, end);
}

void symrender_pool_sphere(symrender_sphere_rows *rows, void *image, ptrdiff_t stride, const void *grid,
    const void *scene, int begin, int end, int least, int threads)
{
    job task = {
        .draw = draw_sphere, .rows.sphere = rows, .image = image, .stride = stride, .grid = grid,
        .scene = scene, .begin = begin, .least = least, .threads = threads};
    share(&task, end);
}

static void draw_baked(const job *task, int begin, int end)
{
    task->rows.baked(task->image, task->stride, task->grid, begin, end);
}

void symrender_pool_baked(symrender_baked_rows *rows, void *image, ptrdiff_t stride, const void *grid,
    int begin, int end, int least, int threads)
{
    job task = {
        .draw = draw_baked, .rows.baked = rows, .image = image, .stride = stride, .grid = grid, .begin = begin,
        .least = least, .threads = threads};
    share(&task, end);
}

static void draw_batch(const job *task, int begin, int end)
{
    task->rows.batch(task->image, task->image_stride, task->stride, task->grid, task->scene, begin, end);
}

void symrender_pool_batch(symrender_batch_rows *rows, void *images, ptrdiff_t image_stride, ptrdiff_t stride,
    const void *grids, const void *scenes, int begin, int end, int least, int threads)
{
    job task = {
        .draw = draw_batch, .rows.batch = rows, .image = images, .image_stride = image_stride,
        .stride = stride, .grid = grids, .scene = scenes, .begin = begin, .least = least, .threads = threads};
    share(&task, end);
}

static void draw_listing(const job *task, int begin, int end)
{
    const ptrdiff_t row = begin - task->begin;
    const ptrdiff_t found = task->rows.listing(
        task->image, task->stride, task->grid, task->scene, begin, end, task->unsettled + row * task->width);
    if (found > 0) {
        task->found[row] = found;
        atomic_fetch_add(task->total, found);
    } else if (found < 0) {
        atomic_store(task->failed, true);
    }
}

ptrdiff_t symrender_pool_listing(symrender_listing_rows *rows, void *image, ptrdiff_t stride, const void *grid,
    const void *scene, int begin, int end, int least, int threads,
    ptrdiff_t *unsettled, ptrdiff_t width, ptrdiff_t *found)
{
    _Atomic ptrdiff_t total = 0;
    atomic_bool failed = false;
    job task = {
        .draw = draw_listing, .rows.listing = rows, .image = image, .stride = stride, .grid = grid,
        .scene = scene, .begin = begin, .least = least, .threads = threads, .unsettled = unsettled,
        .width = width, .found = found, .total = &total, .failed = &failed};
    share(&task, end);
    return atomic_load(&failed) ? -1 : atomic_load(&total);
}
