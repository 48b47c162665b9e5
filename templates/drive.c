/*
 * Loops of a compiled step under an input given as a formula: u(t) = sum_f a_f cos(w_f t) + b_f sin(w_f t), plus straight
 * lines between times, evaluated here, BLOCK steps at a time. Memory does not grow with the number of steps.
 *
 * Within a block the angles are turned by a table, cos(w (s + j h)) = cos(w s) cos(w j h) - sin(w s) sin(w j h); every
 * block starts anew from its time, known to more than double precision, so that no error gathers, however long the run.
 */
#include <math.h>
#include <stddef.h>
#include <string.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT
#endif

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("O3") /* vectors in the sums over a block */
#endif

/* ROW holds a block and one more moment: the end of its last step. */
enum { BLOCK = 64, ROW = 72, OWN = 16, SHARED = 128, MOST_PORTS = 32, MOST_POINTS = 8 };

typedef void (*scan_function)(ptrdiff_t, ptrdiff_t, const double *const *, const ptrdiff_t *, double *);
typedef void (*batch_function)(ptrdiff_t, ptrdiff_t, ptrdiff_t, const double *const *, const ptrdiff_t *,
    const ptrdiff_t *, double *);

/* Strides in doubles from one trajectory to the next; 0 where all share. Everything is given, nothing is kept. */
typedef struct {
    ptrdiff_t dim, rates, pieces, wave_stride, line_stride;
    const double *rate, *rate_low; /* w_f and what rounding left of it */
    const double *cosines, *sines; /* rates x dim */
    const double *times;           /* pieces + 1 */
    const double *left, *right;    /* pieces x dim: at the start and the end of each piece */
} Signal;

/* Spans between knots, `parts` steps each; without knots, steps of length h from `start`. */
typedef struct {
    ptrdiff_t spans, parts;
    const double *knots;
    double start, h;
} Grid;

/* The kernel: the state is input 0; `point` says where in a step an input reads u (-1: it is an array). */
typedef struct {
    ptrdiff_t inputs, state, step_port, time_port, points;
    const double *at; /* fractions of a step */
    const ptrdiff_t *point;
    const double *const *in;
    const ptrdiff_t *lane, *step;
} Ports;

/* What a block knows of its steps. */
typedef struct {
    double time, low, h; /* start, to twice the precision; step length */
    int even;            /* all steps are h to rounding, so that the table serves */
    double moment[BLOCK], length[BLOCK];
} Times;

/* Where the doubles of the workspace go. */
typedef struct {
    double *turn_c, *turn_s; /* rates x points x ROW: the table, for steps of length table_h */
    double *wave_c, *wave_s; /* the same, at the times of the block */
    double *sum;             /* dim x ROW */
    double *values;          /* trajectories x points x ROW x dim */
    double table_h;
} Work;

/* Whether u at the end of a step is read as that at the start of the next: it does not jump, and both are wanted. */
static int shared_ends(const Signal *u, const Ports *ports)
{
    return u->pieces == 0 && ports->points > 1 && ports->at[0] == 0.0 && ports->at[ports->points - 1] == 1.0;
}

static double two_sum(double a, double b, double *low)
{
    const double s = a + b, v = s - a;
    *low = (a - (s - v)) + (b - v);
    return s;
}

/* cos and sin of w t, both to twice the precision. */
static void turn(double w, double w_low, double t, double t_low, double *c, double *s)
{
    const double p = w * t, e = fma(w, t, -p) + w_low * t + w * t_low, cp = cos(p), sp = sin(p);
    *c = cp - e * sp;
    *s = sp + e * cp;
}

