/* What drives a step: the generators a_1 .. a_4 of h u(t_middle + s h) = sum_j a_j s^(j - 1), s in [-1/2, 1/2], exactly where u is a formula. */
#ifndef MAGNUS_INPUT_H
#define MAGNUS_INPUT_H

#include "magnus_given.h"

/* What the lanes know of u; `waves` and `lines` lie in the workspace. */
typedef struct Source {
    const struct Source *before; /* the vector beside this one whose lanes come first, or NULL */
    V *cosines, *sines; /* rates x DIM */
    V *rate, *rate_low;
    V *weights;         /* rates x ORDERS: k_1 .. k_4 of w h */
    V *angle, *turn;    /* rates x 2: cos and sin of w t at the last middle; cos - 1 and sin of w h */
    ptrdiff_t age;      /* steps since the angles were taken afresh; negative: they have to be */
    V *left, *slope;    /* DIM each */
    V *series;          /* terms x DIM */
    ptrdiff_t *driven;  /* rates x (1 + DIM): of each rate how many components have a wave in some lane, and which */
    V start, start_low, width, factor; /* of the piece, its start to twice the precision */
    double h[LANES], turned[LANES]; /* of the weights, of `turn` */
} Source;

/* The halves of a Gauss-Legendre rule of 12 points on [-1/2, 1/2]. */
static const double gauss_node[6] = {0.06261670425573440, 0.18391574949909010, 0.29365897714330870, 0.38495133709715234,
    0.45205862818523740, 0.49078031712335963};
static const double gauss_weight[6] = {0.24914704581340277, 0.23349253653835481, 0.20316742672306592, 0.16007832854334623,
    0.10693932599531843, 0.04717533638651182};

/*
 * A wave p cos(w h s) + q sin(w h s), s in [-1/2, 1/2], has the generators h (k1 p, k2 q, k3 p, k4 q), exactly: its moments,
 * not values at nodes. Constants integrate to zero against s^2 - 1/12, so cos - 1 is taken for cos there.
 */
static void wave_weights(double angle, double *k)
{
    double zeroth = 0.0, first = 0.0, third = 0.0, fourth = 0.0;
    EACH(j, 6) {
        const double s = gauss_node[j], w = gauss_weight[j], half = sin(0.5 * angle * s), sine = sin(angle * s);
        zeroth += w * cos(angle * s);
        first += w * s * sine;
        third += w * (s * s - 1.0 / 12) * (-2.0 * half * half);
        fourth += w * s * (s * s - 0.15) * (sine - angle * s);
    }
    k[2] = 180 * third;
    k[3] = 2800 * fourth;
    k[0] = zeroth - k[2] / 12;
    k[1] = 12 * first - 0.15 * k[3];
}

static void set_weights(const Input *u, Source *source, int lane, double h)
{
    if (fabs(source->h[lane] - h) <= 1e-13 * h) { /* of equal spans, rounded */
        for (ptrdiff_t f = 0; f < u->rates; ++f) { /* the angle is turned many times, so it has the rest too */
            const double rest = source->rate[f][lane] * (h - source->turned[lane]), less = source->turn[2 * f][lane];
            source->turn[2 * f][lane] -= rest * source->turn[2 * f + 1][lane];
            source->turn[2 * f + 1][lane] += rest * (1.0 + less);
        }
        source->turned[lane] = h;
        return;
    }
    source->h[lane] = source->turned[lane] = h;
    const Source *const next = lane ? source : source->before;
    const int beside = (lane ? lane : LANES) - 1;
    for (ptrdiff_t f = 0; f < u->rates; ++f) {
        const double rate = source->rate[f][lane];
        double k[ORDERS], turn[2];
        /* Lanes mostly share their rates and steps; sines cost more than a step. */
        if (next && next->h[beside] == h && next->turned[beside] == h && next->rate[f][beside] == rate) {
            EACH(i, ORDERS) { k[i] = next->weights[f * ORDERS + i][beside]; }
            EACH(i, 2) { turn[i] = next->turn[2 * f + i][beside]; }
        } else {
            const double half = sin(0.5 * rate * h);
            wave_weights(rate * h, k);
            turn[0] = -2.0 * half * half;
            turn[1] = sin(rate * h);
        }
        EACH(i, ORDERS) { source->weights[f * ORDERS + i][lane] = k[i]; }
        EACH(i, 2) { source->turn[2 * f + i][lane] = turn[i]; }
    }
}

/* A lane enters a span. */
static void enter(const Input *u, const Grid *grid, Source *source, int lane, ptrdiff_t span, double h, ptrdiff_t who)
{
    set_weights(u, source, lane, h);
    source->age = -1;
    if (u->times) {
        const ptrdiff_t k = grid->piece[span];
        const double width = u->times[k + 1] - u->times[k];
        source->start[lane] = u->times[k];
        source->start_low[lane] = u->times[k] - source->start[lane]; /* what lanes of floats round off */
        source->width[lane] = width;
        if (u->terms) {
            for (ptrdiff_t i = 0; i < u->terms * DIM; ++i) {
                source->series[i][lane] = u->series[k * u->terms * DIM + i];
            }
        } else {
            const Given *left = u->left + who * u->line_stride + k * DIM, *right = u->right + who * u->line_stride + k * DIM;
            EACH(i, DIM) {
                source->left[i][lane] = left[i];
                source->slope[i][lane] = right[i] - left[i];
            }
        }
    }
}

