/*
 * LANES starts lie in one vector of doubles, as many as the processor's registers hold: wider ones cost several times as much. Other
 * compilers have one start a vector.
 */
#if defined(LIE_CODEGEN_ONE_LANE) || !defined(__GNUC__)
#define LANES 1
#elif defined(LIE_CODEGEN_LANES)
#define LANES LIE_CODEGEN_LANES
#elif defined(__AVX512F__)
#define LANES 8
#elif defined(__AVX__)
#define LANES 4
#else
#define LANES 2
#endif
#if LANES > 1
#define LANE(v, l) ((v)[l])
#define LESS(a, b) ((Mask)((a) < (b)))
#define SELECT(mask, a, b) ((V)(((mask) & (Mask)(a)) | (~(mask) & (Mask)(b))))
#define NOT(mask) (~(mask))
typedef double V __attribute__((vector_size(8 * LANES)));
typedef int64_t Mask __attribute__((vector_size(8 * LANES)));
#else
#define LANE(v, l) (*(&(v) + (l)))
#define LESS(a, b) ((a) < (b))
#define SELECT(mask, a, b) ((mask) ? (a) : (b))
#define NOT(mask) (!(mask))
typedef double V;
typedef int Mask;
#endif