static void block_times(const Grid *grid, ptrdiff_t first, ptrdiff_t count, Times *times)
{
    ptrdiff_t j;
    if (!grid->knots) {
        const double offset = (double)first * grid->h, rest = fma((double)first, grid->h, -offset);
        times->time = two_sum(grid->start, offset, &times->low);
        times->low += rest;
        times->h = grid->h;
        times->even = 1;
        for (j = 0; j < count; ++j) {
            times->moment[j] = times->time + (times->low + (double)j * grid->h);
            times->length[j] = grid->h;
        }
        return;
    }
    for (j = 0; j < count; ++j) {
        const ptrdiff_t span = (first + j) / grid->parts, inside = (first + j) % grid->parts;
        const double h = (grid->knots[span + 1] - grid->knots[span]) / (double)grid->parts;
        double low;
        times->length[j] = h;
        times->moment[j] = two_sum(grid->knots[span], (double)inside * h, &low);
        if (j == 0) {
            times->time = times->moment[0];
            times->low = low + fma((double)inside, h, -((double)inside * h));
        }
    }
    {
        const double last = times->moment[count - 1] + times->length[count - 1];
        const double ulp = 4.5e-16 * (fabs(last) + fabs(times->time));
        times->h = count > 1 ? (last - times->time) / (double)count : times->length[0];
        times->even = 1;
        for (j = 0; j < count; ++j) {
            times->even &= fabs(times->moment[j] - times->time - (double)j * times->h) <= ulp;
        }
        if (count <= grid->parts && first % grid->parts + count <= grid->parts) {
            times->h = times->length[0];
            times->even = 1;
        }
    }
}

static void make_table(const Signal *u, const Ports *ports, double h, Work *work)
{
    ptrdiff_t f, p, j, place = 0;
    for (f = 0; f < u->rates; ++f) {
        for (p = 0; p < ports->points; ++p) {
            for (j = 0; j < ROW; ++j, ++place) {
                turn(u->rate[f], u->rate_low[f], ((double)j + ports->at[p]) * h, 0.0, work->turn_c + place, work->turn_s + place);
            }
        }
    }
    work->table_h = h;
}

/* cos and sin of every w_f t at every point of every step of a block, into the workspace. */
static void make_waves(const Signal *u, const Ports *ports, const Times *times, ptrdiff_t count, Work *work)
{
    const int ends = shared_ends(u, ports);
    const ptrdiff_t eights = (count + ends + 7) / 8 * 8;
    ptrdiff_t f, p, j, k;
    if (times->even && !(fabs(work->table_h - times->h) * (double)count <= 4.5e-16 * fabs(times->time))) {
        make_table(u, ports, times->h, work);
    }
    for (f = 0; f < u->rates; ++f) {
        double c0, s0;
        turn(u->rate[f], u->rate_low[f], times->time, times->low, &c0, &s0);
        for (p = 0; p < ports->points - ends; ++p) {
            const ptrdiff_t place = (f * ports->points + p) * ROW;
            const double *tc = work->turn_c + place, *ts = work->turn_s + place;
            double *c = work->wave_c + place, *s = work->wave_s + place;
            if (times->even) {
                for (j = 0; j < eights; j += 8) {
                    for (k = j; k < j + 8; ++k) {
                        c[k] = c0 * tc[k] - s0 * ts[k];
                        s[k] = s0 * tc[k] + c0 * ts[k];
                    }
                }
            } else {
                for (j = 0; j < count; ++j) {
                    double low;
                    const double t = two_sum(times->moment[j], ports->at[p] * times->length[j], &low);
                    turn(u->rate[f], u->rate_low[f], t, low, c + j, s + j);
                }
                if (ends && p == 0) {
                    double low;
                    const double t = two_sum(times->moment[count - 1], times->length[count - 1], &low);
                    turn(u->rate[f], u->rate_low[f], t, low, c + count, s + count);
                }
            }
        }
    }
}

/* sum (dim x ROW) += the series at point p of every step. */
static void add_waves(const Signal *u, const Ports *ports, ptrdiff_t count, ptrdiff_t p, const double *cosines,
    const double *sines, const Work *work)
{
    const ptrdiff_t eights = (count + 7) / 8 * 8;
    ptrdiff_t f, i, j, k;
    for (f = 0; f < u->rates; ++f) {
        const double *c = work->wave_c + (f * ports->points + p) * ROW, *s = work->wave_s + (f * ports->points + p) * ROW;
        for (i = 0; i < u->dim; ++i) {
            const double a = cosines[f * u->dim + i], b = sines[f * u->dim + i];
            double *sum = work->sum + i * ROW;
            if (a != 0.0 || b != 0.0) {
                for (j = 0; j < eights; j += 8) {
                    for (k = j; k < j + 8; ++k) {
                        sum[k] += a * c[k] + b * s[k];
                    }
                }
            }
        }
    }
}

