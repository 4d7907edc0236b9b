/* ---- Cell driver ------------------------------------------------------------------------------------------------
 * A lane is a cell: LANES cells with equally many basis functions are worked on at once, so that nothing is padded and
 * nothing is summed across a vector. Both displacement components share one scalar basis; all products run on its
 * derivative rows B_ra, and the tangent is built from its component blocks xx, xy and yy, the symmetric ones by half.
 */

enum { N_X = 12, N_H = 78 };

/* Tiles that stay in registers: 16 sums and 8 operands with 32 vector registers, else 4 sums. */
#ifdef __AVX512F__
enum { MAX_TILE = 4 };
#else
enum { MAX_TILE = 2 };
#endif

enum { POINTS_AT_ONCE = 4 }; /* points whose products are kept in the cache before they are contracted */

typedef double vec __attribute__((vector_size(8 * LANES), may_alias));
typedef double (*lanes)[LANES];
typedef const double (*const_lanes)[LANES];

#define ALWAYS_INLINE static inline __attribute__((always_inline))

typedef struct {
  vec x[N_X], psi, g[N_X], h[N_H];
} point_batch;

/* Position of (row, column), row <= column, in the packed upper triangle of the 12 x 12 Hessian. */
static inline int packed(int row, int column) { return row * N_X - row * (row - 1) / 2 + column - row; }

static inline int hessian_index(int a, int b) { return a <= b ? packed(a, b) : packed(b, a); }

static void evaluate_points(int level, point_batch *batch, const double *parameters) {
  const_lanes x = (const_lanes)batch->x;
  double *psi = (double *)&batch->psi;
  if (level == TMC_ENERGY)
    point_energy(x, parameters, psi);
  else if (level == TMC_GRADIENT)
    point_gradient(x, parameters, psi, (lanes)batch->g);
  else
    point_tangent(x, parameters, psi, (lanes)batch->g, (lanes)batch->h);
}

/* ---- Products of small matrices, a lane each ---- */

