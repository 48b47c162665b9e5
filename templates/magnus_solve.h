/* One trajectory to a tolerance: its spans, the steps in each, and runs with ever shorter steps until two of them agree. */
#ifndef MAGNUS_SOLVE_H
#define MAGNUS_SOLVE_H

enum { REACHED = 0, TOO_MANY_AT_FIRST = 1, TOO_MANY = 2, NOT_FINITE = 3, LONG = 4 };

typedef struct {
    Input u;
    ptrdiff_t pieces;                 /* of u; their ends are u.times */
    const double *norms;              /* DIM x DIM: x' norms x = |hat(x)|_F^2; then DIM: |A_i|_2 */
    const double *times;              /* of the states that are wanted, the first that of X0 */
    const double *X0;
    ptrdiff_t count, order, most, block; /* times; steps that may be taken; steps from which Python is to lead */
    double rtol, atol;
    double *knots;                    /* count + pieces + 1 */
    ptrdiff_t *parts, *first, *piece, *slot; /* as many each */
    double *space, *coarse, *fine, *end; /* states at the times after the first, by two runs */
    ptrdiff_t spans, multiple, steps; /* what was done: each span has multiple times as many steps as the coarsest */
    double estimate, longest, shortest;
} Solve;

/* A bound of |hat(x)|_2: the Frobenius norm, or the sum of those of its terms; of large matrices with few terms that is much less. */
static double size_of(const double *norms, const double *x)
{
    double square = 0.0, sum = 0.0;
    EACH(i, DIM) {
        EACH(j, DIM) { square += x[i] * norms[i * DIM + j] * x[j]; }
        sum += fabs(x[i]) * norms[DIM * DIM + i];
    }
    square = sqrt(square > 0.0 ? square : 0.0);
    return sum < square ? sum : square;
}

static double larger(double a, double b)
{
    return a > b || a != a ? a : b;
}

/*
 * Steps per unit of time that piece k asks for: one radian of the fastest sine, and |h hat(u)| <= 1, well
 * inside the radius pi in which the Magnus series converges.
 */
static double density(const Solve *s, double waves, double fastest, ptrdiff_t k)
{
    const Input *u = &s->u;
    double total = waves;
    for (ptrdiff_t j = 0; j < u->terms; ++j) {
        total += size_of(s->norms, u->series + (k * u->terms + j) * DIM);
    }
    if (!u->terms && s->pieces) {
        total += larger(size_of(s->norms, u->left + k * DIM), size_of(s->norms, u->right + k * DIM));
    }
    return larger(fabs(u->factor[0]) * total, fastest);
}

/* Spans that end at every time that is wanted and at the ends of the pieces; the number of steps, or -1 where it is beyond `most`. */
static ptrdiff_t plan(Solve *s)
{
    const Input *u = &s->u;
    double waves = 0.0, fastest = 0.0, total = 0.0, known = -1.0, per_time = 0.0;
    ptrdiff_t k = 0, next = 1;
    for (ptrdiff_t f = 0; f < u->rates; ++f) {
        const double *x = u->cosines + f * DIM, *y = u->sines + f * DIM;
        const double c = size_of(s->norms, x), d = size_of(s->norms, y), both = sqrt(c * c + d * d);
        waves += both;
        fastest = both != 0.0 ? larger(fabs(u->rate[f]), fastest) : fastest;
    }
    while (s->pieces && k + 1 < s->pieces && u->times[k + 1] <= s->times[0]) {
        ++k; /* the piece in which the run begins; the outermost go on for ever */
    }
    s->spans = 0;
    s->knots[0] = s->times[0];
    for (ptrdiff_t left = s->count - 1; left > 0;) {
        const double stop = s->times[next];
        const int piece_ends = s->pieces && k + 1 < s->pieces && u->times[k + 1] < stop;
        const double end = piece_ends ? u->times[k + 1] : stop;
        if (known != (double)k) {
            per_time = density(s, waves, fastest, k);
            known = (double)k;
        }
        const double wanted = ceil((end - s->knots[s->spans]) * per_time * (1 - 1e-12));
        total += wanted;
        if (!(total <= (double)s->most)) {
            return -1;
        }
        s->parts[s->spans] = wanted > 1.0 ? (ptrdiff_t)wanted : 1;
        s->piece[s->spans] = k;
        s->slot[s->spans] = piece_ends ? -1 : next - 1;
        s->knots[++s->spans] = end;
        if (!piece_ends) {
            ++next;
            --left;
        }
        if (s->pieces && k + 1 < s->pieces && u->times[k + 1] <= end) {
            ++k;
        }
    }
    s->first[0] = 0;
    for (ptrdiff_t j = 0; j < s->spans; ++j) {
        s->first[j + 1] = s->first[j] + s->parts[j];
    }
    return s->first[s->spans];
}

