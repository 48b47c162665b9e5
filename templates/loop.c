/*
 * The loop of a sampled law: motion under a held command, then the law, for many loops, with noise that is drawn here.
 *
 * The kernels come as functions on a state vector: `both` is a step of the motion and then the law, where there is one step a
 * sample; else `motion` goes `parts` steps and `control` is the law alone.
 *
 * Noise: uniform numbers by Philox4x32-10 (Salmon, Moraes, Dror and Shaw, SC 2011), of the key `seed` at the counter
 * (sample, loop, what): each number belongs to its loop and its sample, however the loops are shared out.
 */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT
#endif

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("O3") /* vectors in the rounds of the generator */
#endif

/* Loops and samples for which the noise is drawn at once: 200 kB of it, which the second cache holds. */
enum { ROWS = 64, BLOCK = 32, WIDE = 8, MOST_INPUTS = 64 };

typedef void (*scan_function)(ptrdiff_t, ptrdiff_t, const double *const *, const ptrdiff_t *, double *);
typedef void (*batch_function)(ptrdiff_t, ptrdiff_t, ptrdiff_t, const double *const *, const ptrdiff_t *,
    const ptrdiff_t *, double *);

/* A kernel: input 0 is the state, input `noise` the noise (-1: none); strides in doubles from loop to loop and step to step. */
typedef struct {
    scan_function scan;
    batch_function batch;
    ptrdiff_t inputs, noise;
    const double *const *in;
    const ptrdiff_t *lane, *step;
} Stage;

typedef struct {
    uint64_t seed, first_loop, first_sample;
    ptrdiff_t blocks;   /* of four numbers a sample */
    const uint32_t *what; /* one a block */
} Noise;

/* `samples` between two kept states, `parts` steps of the motion in each; a command acts `delay` samples later. */
typedef struct {
    ptrdiff_t spans, samples, parts, size, command, delay;
    double *ring; /* (loops, delay, command): what is on its way */
} Task;

/* Four numbers in (0, 1) for each of WIDE samples from `sample` on; to: `width` doubles from one sample to the next. */
static void four(const Noise *noise, uint64_t loop, uint32_t sample, uint32_t what, ptrdiff_t width, int count, double *to)
{
    const uint64_t low = 0xffffffffu;
    uint64_t a[WIDE], b[WIDE], c[WIDE], d[WIDE];
    uint32_t k0 = (uint32_t)noise->seed, k1 = (uint32_t)(noise->seed >> 32);
    int round, j;
    for (j = 0; j < WIDE; ++j) {
        a[j] = (sample + (uint32_t)j) & low;
        b[j] = loop & low;
        c[j] = loop >> 32;
        d[j] = what;
    }
    for (round = 0; round < 10; ++round) {
        for (j = 0; j < WIDE; ++j) {
            const uint64_t p = 0xD2511F53u * a[j], q = 0xCD9E8D57u * c[j];
            a[j] = (q >> 32) ^ b[j] ^ k0;
            b[j] = q & low;
            c[j] = (p >> 32) ^ d[j] ^ k1;
            d[j] = p & low;
        }
        k0 += 0x9E3779B9u;
        k1 += 0xBB67AE85u;
    }
    for (j = 0; j < count; ++j) {
        to[j * width] = ((double)a[j] + 0.5) * 0x1p-32;
        to[j * width + 1] = ((double)b[j] + 0.5) * 0x1p-32;
        to[j * width + 2] = ((double)c[j] + 0.5) * 0x1p-32;
        to[j * width + 3] = ((double)d[j] + 0.5) * 0x1p-32;
    }
}

/* to: (count, 4 blocks) numbers of one loop at samples first .. first + count - 1. */
EXPORT void lie_codegen_uniforms(const Noise *noise, uint64_t loop, uint64_t first, ptrdiff_t count, double *to);
EXPORT void lie_codegen_uniforms(const Noise *noise, uint64_t loop, uint64_t first, ptrdiff_t count, double *to)
{
    const ptrdiff_t width = 4 * noise->blocks;
    ptrdiff_t block, j;
    for (block = 0; block < noise->blocks; ++block) {
        for (j = 0; j < count; j += WIDE) {
            const int some = count - j < WIDE ? (int)(count - j) : WIDE;
            four(noise, loop, (uint32_t)(first + (uint64_t)j), noise->what[block], width, some, to + j * width + 4 * block);
        }
    }
}

/* `n` calls of a kernel from `state`, for the loops from `from` on; the `skip`-th entry of each input that moves is the first. */
static void repeat(const Stage *stage, ptrdiff_t rows, ptrdiff_t from, ptrdiff_t skip, ptrdiff_t n, ptrdiff_t every,
    const double *state, ptrdiff_t size, const double *drawn, ptrdiff_t width, double *made, int many)
{
    const double *in[MOST_INPUTS];
    ptrdiff_t lane[MOST_INPUTS], step[MOST_INPUTS], k;
    for (k = 1; k < stage->inputs; ++k) {
        lane[k] = stage->lane[k];
        step[k] = stage->step[k];
        if (k == stage->noise) {
            in[k] = drawn;
            lane[k] = BLOCK * width;
            step[k] = width;
        } else {
            in[k] = stage->in[k] + from * lane[k] + skip * step[k];
        }
    }
    in[0] = state;
    lane[0] = size;
    step[0] = 0;
    if (many) {
        stage->batch(rows, n, every, in, lane, step, made);
    } else {
        stage->scan(n, every, in, step, made);
    }
}