/* The piece a step lies in is that of its middle, so that both its ends are read from inside. */
static void add_lines(const Signal *u, const Times *times, ptrdiff_t count, double at, ptrdiff_t k,
    const double *left, const double *right, const Work *work)
{
    ptrdiff_t i, j;
    for (j = 0; j < count; ++j) {
        const double middle = times->moment[j] + 0.5 * times->length[j];
        while (k + 1 < u->pieces && middle >= u->times[k + 1]) {
            ++k;
        }
        {
            const double width = u->times[k + 1] - u->times[k];
            const double x = (times->moment[j] - u->times[k] + at * times->length[j]) / width;
            for (i = 0; i < u->dim; ++i) {
                const double a = left[k * u->dim + i], b = right[k * u->dim + i];
                work->sum[i * ROW + j] += a == b ? a : a + x * (b - a);
            }
        }
    }
}

/* values of one trajectory: (points, ROW, dim). */
static void fill(const Signal *u, const Ports *ports, const Times *times, ptrdiff_t count, ptrdiff_t who, ptrdiff_t cursor,
    Work *work, double *values)
{
    const int ends = shared_ends(u, ports);
    ptrdiff_t p, i, j;
    for (p = 0; p < ports->points - ends; ++p) {
        const ptrdiff_t moments = count + (p == 0 ? ends : 0);
        memset(work->sum, 0, (size_t)(u->dim * ROW) * sizeof(double));
        if (u->rates) {
            add_waves(u, ports, moments, p, u->cosines + who * u->wave_stride, u->sines + who * u->wave_stride, work);
        }
        if (u->pieces) {
            add_lines(u, times, count, ports->at[p], cursor, u->left + who * u->line_stride, u->right + who * u->line_stride, work);
        }
        for (i = 0; i < u->dim; ++i) {
            for (j = 0; j < moments; ++j) {
                values[(p * ROW + j) * u->dim + i] = work->sum[i * ROW + j];
            }
        }
    }
}

/* The largest |h u| over the steps of a block. */
static double largest(const Signal *u, const Ports *ports, const Times *times, ptrdiff_t count, const double *values)
{
    const ptrdiff_t points = ports->points - shared_ends(u, ports);
    double most = 0.0;
    ptrdiff_t p, i, j;
    for (p = 0; p < points; ++p) {
        for (j = 0; j < count; ++j) {
            double square = 0.0;
            for (i = 0; i < u->dim; ++i) {
                const double v = times->length[j] * values[(p * ROW + j) * u->dim + i];
                square += v * v;
            }
            most = square > most ? square : most;
        }
    }
    return most;
}

/* How many steps a block takes: up to the end of a span, or several whole spans. */
static ptrdiff_t block_size(const Grid *grid, ptrdiff_t first)
{
    const ptrdiff_t left = grid->spans * grid->parts - first;
    ptrdiff_t count;
    if (grid->parts > BLOCK) {
        count = grid->parts - first % grid->parts;
        return count < BLOCK ? count : BLOCK;
    }
    count = BLOCK / grid->parts * grid->parts;
    return count < left ? count : left;
}

/* The inputs of one block: arrays moved on, driven ports pointed at the values, strides for trajectories and steps. */
static void point_inputs(const Signal *u, const Ports *ports, const Times *times, ptrdiff_t first, ptrdiff_t from, int own,
    const Work *work, const double **in, ptrdiff_t *lane, ptrdiff_t *step)
{
    ptrdiff_t k;
    for (k = 1; k < ports->inputs; ++k) {
        lane[k] = ports->lane[k];
        step[k] = ports->step[k];
        in[k] = ports->in[k] ? ports->in[k] + first * step[k] + from * lane[k] : NULL;
        if (ports->point[k] >= 0) {
            in[k] = work->values + ports->point[k] * ROW * u->dim;
            if (ports->point[k] == ports->points - 1 && shared_ends(u, ports)) {
                in[k] = work->values + u->dim;
            }
            lane[k] = own ? ports->points * ROW * u->dim : 0;
            step[k] = u->dim;
        } else if (k == ports->step_port || k == ports->time_port) {
            in[k] = k == ports->step_port ? times->length : times->moment;
            lane[k] = 0;
            step[k] = 1;
        }
    }
}