static int run(Solve *s, ptrdiff_t multiple, double *X)
{
    const Grid grid = {s->spans, s->knots, s->parts, s->first, s->piece, s->slot};
    const ptrdiff_t states = (s->count - 1) * PARTS * SIZE * SIZE;
    for (ptrdiff_t j = 0; j < s->spans; ++j) {
        s->parts[j] = s->parts[j] / s->multiple * multiple;
        s->first[j + 1] = s->first[j] + s->parts[j];
    }
    s->multiple = multiple;
    s->steps = s->first[s->spans];
    magnus_one(&s->u, &grid, s->order, 0, s->steps, s->X0, s->count - 1, s->space, X, s->end);
    for (ptrdiff_t k = 0; k < states; ++k) {
        if (!(fabs(X[k]) <= 1.79e308)) {
            return NOT_FINITE;
        }
    }
    return REACHED;
}

/*
 * The error of a run is its difference to the one before, over (ratio of steps)^order - 1. Of the first pair the order is trusted
 * less, 63 is taken for 255: far from convergence the error falls more slowly.
 */
EXPORT ptrdiff_t magnus_solve(Solve *s);
EXPORT ptrdiff_t magnus_solve(Solve *s)
{
    const ptrdiff_t base = plan(s), states = (s->count - 1) * SIZE * SIZE;
    ptrdiff_t before = 1, multiple = 2;
    double trust = (double)s->order - 2.0;
    int status;
    s->multiple = 1;
    if (base < 0) {
        return TOO_MANY_AT_FIRST;
    }
    if (base * multiple > s->block) {
        return LONG;
    }
    status = run(s, 1, s->coarse);
    while (status == REACHED) {
        double scale = 1.0, difference = 0.0, goal, lowest, ratio, needed;
        if (base * multiple > s->most) {
            return TOO_MANY;
        }
        if (base * multiple > s->block) {
            return LONG;
        }
        status = run(s, multiple, s->fine);
        if (status != REACHED) {
            break;
        }
        for (ptrdiff_t k = 0; k < states; ++k) {
            double size = 0.0, apart = 0.0;
            EACH(p, PARTS) {
                const double x = s->fine[PARTS * k + p], d = x - s->coarse[PARTS * k + p];
                size += x * x;
                apart += d * d;
            }
            scale = larger(size, scale);
            difference = larger(apart, difference);
        }
        scale = sqrt(scale);
        difference = sqrt(difference);
        ratio = (double)multiple / (double)before;
        s->estimate = difference / (pow(ratio, trust) - 1.0);
        goal = larger(s->rtol * scale, s->atol);
        lowest = 4e-16 * scale * sqrt((double)s->steps); /* what rounding leaves after so many products, as a random walk */
        if (s->estimate <= larger(goal, lowest)) {
            s->longest = 0.0;
            s->shortest = INFINITY;
            for (ptrdiff_t j = 0; j < s->spans; ++j) {
                const double h = (s->knots[j + 1] - s->knots[j]) / (double)s->parts[j];
                s->longest = h > s->longest ? h : s->longest;
                s->shortest = h < s->shortest ? h : s->shortest;
            }
            return REACHED;
        }
        /*
         * The next run should reach half the goal, by the order as it is: what a run is held to does not depend on how it was chosen. It is at least
         * half as fine again, so that the two can be compared.
         */
        needed = pow(difference / (pow(ratio, (double)s->order) - 1.0) / larger(0.5 * goal, lowest), 1.0 / (double)s->order);
        needed = needed < 1.5 ? 1.5 : needed > 8.0 ? 8.0 : needed;
        before = multiple;
        trust = (double)s->order;
        multiple = (ptrdiff_t)ceil((double)multiple * needed);
        { double *swap = s->coarse; s->coarse = s->fine; s->fine = swap; }
    }
    return status;
}

#endif
