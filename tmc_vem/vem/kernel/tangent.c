/* ---- Tangent, and what comes with it ----
 * Products run on the derivative rows B_ra of the basis: two of first derivatives, four of second. The tangent is built
 * from its component blocks xx, xy and yy, the symmetric ones by half.
 */

/* Derivative rows of the basis of LANES cells; nothing is done if the shapes are those of the call before. */
static void tabulate(workspace *work, const tmc_batch *batch, int64_t first_cell) {
  if (!take_shapes(work, batch, first_cell)) return;
  const int n = batch->n_basis, n_q = batch->n_points, n_1 = batch->n_first, step = N_ROWS * n;
  const derivatives first = {.width = n, .n_m = n_1, .first = 1, .from_m = n, .to_m = n, .to_x = (size_t)n_1 * n};
  for (int t = 0; batch->has_potential && t < batch->n_pieces; ++t)
    differentiate(first, batch, work->scale, work->gradient + (size_t)t * batch->n_stored * n,
                  work->gradient_txma + (size_t)t * 2 * n_1 * n);
  const vec *gradient_txma = batch->has_potential ? work->gradient_txma : work->gradient;
  for (int q = 0, end; q < n_q; q = end) {
    end = piece_end(batch, q);
    const vec *C_xma = gradient_txma + (size_t)batch->piece_q[q] * 2 * n_1 * n;
    for (int x = 0; x < 2; ++x)
      product(0, 0, end - q, n, n_1, work->m_mq + q, n_q, C_xma + (size_t)x * n_1 * n, n,
              work->B_qra + (size_t)q * step + x * n, step);
  }
  if (N_ROWS > N_FIRST_ROWS) {
    const int n_lower = batch->n_lower;
    const size_t block = (size_t)n_lower * n; /* of one derivative; d1 of both components of the gradient, then d2 */
    const derivatives second = {.width = n, .n_m = n_lower, .from_m = n, .to_m = n, .to_x = 2 * block};
    for (int x = 0; x < 2; ++x)
      differentiate(second, batch, work->scale, work->second + (size_t)x * batch->n_second * n,
                    work->derivative_xma + x * block);
    for (int r = N_FIRST_ROWS; r < N_ROWS; ++r)
      product(0, 0, n_q, n, n_lower, work->m_mq, n_q, work->derivative_xma + (r - N_FIRST_ROWS) * block, n,
              work->B_qra + r * n, step);
  }
}

/* x_ri = sum_a B_ra u_ai */
static void displacement_gradient(int n_basis, const vec *B_ra, const vec *u_ai, vec *x_ri) {
  vec x[2 * N_ROWS];
#pragma GCC unroll 12
  for (int k = 0; k < 2 * N_ROWS; ++k) x[k] = (vec){0.0};
  for (int a = 0; a < n_basis; ++a)
#pragma GCC unroll 6
    for (int r = 0; r < N_ROWS; ++r) {
      x[2 * r] += B_ra[r * n_basis + a] * u_ai[2 * a];
      x[2 * r + 1] += B_ra[r * n_basis + a] * u_ai[2 * a + 1];
    }
#pragma GCC unroll 12
  for (int k = 0; k < 2 * N_ROWS; ++k) x_ri[k] = x[k];
}

static void add_forces(int n_basis, const vec *w, const vec *g_ri, const vec *B_ra, vec *R_ai) {
  vec g[2 * N_ROWS];
  for (int k = 0; k < 2 * N_ROWS; ++k) g[k] = *w * g_ri[k];
  for (int a = 0; a < n_basis; ++a) {
    vec R0 = R_ai[2 * a], R1 = R_ai[2 * a + 1];
#pragma GCC unroll 6
    for (int r = 0; r < N_ROWS; ++r) {
      R0 += g[2 * r] * B_ra[r * n_basis + a];
      R1 += g[2 * r + 1] * B_ra[r * n_basis + a];
    }
    R_ai[2 * a] = R0;
    R_ai[2 * a + 1] = R1;
  }
}