#if TABLES
/* Tables of values at the nodes: the generators of a step of every lane, `table` pointing at each lane's own, `apart` from node to node. */
static __attribute__((noinline)) void from_nodes(const Input *u, const double *const *table, ptrdiff_t apart, V h, V (*a)[TOGETHER * DIM])
{
    for (ptrdiff_t g = 0; g < u->nodes; ++g) {
        EACH(i, DIM) {
            const ptrdiff_t at = g * apart + i;
#define THERE(l) table[l][at]
            const V value = h * (V)LANEWISE(THERE);
#undef THERE
            EACH(j, ORDERS) { a[j][i] += u->projection[j * u->nodes + g] * value; }
        }
    }
}
#endif

/* Gauss-Legendre of 5 points on [-1/2, 1/2]: exact for the first two generators of a piece of degree 8. */
static const double five_node[5] = {0.0, 0.26923465505284155, -0.26923465505284155, 0.45308992296933200, -0.45308992296933200};
static const double five_weight[5] = {0.28444444444444444, 0.23931433524968324, 0.23931433524968324, 0.11846344252809454,
    0.11846344252809454};

/* The generators of a Legendre series: those of each polynomial from its values at five nodes, times its coefficients. */
static __attribute__((noinline)) void from_series(const Input *u, const Source *source, V middle, V low, V h, V (*a)[TOGETHER * DIM])
{
    const V centre = 2.0 * (((middle - source->start) + (low - source->start_low)) / source->width) - 1.0, reach = 2.0 * h / source->width;
    V before[5], now[5], x[5];
    EACH(g, 5) {
        x[g] = centre + five_node[g] * reach;
        before[g] = splat(0.0);
        now[g] = splat(1.0);
    }
    for (ptrdiff_t k = 0; k < u->terms; ++k) {
        V zeroth = splat(0.0), first = splat(0.0), third = splat(0.0), fourth = splat(0.0);
        EACH(g, 5) {
            const double s = five_node[g];
            const V value = five_weight[g] * now[g];
            const V next = (1.0 / (double)(k + 1)) * ((double)(2 * k + 1) * x[g] * now[g] - (double)k * before[g]);
            zeroth += value;
            first += s * value;
            third += 180 * (s * s - 1.0 / 12) * value;
            fourth += 2800 * s * (s * s - 0.15) * value;
            before[g] = now[g];
            now[g] = next;
        }
        EACH(i, DIM) {
            const V c = source->factor * h * source->series[k * DIM + i];
            a[0][i] += c * (zeroth - third * (1.0 / 12));
            a[1][i] += c * (12.0 * first - 0.15 * fourth);
            a[2][i] += c * third;
            a[3][i] += c * fourth;
        }
    }
}

/* a_1 .. a_4 of a step of every lane, whose middles are middle + low. */
static inline void generators(const Input *u, Source *source, V middle, V low, V h, const double *const *table,
    V (*a)[TOGETHER * DIM])
{
    EACH(j, ORDERS) {
        EACH(i, DIM) { a[j][i] = splat(0.0); }
    }
    const V scale = source->factor * h;
    /* Angles turn by w h from step to step; what rounding adds is thrown away every AFRESH steps. */
    source->age = source->age >= 0 && source->age < AFRESH ? source->age + 1 : 0;
    for (ptrdiff_t f = 0; f < u->rates; ++f) {
        const V *k = source->weights + f * ORDERS;
        V c = source->angle[2 * f], s = source->angle[2 * f + 1];
        if (source->age) {
            const V less = source->turn[2 * f], sine = source->turn[2 * f + 1], before = c;
            c += c * less - s * sine;
            s += s * less + before * sine;
        } else {
            const V rate = source->rate[f], angle = rate * middle;
            cos_sin(angle, fused(rate, middle, -angle) + (source->rate_low[f] * middle + rate * low), &c, &s);
        }
        source->angle[2 * f] = c;
        source->angle[2 * f + 1] = s;
        const ptrdiff_t *const driven = source->driven + f * (DIM + 1);
        for (ptrdiff_t j = 1; j <= driven[0]; ++j) {
            const ptrdiff_t i = driven[j];
            const V x = source->cosines[f * DIM + i], y = source->sines[f * DIM + i];
            const V p = scale * (x * c + y * s), q = scale * (y * c - x * s);
            a[0][i] += k[0] * p;
            a[1][i] += k[1] * q;
            a[2][i] += k[2] * p;
            a[3][i] += k[3] * q;
        }
    }
    if (u->terms) {
        from_series(u, source, middle, low, h, a);
    } else if (u->times) {
        const V x = ((middle - source->start) + (low - source->start_low)) / source->width, part = h / source->width;
        EACH(i, DIM) {
            a[0][i] += scale * (source->left[i] + x * source->slope[i]);
            a[1][i] += scale * part * source->slope[i];
        }
    }
#if TABLES
    if (u->table) {
        from_nodes(u, table, DIM, scale, a);
    }
#else
    (void)table;
#endif
}

#endif
