/* The sizes that follow from magnus_group.h, and the parts that every file of the Magnus steps needs. */
#ifndef MAGNUS_WORDS_H
#define MAGNUS_WORDS_H

#include "magnus_lanes.h"

#include "magnus_group.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT
#endif

#ifndef HALVES
#define HALVES 0 /* of skew-Hermitian matrices whole ones are kept */
#endif
#define MATRIX (PARTS * ROWS * SIZE)
#define FULL (PARTS * SIZE * SIZE)
#if COORDINATES
#define WORK DIM
#else
#define WORK MATRIX
#endif
/* Matrices of 4 KiB and multiples of it would lie in the same sets of the cache: so many vectors more keep them apart. */
#define APART (MATRIX % 64 == 0 ? 5 : 0)
#if QUATERNION
#define STATE 4
#else
#define STATE MATRIX
#endif

#include "magnus_input.h"
#include "magnus_exponent.h"
#include "magnus_move.h"
#include "magnus_space.h"

#endif