/* out_ab (+)= sum_m left_ma right_mb for one tile, whose size is known where this is inlined. */
ALWAYS_INLINE void tile_product(const int rows, const int columns, int add, int n_m, const vec *restrict left, int left_m,
                                const vec *restrict right, int right_m, vec *restrict out, int out_a) {
  vec sum[MAX_TILE][MAX_TILE];
#pragma GCC unroll 4
  for (int a = 0; a < rows; ++a)
#pragma GCC unroll 4
    for (int b = 0; b < columns; ++b) sum[a][b] = add ? out[a * out_a + b] : (vec){0.0};
  for (int m = 0; m < n_m; ++m, left += left_m, right += right_m) {
#pragma GCC unroll 4
    for (int a = 0; a < rows; ++a)
#pragma GCC unroll 4
      for (int b = 0; b < columns; ++b) sum[a][b] += left[a] * right[b];
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

/* End of the tile that starts at ``first``: n entries are shared out evenly. */
static inline int tile_end(int n, int first) {
  const int left = n - first, tiles = (left + MAX_TILE - 1) / MAX_TILE;
  return first + (left + tiles - 1) / tiles;
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

/* ---- The projected basis of LANES cells ---- */

typedef struct {
  vec *B_qra;        /* derivative rows */
  vec *D_kqra;       /* w D B of the blocks k = xx, xy, yy for POINTS_AT_ONCE points */
  vec *K_kab;        /* the tangent's blocks */
  vec *u_ai, *du_ai, *R_ai;
  vec *w_q, *xi_qx, *inverse_h, *gradient_txma, *second_xma; /* what shapes have, if it has to be gathered */
  vec *potential_tma; /* the same, where it stands for the gradient */
  vec *derivative_xma; /* coefficients of the four second derivatives */
  vec *m_mq;         /* monomials at the points */
  vec *S_xmi, *V_rmi; /* second gradient of the displacement as polynomials: potential, derivatives */
  const vec *weights, *second, *scale; /* where the shapes have them */
  int32_t shape_v[LANES]; /* whose B_qra it is */
  int n_rows;
  void *allocated; /* all of the above that is not where the shapes have it */
} workspace;

static inline int dimension(int degree) { return degree < 0 ? 0 : (degree + 1) * (degree + 2) / 2; }

static int allocate(workspace *work, const tmc_batch *batch, int tangent) {
  const size_t n = batch->n_basis, n_q = batch->n_points, n_1 = dimension(batch->gradient_degree);
  const size_t n_2 = dimension(batch->second_degree), blocks = tangent ? 3 : 0;
  const size_t n_potential = dimension(batch->gradient_degree + 1) - 1;
  const size_t sizes[] = {n_q * N_ROWS * n, blocks * POINTS_AT_ONCE * N_ROWS * n, blocks * n * n, 2 * n, 2 * n, 2 * n, n_q,
                          2 * n_q, 1, 2 * n_1 * n * batch->n_pieces, 2 * n_2 * n, 4 * n_2 * n, (n_1 + n_2) * n_q,
                          4 * n_2, 8 * n_2, batch->has_potential ? batch->n_pieces * n_potential * n : 0};
  vec **parts[] = {&work->B_qra, &work->D_kqra, &work->K_kab, &work->u_ai, &work->du_ai, &work->R_ai, &work->w_q,
                   &work->xi_qx, &work->inverse_h, &work->gradient_txma, &work->second_xma, &work->derivative_xma,
                   &work->m_mq, &work->S_xmi, &work->V_rmi, &work->potential_tma};
  size_t total = 0;
  for (size_t p = 0; p < sizeof sizes / sizeof *sizes; ++p) total += sizes[p];
  work->allocated = malloc((total + 1) * sizeof(vec));
  if (!work->allocated) return 0;
  vec *next = (vec *)(((uintptr_t)work->allocated + sizeof(vec) - 1) / sizeof(vec) * sizeof(vec));
  for (size_t p = 0; p < sizeof sizes / sizeof *sizes; next += sizes[p++]) *parts[p] = next;
  work->n_rows = 0;
  return 1;
}

/* ``n`` values of each of LANES shapes: where they are if the shapes are one aligned pack, else gathered. */
static const vec *of_shapes(const double *values_sp, size_t n, const int32_t *shape_v, vec *gathered) {
  int one_pack = shape_v[0] % LANES == 0;
  for (int v = 1; v < LANES; ++v) one_pack &= shape_v[v] == shape_v[0] + v;
  const double *pack = values_sp + (size_t)shape_v[0] * n;
  if (one_pack && (uintptr_t)pack % sizeof(vec) == 0) return (const vec *)pack;
  for (int v = 0; v < LANES; ++v) {
    const double *from = values_sp + (size_t)(shape_v[v] / LANES) * n * LANES + shape_v[v] % LANES;
    for (size_t i = 0; i < n; ++i) ((lanes)gathered)[i][v] = from[i * LANES];
  }
  return gathered;
}

/* Coefficients gradient_txma of LANES shapes, from their potential if they have one. */
static const vec *gradient_of(workspace *work, const tmc_batch *batch, const int32_t *shape_v) {
  const int degree = batch->gradient_degree, n = batch->n_basis, n_1 = dimension(degree);
  const int n_stored = batch->has_potential ? dimension(degree + 1) - 1 : 2 * n_1;
  const vec *from = of_shapes(batch->gradient_sptxma, (size_t)batch->n_pieces * n_stored * n, shape_v,
                              batch->has_potential ? work->potential_tma : work->gradient_txma);
  if (!batch->has_potential) return from;
  const vec *inverse_h = of_shapes(batch->inverse_h_sp, 1, shape_v, work->inverse_h);
  vec *to = work->gradient_txma;
  for (int t = 0; t < batch->n_pieces; ++t, to += 2 * (size_t)n_1 * n)
    for (int d = 0, m = 0; d <= degree; ++d, from += n) /* from stands at xi^(d + 1 - b) eta^b */
      for (int b = 0; b <= d; ++b, ++m, from += n) {
        const vec by_xi = *inverse_h * (double)(d + 1 - b), by_eta = *inverse_h * (double)(b + 1);
        vec *d1 = to + (size_t)m * n, *d2 = to + (size_t)(n_1 + m) * n;
        for (int a = 0; a < n; ++a) {
          d1[a] = by_xi * from[a];
          d2[a] = by_eta * from[n + a];
        }
      }
  return work->gradient_txma;
}

/* Monomials xi^a eta^b up to a degree, by degree, then by b. */
static void monomials(int degree, int n_points, const vec *xi_qx, vec *m_mq) {
  for (int q = 0; q < n_points; ++q) m_mq[q] = (vec){0.0} + 1.0;
  for (int d = 1; d <= degree; ++d) {
    const vec *lower = m_mq + dimension(d - 2) * n_points;
    vec *upper = m_mq + dimension(d - 1) * n_points;
    for (int b = 0; b <= d; ++b)
      for (int q = 0; q < n_points; ++q)
        upper[b * n_points + q] =
            b < d ? lower[b * n_points + q] * xi_qx[2 * q] : lower[(b - 1) * n_points + q] * xi_qx[2 * q + 1];
  }
}

/* Coefficients of d1 of both components of the gradient, then of d2: [4][dimension(degree - 1)][n_basis]. */
static void differentiate(int degree, int n_basis, const vec *inverse_h, const vec *second_xma, vec *derivative_xma) {
  const int n_m = dimension(degree), n_lower = dimension(degree - 1);
  for (int x = 0; x < 2; ++x)
    for (int d = 0, m = 0; d < degree; ++d)
      for (int b = 0; b <= d; ++b, ++m) {
        const vec by_xi = *inverse_h * (double)(d - b + 1), by_eta = *inverse_h * (double)(b + 1);
        const vec *from = second_xma + ((size_t)x * n_m + dimension(d) + b) * n_basis;
        vec *d1 = derivative_xma + ((size_t)x * n_lower + m) * n_basis;
        vec *d2 = derivative_xma + ((size_t)(x + 2) * n_lower + m) * n_basis;
        for (int a = 0; a < n_basis; ++a) {
          d1[a] = by_xi * from[a];
          d2[a] = by_eta * from[n_basis + a];
        }
      }
}

/* Derivative rows of the basis of LANES cells; nothing is done if the shapes are those of the call before. */
static void tabulate(workspace *work, const tmc_batch *batch, int n_rows, int64_t first_cell) {
  int32_t shape_v[LANES];
  for (int v = 0; v < LANES; ++v) {
    const int64_t c = first_cell + v;
    shape_v[v] = batch->shape_c[c < batch->n_cells ? c : batch->n_cells - 1]; /* lanes past the end repeat the last */
  }
  if (work->n_rows == n_rows && memcmp(shape_v, work->shape_v, sizeof shape_v) == 0) return;
  memcpy(work->shape_v, shape_v, sizeof shape_v);
  work->n_rows = n_rows;

  const int n = batch->n_basis, n_q = batch->n_points, n_1 = dimension(batch->gradient_degree), step = N_ROWS * n;
  const vec *xi_qx = of_shapes(batch->xi_spqx, 2 * (size_t)n_q, shape_v, work->xi_qx);
  const vec *gradient_txma = gradient_of(work, batch, shape_v);
  work->weights = of_shapes(batch->w_spq, (size_t)n_q, shape_v, work->w_q);
  const int second_degree = N_ROWS > 2 ? batch->second_degree : 0;
  const int degree = second_degree - 1 > batch->gradient_degree ? second_degree - 1 : batch->gradient_degree;
  monomials(degree, n_q, xi_qx, work->m_mq);
  for (int q = 0, end; q < n_q; q = end) {
    const int piece = batch->piece_q[q];
    for (end = q + 1; end < n_q && batch->piece_q[end] == piece;) ++end;
    for (int x = 0; x < 2; ++x)
      product(0, 0, end - q, n, n_1, work->m_mq + q, n_q, gradient_txma + ((size_t)piece * 2 + x) * n_1 * n, n,
              work->B_qra + (size_t)q * step + x * n, step);
  }
  if (N_ROWS > 2) {
    work->second = of_shapes(batch->second_spxma, 2 * (size_t)dimension(second_degree) * n, shape_v, work->second_xma);
    work->scale = of_shapes(batch->inverse_h_sp, 1, shape_v, work->inverse_h);
  }
  if (n_rows > 2) {
    const int n_lower = dimension(second_degree - 1);
    differentiate(second_degree, n, work->scale, work->second, work->derivative_xma);
    for (int r = 2; r < n_rows; ++r)
      product(0, 0, n_q, n, n_lower, work->m_mq, n_q, work->derivative_xma + (size_t)(r - 2) * n_lower * n, n,
              work->B_qra + r * n, step);
  }
}

/* Polynomials V_rmi of the second gradient of the displacement, for levels that need no rows of the basis. */
static void second_gradient_polynomials(const tmc_batch *batch, workspace *work) {
  const int n = batch->n_basis;
  for (int m = 0; m < 2 * dimension(batch->second_degree); ++m) {
    vec S0 = {0.0}, S1 = {0.0};
    for (int a = 0; a < n; ++a) {
      S0 += work->second[m * n + a] * work->u_ai[2 * a];
      S1 += work->second[m * n + a] * work->u_ai[2 * a + 1];
    }
    work->S_xmi[2 * m] = S0;
    work->S_xmi[2 * m + 1] = S1;
  }
  differentiate(batch->second_degree, 2, work->scale, work->S_xmi, work->V_rmi);
}

/* x_ri = sum_m m(q) V_rmi for the four second derivatives. */
static void second_gradient(const tmc_batch *batch, const workspace *work, int q, vec *x_ri) {
  const int n_lower = dimension(batch->second_degree - 1);
  for (int r = 0; r < 4; ++r) {
    vec x0 = {0.0}, x1 = {0.0};
    for (int m = 0; m < n_lower; ++m) {
      x0 += work->m_mq[m * batch->n_points + q] * work->V_rmi[2 * (r * n_lower + m)];
      x1 += work->m_mq[m * batch->n_points + q] * work->V_rmi[2 * (r * n_lower + m) + 1];
    }
    x_ri[2 * r] = x0;
    x_ri[2 * r + 1] = x1;
  }
}

/* Degrees of freedom without the translation of the cell's first node: it has no gradient, and a stiff body that moves far
 * would get forces from rounding by it. */
static void gather_nodes(const tmc_batch *batch, int64_t first_cell, const double *u_ni, vec *u_ai) {
  for (int v = 0; v < LANES; ++v) {
    const int64_t c = first_cell + v < batch->n_cells ? first_cell + v : batch->n_cells - 1;
    const int32_t *nodes_a = batch->nodes_ca + c * batch->n_basis;
    const double *first_i = u_ni + 2 * (int64_t)nodes_a[0];
    for (int a = 0; a < batch->n_basis; ++a)
      for (int i = 0; i < 2; ++i) {
        const double translation = a < batch->n_translated ? first_i[i] : 0.0;
        ((lanes)u_ai)[2 * a + i][v] = u_ni[2 * (int64_t)nodes_a[a] + i] - translation;
      }
  }
}

/* x_ri = sum_a B_ra u_ai */
ALWAYS_INLINE void displacement_gradient(const int n_rows, int n_basis, const vec *B_ra, const vec *u_ai, vec *x_ri) {
  vec x[2 * N_ROWS];
#pragma GCC unroll 12
  for (int k = 0; k < 2 * n_rows; ++k) x[k] = (vec){0.0};
  for (int a = 0; a < n_basis; ++a)
#pragma GCC unroll 6
    for (int r = 0; r < n_rows; ++r) {
      x[2 * r] += B_ra[r * n_basis + a] * u_ai[2 * a];
      x[2 * r + 1] += B_ra[r * n_basis + a] * u_ai[2 * a + 1];
    }
#pragma GCC unroll 12
  for (int k = 0; k < 2 * n_rows; ++k) x_ri[k] = x[k];
}

static void jacobians(const vec *x, vec *J) {
  const_lanes H = (const_lanes)x;
  for (int v = 0; v < LANES; ++v) ((double *)J)[v] = jacobian(H[0][v], H[1][v], H[2][v], H[3][v]);
}

/* ---- Residual and tangent ---- */

ALWAYS_INLINE void add_forces(const int n_rows, int n_basis, const vec *w, const point_batch *batch, const vec *B_ra,
                              vec *R_ai) {
  vec g[2 * N_ROWS];
  for (int k = 0; k < 2 * n_rows; ++k) g[k] = *w * batch->g[k];
  for (int a = 0; a < n_basis; ++a) {
    vec R0 = R_ai[2 * a], R1 = R_ai[2 * a + 1];
#pragma GCC unroll 6
    for (int r = 0; r < n_rows; ++r) {
      R0 += g[2 * r] * B_ra[r * n_basis + a];
      R1 += g[2 * r + 1] * B_ra[r * n_basis + a];
    }
    R_ai[2 * a] = R0;
    R_ai[2 * a + 1] = R1;
  }
}

/* T_rmi += w m(q) g_ri for the four second derivatives: forces on the polynomials V_rmi. */
static void add_second_forces(const tmc_batch *batch, const workspace *work, int q, const point_batch *points, vec *T_rmi) {
  const int n_lower = dimension(batch->second_degree - 1);
  for (int r = 0; r < 4; ++r)
    for (int m = 0; m < n_lower; ++m) {
      const vec weight = work->weights[q] * work->m_mq[m * batch->n_points + q];
      T_rmi[2 * (r * n_lower + m)] += weight * points->g[4 + 2 * r];
      T_rmi[2 * (r * n_lower + m) + 1] += weight * points->g[5 + 2 * r];
    }
}

/* Residual of the forces T_rmi: the transposed way back from V_rmi to u_ai. */
static void forces_to_nodes(const tmc_batch *batch, workspace *work, const vec *T_rmi) {
  const int n = batch->n_basis, n_m = dimension(batch->second_degree), n_lower = dimension(batch->second_degree - 1);
  memset(work->S_xmi, 0, 4 * (size_t)n_m * sizeof(vec));
  for (int x = 0; x < 2; ++x)
    for (int d = 0, m = 0; d < batch->second_degree; ++d)
      for (int b = 0; b <= d; ++b, ++m)
        for (int i = 0; i < 2; ++i) {
          vec *to = work->S_xmi + 2 * (x * n_m + dimension(d) + b) + i;
          to[0] += *work->scale * (double)(d - b + 1) * T_rmi[2 * (x * n_lower + m) + i];
          to[2] += *work->scale * (double)(b + 1) * T_rmi[2 * ((x + 2) * n_lower + m) + i];
        }
  for (int m = 0; m < 2 * n_m; ++m)
    for (int a = 0; a < n; ++a) {
      work->R_ai[2 * a] += work->second[m * n + a] * work->S_xmi[2 * m];
      work->R_ai[2 * a + 1] += work->second[m * n + a] * work->S_xmi[2 * m + 1];
    }
}

/* Scaled products w D B of one point for the blocks xx, xy and yy, ``block`` apart. */
static void material_rows(int n_basis, const vec *w, const point_batch *batch, const vec *B_ra, vec *D_ra, size_t block) {
  static const int components[3][2] = {{0, 0}, {0, 1}, {1, 1}};
  for (int k = 0; k < 3; ++k) {
    vec D_sr[N_ROWS * N_ROWS];
    for (int s = 0; s < N_ROWS; ++s)
      for (int r = 0; r < N_ROWS; ++r)
        D_sr[s * N_ROWS + r] = *w * batch->h[hessian_index(2 * r + components[k][0], 2 * s + components[k][1])];
    product(0, 0, N_ROWS, n_basis, N_ROWS, D_sr, N_ROWS, B_ra, n_basis, D_ra + k * block, n_basis);
  }
}

/* K_kab += sum_m B_ma D_kmb, m = (q, r); the blocks xx and yy are symmetric. */
static void contract(int n_basis, int n_m, const vec *B_ma, const vec *D_kmb, vec *K_kab) {
  for (int k = 0; k < 3; ++k)
    product(k != 1, 1, n_basis, n_basis, n_m, B_ma, n_basis, D_kmb + (size_t)k * POINTS_AT_ONCE * N_ROWS * n_basis,
            n_basis, K_kab + (size_t)k * n_basis * n_basis, n_basis);
}

static void complete_symmetric_blocks(int n, vec *K_kab) {
  for (int k = 0; k < 3; k += 2)
    for (int a = 1; a < n; ++a)
      for (int b = 0; b < a; ++b) K_kab[(k * n + a) * n + b] = K_kab[(k * n + b) * n + a];
}

static void store_tangent(const tmc_batch *batch, int64_t c, int lane, const vec *K_kab, const tmc_tangents *to) {
  const int n = batch->n_basis;
  const_lanes xx = (const_lanes)K_kab, xy = xx + n * n, yy = xy + n * n;
  if (to->dense_caibj) {
    double *K_aibj = to->dense_caibj + c * 4 * n * n;
    for (int a = 0; a < n; ++a)
      for (int b = 0; b < n; ++b) {
        double *entry = K_aibj + 4 * a * n + 2 * b;
        entry[0] = xx[a * n + b][lane];
        entry[1] = xy[a * n + b][lane];
        entry[2 * n] = xy[b * n + a][lane];
        entry[2 * n + 1] = yy[a * n + b][lane];
      }
    return;
  }
  const int32_t *nodes_a = batch->nodes_ca + c * n;
  for (int a = 0; a < n; ++a) {
    const int32_t *position_b = to->position_cab + (c * n + a) * n, below = to->row_length_n[nodes_a[a]];
    for (int b = 0; b < n; ++b) {
      double *entry = to->values + position_b[b];
      entry[0] += xx[a * n + b][lane];
      entry[1] += xy[a * n + b][lane];
      entry[below] += xy[b * n + a][lane];
      entry[below + 1] += yy[a * n + b][lane];
    }
  }
}

int64_t tmc_cells(int level, const tmc_batch *batch, const double *u_ni, const double *parameters, double *energy_c,
                  double *min_j_c, double *residual_ni, const tmc_tangents *tangents) {
  const int n = batch->n_basis, n_q = batch->n_points;
  /* Below the tangent, the second gradient comes from polynomials of the displacement instead of rows of the basis, unless
   * cells share a shape, whose rows are made once. */
  const int64_t beyond = batch->n_cells > LANES ? LANES : batch->n_cells - 1;
  const int shared = beyond > 0 && batch->shape_c[0] == batch->shape_c[beyond];
  const int rows = level >= TMC_TANGENT || shared ? N_ROWS : 2;
  workspace work;
  if (!allocate(&work, batch, level >= TMC_TANGENT)) return -2;
  point_batch points;
  memset(&points, 0, sizeof points); /* entries that vanish identically are never written */
  const size_t n_second = dimension(batch->second_degree);
  vec *T_rmi = work.derivative_xma; /* not in use then: 4 n_second n_basis, and n_basis is at least 2 */
  const size_t block = (size_t)POINTS_AT_ONCE * N_ROWS * n;
  int64_t inadmissible = -1;

  for (int64_t c0 = 0; c0 < batch->n_cells; c0 += LANES) {
    tabulate(&work, batch, rows, c0);
    gather_nodes(batch, c0, u_ni, work.u_ai);
    if (rows < N_ROWS) second_gradient_polynomials(batch, &work);
    if (residual_ni && rows < N_ROWS) memset(T_rmi, 0, 8 * n_second * sizeof(vec));
    vec energy = {0.0}, min_j = (vec){0.0} + INFINITY;
    if (residual_ni) memset(work.R_ai, 0, 2 * (size_t)n * sizeof(vec));
    if (level >= TMC_TANGENT) memset(work.K_kab, 0, 3 * (size_t)n * n * sizeof(vec));

    for (int q0 = 0; q0 < n_q; q0 += POINTS_AT_ONCE) {
      const int q_end = q0 + POINTS_AT_ONCE < n_q ? q0 + POINTS_AT_ONCE : n_q;
      for (int q = q0; q < q_end; ++q) {
        const vec *B_ra = work.B_qra + (size_t)q * N_ROWS * n, *w = work.weights + q;
        if (rows == N_ROWS)
          displacement_gradient(N_ROWS, n, B_ra, work.u_ai, points.x);
        else {
          displacement_gradient(2, n, B_ra, work.u_ai, points.x);
          second_gradient(batch, &work, q, points.x + 4);
        }
        vec J;
        jacobians(points.x, &J);
        for (int v = 0; v < LANES; ++v) {
          const double before = ((double *)&min_j)[v], here = ((double *)&J)[v];
          if (!(here >= before) && before == before) ((double *)&min_j)[v] = here; /* a NaN is taken over and stays */
        }
        evaluate_points(level, &points, parameters);
        energy += *w * points.psi;
        if (residual_ni && rows == N_ROWS) add_forces(N_ROWS, n, w, &points, B_ra, work.R_ai);
        if (residual_ni && rows < N_ROWS) {
          add_forces(2, n, w, &points, B_ra, work.R_ai);
          add_second_forces(batch, &work, q, &points, T_rmi);
        }
        if (level >= TMC_TANGENT)
          material_rows(n, w, &points, B_ra, work.D_kqra + (size_t)(q - q0) * N_ROWS * n, block);
      }
      if (level >= TMC_TANGENT)
        contract(n, (q_end - q0) * N_ROWS, work.B_qra + (size_t)q0 * N_ROWS * n, work.D_kqra, work.K_kab);
    }
    if (residual_ni && rows < N_ROWS) forces_to_nodes(batch, &work, T_rmi);
    if (level >= TMC_TANGENT) complete_symmetric_blocks(n, work.K_kab);
    for (int v = 0; v < LANES && c0 + v < batch->n_cells; ++v) {
      const int64_t c = c0 + v;
      energy_c[c] = ((double *)&energy)[v];
      min_j_c[c] = ((double *)&min_j)[v];
      if (inadmissible < 0 && !(min_j_c[c] > 0.0)) inadmissible = c;
      if (residual_ni)
        for (int a = 0; a < n; ++a)
          for (int i = 0; i < 2; ++i)
            residual_ni[2 * (int64_t)batch->nodes_ca[c * n + a] + i] += ((lanes)work.R_ai)[2 * a + i][v];
      if (level >= TMC_TANGENT) store_tangent(batch, c, v, work.K_kab, tangents);
    }
  }
  free(work.allocated);
  return inadmissible;
}
