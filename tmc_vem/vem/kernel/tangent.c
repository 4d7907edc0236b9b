/* ---- Tangent, and what comes with it ----
 * Products run on the derivative rows B_ra of the basis: two of first derivatives, four of second. The tangent is built
 * from its component blocks xx, xy and yy, the symmetric ones by half.
 */

/* Rows of the basis that are made at every point. */
static inline int n_tabulated(const tmc_batch *batch) { return is_smooth_apart(batch) ? N_FIRST_ROWS : N_ROWS; }

/* Coefficients [x][m][a] of the first gradient of the basis on a piece. */
static const vec *gradient_of_basis(const workspace *work, const tmc_batch *batch, int piece) {
  const int n = batch->n_basis, n_1 = batch->n_first, n_boundary = batch->n_boundary;
  if (!is_piecewise(batch)) return work->gradient + (size_t)piece * 2 * n_1 * n;
  const vec *slope_px = work->slope_tpx + 4 * piece;
  const int32_t *raised_p = batch->raised_tmp + (size_t)piece * n_1 * 3;
  for (int m = 0; m < n_1; ++m, raised_p += 3) {
    const vec *row[3];
    for (int p = 0; p < 3; ++p)
      row[p] = raised_p[p] < n_boundary ? work->boundary_ba + (size_t)raised_p[p] * n
                                        : work->gradient + (size_t)(raised_p[p] - n_boundary) * n;
    vec *d1 = work->gradient_xma + m * n, *d2 = work->gradient_xma + (n_1 + m) * n;
    for (int a = 0; a < n; ++a) {
      const vec s = row[1][a] - row[0][a], t = row[2][a] - row[0][a];
      d1[a] = slope_px[0] * s + slope_px[2] * t;
      d2[a] = slope_px[1] * s + slope_px[3] * t;
    }
  }
  return work->gradient_xma;
}

/* Derivative rows of the basis of LANES cells; nothing is done if the shapes are those of the call before. */
static void tabulate(workspace *work, const tmc_batch *batch, int64_t first_cell) {
  if (!take_shapes(work, batch, first_cell)) return;
  const int n = batch->n_basis, n_q = batch->n_points, n_1 = batch->n_first, step = n_tabulated(batch) * n;
  for (int q = 0, end; q < n_q; q = end) {
    end = piece_end(batch, q);
    const vec *C_xma = gradient_of_basis(work, batch, batch->piece_q[q]);
    for (int x = 0; x < 2; ++x)
      product(0, 0, end - q, n, n_1, first_values(work, batch, q), first_stride(batch), C_xma + (size_t)x * n_1 * n, n,
              work->B_qra + (size_t)q * step + x * n, step);
  }
  if (N_ROWS > N_FIRST_ROWS) {
    const int n_lower = batch->n_lower;
    const size_t block = (size_t)n_lower * n; /* of one derivative; d1 of both components of the gradient, then d2 */
    const derivatives second = {.width = n, .n_m = n_lower, .from_m = n, .to_m = n, .to_x = 2 * block};
    for (int x = 0; x < 2; ++x)
      differentiate(second, batch, work->scale, work->second + (size_t)x * batch->n_second * n,
                    work->derivative_xma + x * block);
    for (int r = N_FIRST_ROWS; r < n_tabulated(batch); ++r)
      product(0, 0, n_q, n, n_lower, work->m_mq, n_q, work->derivative_xma + (r - N_FIRST_ROWS) * block, n,
              work->B_qra + r * n, step);
  }
}

/* x_ri = sum_a B_ra u_ai */
ALWAYS_INLINE void displacement_gradient(const int rows, int n_basis, const vec *B_ra, const vec *u_ai, vec *x_ri) {
  vec x[2 * N_ROWS];
#pragma GCC unroll 12
  for (int k = 0; k < 2 * rows; ++k) x[k] = (vec){0.0};
  for (int a = 0; a < n_basis; ++a)
#pragma GCC unroll 6
    for (int r = 0; r < rows; ++r) {
      x[2 * r] += B_ra[r * n_basis + a] * u_ai[2 * a];
      x[2 * r + 1] += B_ra[r * n_basis + a] * u_ai[2 * a + 1];
    }
#pragma GCC unroll 12
  for (int k = 0; k < 2 * rows; ++k) x_ri[k] = x[k];
}

ALWAYS_INLINE void add_forces(const int rows, int n_basis, const vec *w, const vec *g_ri, const vec *B_ra, vec *R_ai) {
  vec g[2 * N_ROWS];
  for (int k = 0; k < 2 * rows; ++k) g[k] = *w * g_ri[k];
  for (int a = 0; a < n_basis; ++a) {
    vec R0 = R_ai[2 * a], R1 = R_ai[2 * a + 1];
#pragma GCC unroll 6
    for (int r = 0; r < rows; ++r) {
      R0 += g[2 * r] * B_ra[r * n_basis + a];
      R1 += g[2 * r + 1] * B_ra[r * n_basis + a];
    }
    R_ai[2 * a] = R0;
    R_ai[2 * a + 1] = R1;
  }
}

/* Scaled products w D B of one point for the blocks xx, xy and yy, ``block`` apart. */
ALWAYS_INLINE void material_rows(const int rows, int n_basis, const vec *w, const vec *h, const vec *B_ra, vec *D_ra,
                                 size_t block) {
  static const int components[3][2] = {{0, 0}, {0, 1}, {1, 1}};
  for (int k = 0; k < 3; ++k) {
    vec D_sr[N_ROWS * N_ROWS];
    for (int s = 0; s < rows; ++s)
      for (int r = 0; r < rows; ++r)
        D_sr[s * rows + r] = *w * h[hessian_index(2 * r + components[k][0], 2 * s + components[k][1])];
    product(0, 0, rows, n_basis, rows, D_sr, rows, B_ra, n_basis, D_ra + k * block, n_basis);
  }
}