/* Scaled products w D B of one point for the blocks xx, xy and yy, ``block`` apart. */
static void material_rows(int n_basis, const vec *w, const vec *h, const vec *B_ra, vec *D_ra, size_t block) {
  static const int components[3][2] = {{0, 0}, {0, 1}, {1, 1}};
  for (int k = 0; k < 3; ++k) {
    vec D_sr[N_ROWS * N_ROWS];
    for (int s = 0; s < N_ROWS; ++s)
      for (int r = 0; r < N_ROWS; ++r)
        D_sr[s * N_ROWS + r] = *w * h[hessian_index(2 * r + components[k][0], 2 * s + components[k][1])];
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

static int64_t cells_with_tangent(const tmc_batch *batch, const double *u_ni, const double *parameters,
                                  double *energy_c, double *min_j_c, double *residual_ni,
                                  const tmc_tangents *tangents) {
  workspace work;
  if (!allocate(&work, batch, 1)) return -2;
  const int n = batch->n_basis, n_q = batch->n_points;
  const size_t block = (size_t)POINTS_AT_ONCE * N_ROWS * n;
  state at;
  vec h[N_H];
  memset(&at, 0, sizeof at); /* entries that vanish identically are never written */
  memset(h, 0, sizeof h);
  int64_t inadmissible = -1;
  double read[N_READ];

  for (int64_t c0 = 0; c0 < batch->n_cells; c0 += LANES) {
    const double *values = parameters_read(c0, batch->n_cells, parameters, batch->factor_ck, read);
    tabulate(&work, batch, c0);
    gather_nodes(batch, c0, u_ni, 2, work.u_ai);
    vec energy = {0.0}, min_j = (vec){0.0} + INFINITY;
    const const_lanes friction = friction_of(batch, c0);
    if (residual_ni) memset(work.R_ai, 0, 2 * (size_t)n * sizeof(vec));
    memset(work.K_kab, 0, 3 * (size_t)n * n * sizeof(vec));

    for (int q0 = 0; q0 < n_q; q0 += POINTS_AT_ONCE) {
      const int q_end = q0 + POINTS_AT_ONCE < n_q ? q0 + POINTS_AT_ONCE : n_q;
      for (int q = q0; q < q_end; ++q) {
        const vec *B_ra = work.B_qra + (size_t)q * N_ROWS * n, *w = work.weights + q;
        displacement_gradient(n, B_ra, work.u_ai, at.x);
        lower(&min_j, at.x);
        if (friction) clear_first((lanes)at.g, (lanes)h);
        point_tangent((const_lanes)at.x, values, (double *)&at.psi, (lanes)at.g, (lanes)h);
        if (friction && has_friction(friction + q * TMC_N_FRICTION))
          add_friction(friction + q * TMC_N_FRICTION, *batch->slip_damping, (const_lanes)at.x, (double *)&at.psi,
                       (lanes)at.g, (lanes)h);
        energy += *w * at.psi;
        if (residual_ni) add_forces(n, w, at.g, B_ra, work.R_ai);
        material_rows(n, w, h, B_ra, work.D_kqra + (size_t)(q - q0) * N_ROWS * n, block);
      }
      contract(n, (q_end - q0) * N_ROWS, work.B_qra + (size_t)q0 * N_ROWS * n, work.D_kqra, work.K_kab);
    }
    complete_symmetric_blocks(n, work.K_kab);
    store_energies(batch, c0, &energy, &min_j, energy_c, min_j_c, &inadmissible);
    if (residual_ni) add_to_nodes(batch, c0, work.R_ai, residual_ni);
    for (int v = 0; v < LANES && c0 + v < batch->n_cells; ++v) store_tangent(batch, c0 + v, v, work.K_kab, tangents);
  }
  free(work.allocated);
  return inadmissible;
}