/* Last states of `rows` runs of `kept` states behind their start. */
static void last(ptrdiff_t rows, ptrdiff_t kept, ptrdiff_t size, const double *made, double *state)
{
    ptrdiff_t j;
    for (j = 0; j < rows; ++j) {
        memcpy(state + j * size, made + (j * (kept + 1) + kept) * size, (size_t)size * sizeof(double));
    }
}

/* The command that was given goes on its way, and the one that arrives acts. */
static void pass_on(const Task *task, ptrdiff_t rows, ptrdiff_t from, uint64_t sample, double *state)
{
    ptrdiff_t j, i;
    for (j = 0; j < rows; ++j) {
        double *acting = state + (j + 1) * task->size - task->command;
        double *way = task->ring + ((from + j) * task->delay + (ptrdiff_t)(sample % (uint64_t)task->delay)) * task->command;
        for (i = 0; i < task->command; ++i) {
            const double given = acting[i];
            acting[i] = way[i];
            way[i] = given;
        }
    }
}

EXPORT ptrdiff_t lie_codegen_loop_work(ptrdiff_t size, ptrdiff_t blocks);
EXPORT ptrdiff_t lie_codegen_loop_work(ptrdiff_t size, ptrdiff_t blocks)
{
    return ROWS * (size * (BLOCK + 2) + BLOCK * 4 * blocks);
}

/*
 * From the states at `from` on; to: `spans` states of each loop. Strides in doubles from loop to loop. Entry s of the inputs of
 * `both` and `control` is that of the call at the end of sample s; those of `motion` go on by steps.
 */
EXPORT void lie_codegen_loop(ptrdiff_t count, const Task *task, const Stage *both, const Stage *motion, const Stage *control,
    const Noise *noise, const double *from, ptrdiff_t from_stride, double *to, ptrdiff_t to_stride, double *space, int many);
EXPORT void lie_codegen_loop(ptrdiff_t count, const Task *task, const Stage *both, const Stage *motion, const Stage *control,
    const Noise *noise, const double *from, ptrdiff_t from_stride, double *to, ptrdiff_t to_stride, double *space, int many)
{
    const ptrdiff_t size = task->size, total = task->spans * task->samples, width = 4 * noise->blocks;
    const int whole = task->samples <= BLOCK;
    double *state = space, *made = state + ROWS * size, *drawn = made + ROWS * (BLOCK + 1) * size;
    ptrdiff_t first, j, s;
    for (first = 0; first < count; first += ROWS) {
        const ptrdiff_t rows = count - first < ROWS ? count - first : ROWS;
        ptrdiff_t begin = 0;
        for (j = 0; j < rows; ++j) {
            memcpy(state + j * size, from + (first + j) * from_stride, (size_t)size * sizeof(double));
        }
        while (begin < total) {
            const ptrdiff_t left = whole ? total - begin : task->samples - begin % task->samples;
            const ptrdiff_t most = whole ? BLOCK / task->samples * task->samples : BLOCK;
            const ptrdiff_t some = left < most ? left : most, every = whole ? task->samples : some;
            const uint64_t sample = noise->first_sample + (uint64_t)begin + 1;
            for (j = 0; j < rows && noise->blocks; ++j) {
                lie_codegen_uniforms(noise, noise->first_loop + (uint64_t)(first + j), sample, some, drawn + j * BLOCK * width);
            }
            if (both) {
                repeat(both, rows, first, begin, some, every, state, size, drawn, width, made, many);
                last(rows, some / every, size, made, state);
                for (j = 0; j < rows && (whole || (begin + some) % task->samples == 0); ++j) {
                    double *mine = to + (first + j) * to_stride + begin / task->samples * size;
                    memcpy(mine, made + (j * (some / every + 1) + 1) * size, (size_t)(some / every * size) * sizeof(double));
                }
            }
            for (s = 0; !both && s < some; ++s) {
                repeat(motion, rows, first, (begin + s) * task->parts, task->parts, task->parts, state, size, NULL, 0, made, many);
                last(rows, 1, size, made, state);
                repeat(control, rows, first, begin + s, 1, 1, state, size, drawn + s * width, width, made, many);
                last(rows, 1, size, made, state);
                if (task->delay) {
                    pass_on(task, rows, first, sample + (uint64_t)s, state);
                }
                for (j = 0; j < rows && (begin + s + 1) % task->samples == 0; ++j) {
                    memcpy(to + (first + j) * to_stride + (begin + s) / task->samples * size, state + j * size,
                        (size_t)size * sizeof(double));
                }
            }
            begin += some;
        }
    }
}