/* K_kab += sum_m B_ma D_kmb, m = (q, r); the blocks xx and yy are symmetric. */
static void contract(int n_basis, int n_m, const vec *B_ma, const vec *D_kmb, size_t block, vec *K_kab) {
  for (int k = 0; k < 3; ++k)
    product(k != 1, 1, n_basis, n_basis, n_m, B_ma, n_basis, D_kmb + k * block, n_basis, K_kab + (size_t)k * n_basis * n_basis, n_basis);
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

/* Have the matrix' entries of the cells in the cache when their tangents are there. */
static void fetch_entries(const tmc_batch *batch, int64_t first_cell, const tmc_tangents *to) {
  if (to->dense_caibj) return;
  const int n = batch->n_basis;
  for (int64_t c = first_cell; c < first_cell + LANES && c < batch->n_cells; ++c)
    for (int a = 0; a < n; ++a) {
      const int32_t *position_b = to->position_cab + (c * n + a) * n, below = to->row_length_n[batch->nodes_ca[c * n + a]];
      for (int b = 0; b < n; ++b) {
        __builtin_prefetch(to->values + position_b[b], 1);
        __builtin_prefetch(to->values + position_b[b] + below, 1);
      }
    }
}

static int64_t cells_with_tangent(const tmc_batch *batch, const double *u_ni, const double *parameters,
                                  double *energy_c, double *min_j_c, double *residual_ni,
                                  const tmc_tangents *tangents) {
  workspace work;
  if (!allocate(&work, batch, 1)) return -2;
  const int n = batch->n_basis, n_q = batch->n_points, apart = is_smooth_apart(batch), rows = n_tabulated(batch);
  const int at_once = apart ? SMOOTH_POINTS : POINTS_AT_ONCE;
  const size_t block = (size_t)at_once * rows * n;
  state at;
  vec h[N_H];
  memset(&at, 0, sizeof at); /* entries that vanish identically are never written */
  memset(h, 0, sizeof h);
  smooth_sums sums;
  int64_t inadmissible = -1;
  double read[N_READ];

  for (int64_t c0 = 0; c0 < batch->n_cells; c0 += LANES) {
    const double *values = parameters_read(c0, batch->n_cells, parameters, batch->factor_ck, read);
    fetch_entries(batch, c0, tangents);
    tabulate(&work, batch, c0);
    gather_nodes(batch, c0, u_ni, 2, work.u_ai);
    vec energy = {0.0}, min_j = (vec){0.0} + INFINITY;
    const const_lanes friction = friction_of(batch, c0);
    if (residual_ni) memset(work.R_ai, 0, 2 * (size_t)n * sizeof(vec));
    memset(work.K_kab, 0, 3 * (size_t)n * n * sizeof(vec));
    if (apart) smooth_begin(&work, n, &sums);

    for (int q0 = 0; q0 < n_q; q0 += at_once) {
      const int q_end = q0 + at_once < n_q ? q0 + at_once : n_q;
      for (int q = q0; q < q_end; ++q) {
        const vec *B_ra = work.B_qra + (size_t)q * rows * n, *w = work.weights + q, *m_j = work.m_mq + q;
        vec *D_ra = work.D_kqra + (size_t)(q - q0) * rows * n;
        if (apart) {
          displacement_gradient(N_FIRST_ROWS, n, B_ra, work.u_ai, at.x);
          smooth_gradient(&sums, m_j, n_q, at.x);
        } else {
          displacement_gradient(N_ROWS, n, B_ra, work.u_ai, at.x);
        }
        lower(&min_j, at.x);
        if (friction) clear_first((lanes)at.g, (lanes)h);
        point_tangent((const_lanes)at.x, values, (double *)&at.psi, (lanes)at.g, (lanes)h);
        if (friction && has_friction(friction + q * TMC_N_FRICTION))
          add_friction(friction + q * TMC_N_FRICTION, *batch->slip_damping, (const_lanes)at.x, (double *)&at.psi,
                       (lanes)at.g, (lanes)h);
        energy += *w * at.psi;
        if (apart) {
          if (residual_ni) add_forces(N_FIRST_ROWS, n, w, at.g, B_ra, work.R_ai);
          if (residual_ni) smooth_forces(&sums, w, m_j, n_q, at.g);
          material_rows(N_FIRST_ROWS, n, w, h, B_ra, D_ra, block);
          smooth_hessian(&sums, q - q0, w, m_j, n_q, h);
        } else {
          if (residual_ni) add_forces(N_ROWS, n, w, at.g, B_ra, work.R_ai);
          material_rows(N_ROWS, n, w, h, B_ra, D_ra, block);
        }
      }
      const vec *B_ma = work.B_qra + (size_t)q0 * rows * n;
      contract(n, (q_end - q0) * rows, B_ma, work.D_kqra, block, work.K_kab);
      if (apart) smooth_sum(&work, n, q_end - q0, B_ma, &sums);
    }
    if (apart) smooth_end(&work, n, residual_ni != NULL, &sums);
    complete_symmetric_blocks(n, work.K_kab);
    store_energies(batch, c0, &energy, &min_j, energy_c, min_j_c, &inadmissible);
    if (residual_ni) add_to_nodes(batch, c0, work.R_ai, residual_ni);
    for (int v = 0; v < LANES && c0 + v < batch->n_cells; ++v) store_tangent(batch, c0 + v, v, work.K_kab, tangents);
  }
  free(work.allocated);
  return inadmissible;
}
