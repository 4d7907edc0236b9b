/* ---- Cell driver ------------------------------------------------------------------------------------------------
 * A lane is a cell: LANES cells with equally many basis functions are worked on at once, so that nothing is padded and
 * nothing is summed across a vector. Both displacement components share one scalar basis. This file has the vectors of
 * lanes and the products of small matrices that everything else is made of, also where a lane is a side between cells.
 */

_Static_assert(DIMENSION == 2 && N_COMPONENTS == 2, "the cell driver is for fields of two components in the plane");

enum { N_F = N_COMPONENTS * N_FIRST_ROWS, N_G = N_X - N_F }; /* first and second derivatives at a point */

/* Tiles that stay in registers: 16 sums and 8 operands with 32 vector registers, else 4 sums. */
#ifdef __AVX512F__
enum { MAX_TILE = 4 };
#else
enum { MAX_TILE = 2 };
#endif

typedef double vec __attribute__((vector_size(8 * LANES), may_alias));
_Static_assert(sizeof(vec) == 8 * LANES, "it ignores vector types, which kernels are made of; set CC to gcc or clang");

typedef double (*lanes)[LANES];
typedef const double (*const_lanes)[LANES];

/* Left alone, gcc loads a factor from memory again for each of its products, and loads, not products, take the time. */
#ifdef __AVX512F__
#define LOADED(factor) __asm__("" : "+v"(factor))
#else
#define LOADED(factor) (void)(factor)
#endif

#define ALWAYS_INLINE static inline __attribute__((always_inline))

/* out_ab (+)= sum_m left_ma right_mb for one tile, whose size is known where this is inlined. */
ALWAYS_INLINE void tile_product(const int rows, const int columns, int add, int n_m, const vec *restrict left,
                                int left_m, const vec *restrict right, int right_m, vec *restrict out, int out_a) {
  vec sum[MAX_TILE][MAX_TILE];
#pragma GCC unroll 4
  for (int a = 0; a < rows; ++a)
#pragma GCC unroll 4
    for (int b = 0; b < columns; ++b) sum[a][b] = add ? out[a * out_a + b] : (vec){0.0};
  for (int m = 0; m < n_m; ++m, left += left_m, right += right_m) {
    vec r[MAX_TILE];
#pragma GCC unroll 4
    for (int b = 0; b < columns; ++b) {
      r[b] = right[b];
      LOADED(r[b]);
    }
#pragma GCC unroll 4
    for (int a = 0; a < rows; ++a) {
      vec l = left[a];
      LOADED(l);
#pragma GCC unroll 4
      for (int b = 0; b < columns; ++b) sum[a][b] += l * r[b];
    }
  }
#pragma GCC unroll 4
  for (int a = 0; a < rows; ++a)
#pragma GCC unroll 4
    for (int b = 0; b < columns; ++b) out[a * out_a + b] = sum[a][b];
}

#define TILE_ROW(rows, columns)                                                                      \
  case 8 * rows + columns:                                                                           \
    tile_product(rows, columns, add, n_m, left, left_m, right, right_m, out, out_a);                 \
    break;

static void tile(int rows, int columns, int add, int n_m, const vec *left, int left_m, const vec *right, int right_m,
                 vec *out, int out_a) {
  switch (8 * rows + columns) {
    TILE_ROW(1, 1) TILE_ROW(1, 2) TILE_ROW(2, 1) TILE_ROW(2, 2)
#ifdef __AVX512F__
    TILE_ROW(1, 3) TILE_ROW(2, 3) TILE_ROW(3, 3) TILE_ROW(3, 2) TILE_ROW(3, 1)
    TILE_ROW(1, 4) TILE_ROW(2, 4) TILE_ROW(3, 4) TILE_ROW(4, 4) TILE_ROW(4, 3) TILE_ROW(4, 2) TILE_ROW(4, 1)
#endif
  }
}

/* End of the tile that starts at ``first``; no tile of one is left where threes and fours will do. */
static inline int tile_end(int n, int first) {
  const int left = n - first;
  if (MAX_TILE > 3 && (left == 5 || left == 6 || left == 9)) return first + 3;
  return first + (left < MAX_TILE ? left : MAX_TILE);
}

/* out_ab (+)= sum_m left_ma right_mb; with ``upper`` only the tiles on and above the diagonal. */
static void product(int upper, int add, int n_a, int n_b, int n_m, const vec *left, int left_m, const vec *right,
                    int right_m, vec *out, int out_a) {
  for (int a = 0, a_end; a < n_a; a = a_end) {
    a_end = tile_end(n_a, a);
    for (int b = 0, b_end; b < n_b; b = b_end) {
      b_end = tile_end(n_b, b);
      if (!upper || b >= a)
        tile(a_end - a, b_end - b, add, n_m, left + a, left_m, right + b, right_m, out + a * out_a + b, out_a);
    }
  }
}

/* Room for ``n`` vectors from ``first`` on, aligned for them; NULL if there is none. C99 has no aligned_alloc. */
static void *allocate_vectors(size_t n, vec **first) {
  void *allocated = malloc((n + 1) * sizeof(vec));
  *first = (vec *)(((uintptr_t)allocated + sizeof(vec) - 1) / sizeof(vec) * sizeof(vec));
  return allocated;
}