/* Doubles that the workspace must have, for so many doubles of state. */
EXPORT ptrdiff_t lie_codegen_drive_work(ptrdiff_t dim, ptrdiff_t rates, ptrdiff_t points, ptrdiff_t state);
EXPORT ptrdiff_t lie_codegen_drive_work(ptrdiff_t dim, ptrdiff_t rates, ptrdiff_t points, ptrdiff_t state)
{
    return 4 * rates * points * ROW + dim * ROW + OWN * points * ROW * dim + SHARED * state * (BLOCK + 2);
}

static void lay_out(const Signal *u, const Ports *ports, double *space, Work *work)
{
    work->turn_c = space;
    work->turn_s = work->turn_c + u->rates * ports->points * ROW;
    work->wave_c = work->turn_s + u->rates * ports->points * ROW;
    work->wave_s = work->wave_c + u->rates * ports->points * ROW;
    work->sum = work->wave_s + u->rates * ports->points * ROW;
    work->values = work->sum + u->dim * ROW;
    work->table_h = -1.0;
}

/*
 * `count` trajectories from in[0]; to: (count, spans + 1, state), the start and the state at every knot. One trajectory
 * goes through `scan`, more through `batch`, on lanes. Returns the largest |h u| of any step.
 */
EXPORT double lie_codegen_drive(scan_function scan, batch_function batch, ptrdiff_t count, const Signal *u, const Grid *grid,
    const Ports *ports, double *space, double *to);
EXPORT double lie_codegen_drive(scan_function scan, batch_function batch, ptrdiff_t count, const Signal *u, const Grid *grid,
    const Ports *ports, double *space, double *to)
{
    const ptrdiff_t total = grid->spans * grid->parts, size = ports->state, length = (grid->spans + 1) * size;
    const int own = u->wave_stride != 0 || u->line_stride != 0;
    const ptrdiff_t chunk = own ? OWN : SHARED;
    const double *in[MOST_PORTS];
    ptrdiff_t lane[MOST_PORTS], step[MOST_PORTS], from, first, j;
    double most = 0.0, *state, *made;
    Work work;
    lay_out(u, ports, space, &work);
    state = work.values + OWN * ports->points * ROW * u->dim;
    made = state + SHARED * size;
    for (from = 0; from < count; from += chunk) {
        const ptrdiff_t rows = count - from < chunk ? count - from : chunk;
        ptrdiff_t cursor = 0;
        for (j = 0; j < rows; ++j) {
            memcpy(state + j * size, ports->in[0] + (from + j) * ports->lane[0], (size_t)size * sizeof(double));
            memcpy(to + (from + j) * length, state + j * size, (size_t)size * sizeof(double));
        }
        in[0] = state;
        lane[0] = size;
        step[0] = 0;
        for (first = 0; first < total;) {
            Times times;
            const ptrdiff_t steps = block_size(grid, first);
            const int whole = grid->parts <= BLOCK;
            const ptrdiff_t every = whole ? grid->parts : steps, kept = steps / every;
            times.moment[0] = times.length[0] = 0.0;
            block_times(grid, first, steps, &times);
            while (cursor + 1 < u->pieces && times.moment[0] + 0.5 * times.length[0] >= u->times[cursor + 1]) {
                ++cursor;
            }
            make_waves(u, ports, &times, steps, &work);
            for (j = 0; j < (own ? rows : 1); ++j) {
                double *values = work.values + j * ports->points * ROW * u->dim;
                double move;
                fill(u, ports, &times, steps, from + j, cursor, &work, values);
                move = largest(u, ports, &times, steps, values);
                most = move > most ? move : most;
            }
            point_inputs(u, ports, &times, first, from, own, &work, in, lane, step);
            if (count == 1) {
                scan(steps, every, in, step, made);
            } else {
                batch(rows, steps, every, in, lane, step, made);
            }
            for (j = 0; j < rows; ++j) {
                const double *mine = made + j * (kept + 1) * size;
                memcpy(state + j * size, mine + kept * size, (size_t)size * sizeof(double));
                if ((first + steps) % grid->parts == 0) {
                    const ptrdiff_t span = (first + steps) / grid->parts - (whole ? kept : 1);
                    memcpy(to + (from + j) * length + (span + 1) * size, mine + (whole ? size : kept * size),
                        (size_t)((whole ? kept : 1) * size) * sizeof(double));
                }
            }
            first += steps;
        }
    }
    return sqrt(most);
}
