/* ---- Cells ----
 * One call after the other makes energy, residual and tangent of cells; point q of cell c is number c n_points + q of the
 * points above. Every entry has one thread that adds it up, in an order that does not depend on how many there are.
 *   NAME_rows      once: rows of derivatives at the points of all shapes
 *   NAME_states    states at all points from degrees of freedom
 *   NAME_tangent   and NAME_jacobian, of all points
 *   NAME_forces    energy, smallest J and residual of every cell
 *   NAME_stiffness tangent of every cell
 */

static_assert(DIMENSION == 2 && N_COMPONENTS == 2, "these kernels are for fields of two components in the plane");

enum { TILE = 4 }; /* basis functions whose rows of the tangent are added up at once, in registers */

/* B_sqra; one thread an entry. */
extern "C" __global__ void NAME_rows(cells of, double *__restrict__ B_sqra) {
  const int n_basis = of.n_basis;
  const long long at_point = N_ROWS * n_basis, at_shape = of.n_points * at_point;
  for (long long n = first_point(); n < of.n_shapes * at_shape; n += all_threads()) {
    const long long s = n / at_shape;
    const int q = (int)(n % at_shape / at_point), r = (int)(n % at_point) / n_basis, a = (int)(n % n_basis);
    const bool first = r < N_FIRST_ROWS;
    const int n_m = first ? of.n_first : of.n_lower;
    const long long row = first ? (s * of.n_pieces + of.piece_q[q]) * N_FIRST_ROWS + r
                                : s * (N_ROWS - N_FIRST_ROWS) + r - N_FIRST_ROWS;
    const double *C_ma = (first ? of.first_strma : of.second_srma) + row * n_m * n_basis;
    const double *value_m = (first ? of.first_sqm : of.second_sqm) + (s * of.n_points + q) * n_m;
    double sum = 0.0;
    for (int m = 0; m < n_m; ++m) sum += value_m[m] * C_ma[m * n_basis + a];
    B_sqra[n] = sum;
  }
}

__device__ __forceinline__ const double *rows_of(const cells &of, const double *B_sqra, long long c) {
  return B_sqra + (long long)of.shape_c[c] * of.n_points * N_ROWS * of.n_basis;
}

/* x_kn and the cell of every point; one thread a point. The translation of a cell's first node is taken out. */
extern "C" __global__ void NAME_states(cells of, const double *__restrict__ B_sqra, const double *__restrict__ u_ni,
                                       double *__restrict__ x_kn, int *__restrict__ cell_n) {
  const long long n_points = of.n_cells * of.n_points;
  for (long long n = first_point(); n < n_points; n += all_threads()) {
    const long long c = n / of.n_points;
    const double *B_ra = rows_of(of, B_sqra, c) + n % of.n_points * N_ROWS * of.n_basis;
    const int *nodes_a = of.nodes_ca + c * of.n_basis;
    double x[N_ROWS][N_COMPONENTS] = {};
    for (int a = 0; a < of.n_basis; ++a)
      for (int i = 0; i < N_COMPONENTS; ++i) {
        const double translation = a < of.n_translated ? u_ni[N_COMPONENTS * (long long)nodes_a[0] + i] : 0.0;
        const double u = u_ni[N_COMPONENTS * (long long)nodes_a[a] + i] - translation;
        for (int r = 0; r < N_ROWS; ++r) x[r][i] += B_ra[r * of.n_basis + a] * u;
      }
    const writable out = {x_kn + n, n_points};
    for (int r = 0; r < N_ROWS; ++r)
      for (int i = 0; i < N_COMPONENTS; ++i) out[N_COMPONENTS * r + i] = x[r][i];
    for (int k = N_COMPONENTS * N_ROWS; k < N_X; ++k) out[k] = 0.0;
    cell_n[n] = (int)c;
  }
}

