/* ---- Displacement gradients as polynomials ----
 * Where no rows of the basis are needed, the displacement gradient is made as polynomials, on each piece, by one product
 * of coefficients and degrees of freedom, and evaluated at the points of the piece. The first gradient's coefficients are
 * P_mxi, those of its potential, where that is stored, Q_mi; those of the second gradient's potential are S_mxi and of its
 * four derivatives V_mri.
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

/* Polynomials [m][x][i] of the first gradient on a piece; where a potential is stored, it is made in Q_mi. */
ALWAYS_INLINE void first_gradient(const int n_i, const workspace *work, const tmc_batch *batch, int piece, vec *Q_mi,
                                  vec *P_mxi) {
  const int n_1 = batch->n_first, n = batch->n_basis, n_stored = batch->n_stored;
  const vec *C = work->gradient + (size_t)piece * n_stored * n;
  if (!batch->has_potential) {
    to_polynomials(2, n_i, n_1, n, C, work->u_ai, P_mxi);
    return;
  }
  to_polynomials(1, n_i, n_stored, n, C, work->u_ai, Q_mi);
  const derivatives of = {.width = n_i, .n_m = n_1, .first = 1, .from_m = n_i, .to_m = 2 * n_i, .to_x = n_i};
  differentiate(of, batch, work->scale, Q_mi, P_mxi);
}
