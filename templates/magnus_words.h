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
/*
 * Vectors of lanes that take their steps side by side: in small algebras every bracket waits for the one before, and the processor does not see
 * as far ahead as the next step; a second vector fills the gaps.
 */
#ifndef SIDE_BY_SIDE
#define SIDE_BY_SIDE 0
#endif
#define TOGETHER (SIDE_BY_SIDE && COORDINATES && DIM <= 3 ? 2 : 1)
#define FRONT (TOGETHER * LANES)
#define MATRIX (PARTS * ROWS * SIZE)
#define FULL (PARTS * SIZE * SIZE)
#if COORDINATES
#define WORK (TOGETHER * DIM)
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