/* energy_c, min_j_c and residual R_cai; one block a cell, one thread an entry of the residual. A NaN stays in min_j_c. */
extern "C" __global__ void NAME_forces(cells of, const double *__restrict__ B_sqra, const double *__restrict__ psi_n,
                                       const double *__restrict__ J_n, const double *__restrict__ g_kn,
                                       double *__restrict__ energy_c, double *__restrict__ min_j_c,
                                       double *__restrict__ R_cai) {
  const int n_q = of.n_points, n_basis = of.n_basis, n_ai = N_COMPONENTS * n_basis;
  for (long long c = blockIdx.x; c < of.n_cells; c += gridDim.x) {
    const double *B_qra = rows_of(of, B_sqra, c), *w_q = of.w_sq + (long long)of.shape_c[c] * n_q;
    for (int ai = threadIdx.x; ai < n_ai; ai += blockDim.x) {
      double sum = 0.0;
      for (int q = 0; q < n_q; ++q) {
        const readable g = {g_kn + c * n_q + q, of.n_cells * n_q};
        double force = 0.0;
        for (int r = 0; r < N_ROWS; ++r)
          force += B_qra[(q * N_ROWS + r) * n_basis + ai / N_COMPONENTS] * g[N_COMPONENTS * r + ai % N_COMPONENTS];
        sum += w_q[q] * force;
      }
      R_cai[c * n_ai + ai] = sum;
    }
    if (threadIdx.x == 0) {
      double energy = 0.0, least = J_n[c * n_q];
      for (int q = 0; q < n_q; ++q) {
        const double J = J_n[c * n_q + q];
        energy += w_q[q] * psi_n[c * n_q + q];
        least = !(J >= least) && least == least ? J : least;
      }
      energy_c[c] = energy;
      min_j_c[c] = least;
    }
  }
}

/* Entry of the Hessian, of which the upper triangle is kept row by row. */
__device__ __forceinline__ double hessian(readable h, int a, int b) {
  const int row = a < b ? a : b, column = a < b ? b : a;
  return h[row * N_X - row * (row - 1) / 2 + column - row];
}

/* Tangent K_caibj; one block a cell. A thread has a column (b, j) of the rows of TILE basis functions: at every point it makes
 * its column of w D B, and contracts it with theirs. */
extern "C" __global__ void NAME_stiffness(cells of, const double *__restrict__ B_sqra, const double *__restrict__ h_kn,
                                          double *__restrict__ K_caibj) {
  const int n_q = of.n_points, n_basis = of.n_basis, n_bj = N_COMPONENTS * n_basis;
  for (long long c = blockIdx.x; c < of.n_cells; c += gridDim.x) {
    const double *B_qra = rows_of(of, B_sqra, c), *w_q = of.w_sq + (long long)of.shape_c[c] * n_q;
    double *K_aibj = K_caibj + c * n_bj * n_bj;
    for (int part = threadIdx.x; part < (n_basis + TILE - 1) / TILE * n_bj; part += blockDim.x) {
      const int first = part / n_bj * TILE, bj = part % n_bj, b = bj / N_COMPONENTS, j = bj % N_COMPONENTS;
      double sum[TILE][N_COMPONENTS] = {};
      for (int q = 0; q < n_q; ++q) {
        const readable h = {h_kn + c * n_q + q, of.n_cells * n_q};
        const double *B_ra = B_qra + q * N_ROWS * n_basis;
        double D[N_ROWS][N_COMPONENTS] = {};
        for (int r = 0; r < N_ROWS; ++r) {
          const double wB = w_q[q] * B_ra[r * n_basis + b];
          for (int s = 0; s < N_ROWS; ++s)
            for (int i = 0; i < N_COMPONENTS; ++i)
              D[s][i] += hessian(h, N_COMPONENTS * s + i, N_COMPONENTS * r + j) * wB;
        }
        for (int t = 0; t < TILE; ++t) {
          const int a = first + t < n_basis ? first + t : n_basis - 1; /* beyond the last one nothing is stored */
          for (int s = 0; s < N_ROWS; ++s)
            for (int i = 0; i < N_COMPONENTS; ++i) sum[t][i] += B_ra[s * n_basis + a] * D[s][i];
        }
      }
      for (int t = 0; t < TILE && first + t < n_basis; ++t)
        for (int i = 0; i < N_COMPONENTS; ++i) K_aibj[(N_COMPONENTS * (first + t) + i) * n_bj + bj] = sum[t][i];
    }
  }
}
