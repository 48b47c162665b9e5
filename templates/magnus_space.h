/* What the lanes know of u, laid out in the workspace. */
#ifndef MAGNUS_SPACE_H
#define MAGNUS_SPACE_H

static V *aligned(double *space)
{
    return (V *)(((size_t)space + sizeof(V) - 1) / sizeof(V) * sizeof(V));
}

/* Vectors that lay_out takes. */
static ptrdiff_t source_vectors(ptrdiff_t rates, ptrdiff_t terms)
{
    return rates * (3 * DIM + 7 + ORDERS) + (terms + 2) * DIM;
}

static void lay_out(const Input *u, V *space, Source *source)
{
    source->before = NULL;
    source->cosines = space;
    source->sines = source->cosines + u->rates * DIM;
    source->rate = source->sines + u->rates * DIM;
    source->rate_low = source->rate + u->rates;
    source->weights = source->rate_low + u->rates;
    source->angle = source->weights + u->rates * ORDERS;
    source->turn = source->angle + u->rates * 2;
    source->left = source->turn + u->rates * 2;
    source->age = -1;
    source->slope = source->left + DIM;
    source->series = source->slope + DIM;
    source->driven = (ptrdiff_t *)(source->series + u->terms * DIM);
    EACH(l, LANES) { source->h[l] = source->turned[l] = -1.0; }
    source->start = source->start_low = splat(0.0);
    source->width = splat(1.0);
    source->factor = splat(1.0);
    EACH(i, DIM) { source->left[i] = source->slope[i] = splat(0.0); }
    for (ptrdiff_t k = 0; k < u->rates * ORDERS; ++k) {
        source->weights[k] = splat(0.0);
    }
    for (ptrdiff_t k = 0; k < u->rates * 4; ++k) {
        source->angle[k] = splat(0.0);
    }
    for (ptrdiff_t k = 0; k < u->terms * DIM; ++k) {
        source->series[k] = splat(0.0);
    }
}

/* After set_waves of every lane: mostly few components are driven, each at few rates. */
static void find_driven(const Input *u, Source *source)
{
    for (ptrdiff_t f = 0; f < u->rates; ++f) {
        ptrdiff_t *const driven = source->driven + f * (DIM + 1);
        driven[0] = 0;
        EACH(i, DIM) {
            int some = 0;
            EACH(l, LANES) { some |= source->cosines[f * DIM + i][l] != 0 || source->sines[f * DIM + i][l] != 0; }
            if (some) {
                driven[++driven[0]] = i;
            }
        }
    }
}

static void set_waves(const Input *u, Source *source, int lane, ptrdiff_t who)
{
    for (ptrdiff_t k = 0; k < u->rates * DIM; ++k) {
        source->cosines[k][lane] = u->cosines[who * u->wave_stride + k];
        source->sines[k][lane] = u->sines[who * u->wave_stride + k];
    }
    /* Of the rates it had, a lane keeps its weights, unless they were turned a little since. */
    if ((who && u->rate_stride) || source->turned[lane] != source->h[lane]) {
        source->h[lane] = -1.0;
    }
    for (ptrdiff_t f = 0; f < u->rates; ++f) {
        source->rate[f][lane] = u->rate[who * u->rate_stride + f];
        source->rate_low[f][lane] = (u->rate[who * u->rate_stride + f] - source->rate[f][lane]) + u->rate_low[who * u->rate_stride + f];
    }
    source->factor[lane] = u->factor[who * u->factor_stride];
}

#endif
