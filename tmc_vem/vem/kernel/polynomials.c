/* ---- Displacement gradients as polynomials ----
 * Where no rows of the basis are needed, the displacement gradient is made as polynomials, on each piece, by one product
 * of coefficients and degrees of freedom, and evaluated at the points of the piece. The first gradient's coefficients are
 * P_mxi, those of the second gradient's potential S_mxi and of its four derivatives V_mri.
 */

enum { STATES = 16 }; /* points evaluated at once */

/* End of the points from q on that are evaluated at once: those up to ``end`` are shared out evenly. */
static inline int states_end(int end, int q) {
  const int times = (end - q + STATES - 1) / STATES;
  return q + (end - q + times - 1) / times;
}

/* P_mxi = sum_a C_xma u_ai for ``rows`` monomials and x < n_x; n_i is 2, or 4 for two displacements side by side. */
ALWAYS_INLINE void polynomial_rows(const int rows, const int n_x, const int n_i, int n_m, int n_basis, const vec *C_xma,
                                   const vec *u_ai, vec *P_mxi) {
  vec sum[3][2][4];
#pragma GCC unroll 4
  for (int m = 0; m < rows; ++m)
#pragma GCC unroll 2
    for (int x = 0; x < n_x; ++x)
#pragma GCC unroll 4
      for (int i = 0; i < n_i; ++i) sum[m][x][i] = (vec){0.0};
  for (int a = 0; a < n_basis; ++a) {
    vec u[4];
#pragma GCC unroll 4
    for (int i = 0; i < n_i; ++i) {
      u[i] = u_ai[n_i * a + i];
      LOADED(u[i]);
    }
#pragma GCC unroll 4
    for (int m = 0; m < rows; ++m)
#pragma GCC unroll 2
      for (int x = 0; x < n_x; ++x) {
        vec C = C_xma[(x * n_m + m) * n_basis + a];
        LOADED(C);
#pragma GCC unroll 4
        for (int i = 0; i < n_i; ++i) sum[m][x][i] += C * u[i];
      }
  }
#pragma GCC unroll 4
  for (int m = 0; m < rows; ++m)
#pragma GCC unroll 2
    for (int x = 0; x < n_x; ++x)
#pragma GCC unroll 4
      for (int i = 0; i < n_i; ++i) P_mxi[(n_x * m + x) * n_i + i] = sum[m][x][i];
}

/* Coefficients [m][x][i] from degrees of freedom [a][i]. */
ALWAYS_INLINE void to_polynomials(const int n_x, const int n_i, int n_m, int n_basis, const vec *C_xma, const vec *u_ai,
                                  vec *P_mxi) {
  const int rows = MAX_TILE < 4 || n_x * n_i > 4 ? 1 : 3; /* 12 sums at most */
  int m = 0;
  for (; m + rows <= n_m; m += rows)
    polynomial_rows(rows, n_x, n_i, n_m, n_basis, C_xma + m * n_basis, u_ai, P_mxi + n_x * n_i * m);
  for (; m < n_m; ++m) polynomial_rows(1, n_x, n_i, n_m, n_basis, C_xma + m * n_basis, u_ai, P_mxi + n_x * n_i * m);
}

/* Coefficients of piecewise polynomials from degrees of freedom; nothing is done where there are none. */
ALWAYS_INLINE void piecewise_coefficients(const int n_i, const workspace *work, const tmc_batch *batch) {
  if (!is_piecewise(batch)) return;
  const int n_j = batch->n_trace;
  for (int b = 0; b < batch->n_boundary; ++b)
#pragma GCC unroll 4
    for (int i = 0; i < n_i; ++i) {
      vec sum = {0.0};
      for (int j = b * n_j; j < (b + 1) * n_j; ++j) sum += batch->trace_value_bj[j] * work->u_ai[n_i * batch->trace_bj[j] + i];
      work->coefficient_bi[n_i * b + i] = sum;
    }
  to_polynomials(1, n_i, batch->n_inside, batch->n_basis, work->gradient, work->u_ai,
                 work->coefficient_bi + n_i * batch->n_boundary);
}

/* Coefficients [m][x][i] of the first gradient on a piece; those of piecewise polynomials are there already. */
ALWAYS_INLINE void first_gradient(const int n_i, const workspace *work, const tmc_batch *batch, int piece, vec *P_mxi) {
  const int n_1 = batch->n_first, n = batch->n_basis;
  if (!is_piecewise(batch)) {
    to_polynomials(2, n_i, n_1, n, work->gradient + (size_t)piece * 2 * n_1 * n, work->u_ai, P_mxi);
    return;
  }
  const vec *slope_px = work->slope_tpx + 4 * piece, *c_bi = work->coefficient_bi;
  const int32_t *raised_p = batch->raised_tmp + (size_t)piece * n_1 * 3;
  for (int m = 0; m < n_1; ++m, raised_p += 3)
#pragma GCC unroll 4
    for (int i = 0; i < n_i; ++i) {
      const vec origin = c_bi[n_i * raised_p[0] + i];
      const vec s = c_bi[n_i * raised_p[1] + i] - origin, t = c_bi[n_i * raised_p[2] + i] - origin;
      P_mxi[2 * n_i * m + i] = slope_px[0] * s + slope_px[2] * t;
      P_mxi[2 * n_i * m + n_i + i] = slope_px[1] * s + slope_px[3] * t;
    }
}
