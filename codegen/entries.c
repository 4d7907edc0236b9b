/* ---- The largest admissible step ---- */

/* Smallest positive root of c0 + c1 s + c2 s^2 with c0 > 0, or infinity; stable for c2 -> 0. */
static double smallest_positive_root(double c0, double c1, double c2) {
  const double discriminant = c1 * c1 - 4.0 * c0 * c2;
  if (!(discriminant >= 0.0)) return INFINITY;
  const double q = -0.5 * (c1 - sqrt(discriminant)); /* the larger root of q^2 + c1 q + c0 c2 */
  const double p = -0.5 * (c1 + sqrt(discriminant));
  double root = INFINITY;
  if (c1 <= 0.0) { /* q has no cancellation: roots are c0 / q and q / c2 */
    if (q > 0.0) root = c0 / q;
  } else if (c2 < 0.0) { /* p has no cancellation and is negative: the positive root is p / c2 */
    root = p / c2;
  }
  return root;
}

int64_t tmc_max_step(const tmc_batch *batch, const double *u_ni, const double *du_ni, double *step_c) {
  const int n = batch->n_basis;
  workspace work;
  if (!allocate(&work, batch, 0)) return -2;
  for (int64_t c0 = 0; c0 < batch->n_cells; c0 += LANES) {
    tabulate(&work, batch, 2, c0);
    gather_nodes(batch, c0, u_ni, work.u_ai);
    gather_nodes(batch, c0, du_ni, work.du_ai);
    double step[LANES];
    for (int v = 0; v < LANES; ++v) step[v] = INFINITY;
    for (int q = 0; q < batch->n_points; ++q) {
      const vec *B_ra = work.B_qra + (size_t)q * N_ROWS * n;
      vec H_k[4], dH_k[4], J;
      displacement_gradient(2, n, B_ra, work.u_ai, H_k);
      displacement_gradient(2, n, B_ra, work.du_ai, dH_k);
      jacobians(H_k, &J);
      const_lanes H = (const_lanes)H_k, dH = (const_lanes)dH_k;
      for (int v = 0; v < LANES; ++v) {
        const double c0_v = ((double *)&J)[v];
        const double c1 =
            (1.0 + H[3][v]) * dH[0][v] - H[2][v] * dH[1][v] - H[1][v] * dH[2][v] + (1.0 + H[0][v]) * dH[3][v];
        const double c2 = dH[0][v] * dH[3][v] - dH[1][v] * dH[2][v];
        const double s = c0_v > 0.0 ? smallest_positive_root(c0_v, c1, c2) : 0.0;
        if (s < step[v]) step[v] = s;
      }
    }
    for (int v = 0; v < LANES && c0 + v < batch->n_cells; ++v) step_c[c0 + v] = step[v];
  }
  free(work.allocated);
  return -1;
}

/* ---- Positions in a matrix ---- */

int64_t tmc_positions(int64_t n_cells, int n_basis, const int32_t *nodes_ca, const int64_t *row_start_n,
                      const int32_t *row_length_n, const int32_t *column_n, const int32_t *columns,
                      int32_t *position_cab) {
  int32_t *order_b = malloc((size_t)n_basis * sizeof *order_b); /* the cell's nodes by column */
  if (!order_b) return -2;
  int64_t c = 0;
  for (int missing = 0; c < n_cells; ++c) {
    const int32_t *nodes_a = nodes_ca + c * n_basis;
    for (int a = 0; a < n_basis; ++a) {
      int b = a;
      for (; b > 0 && column_n[nodes_a[order_b[b - 1]]] > column_n[nodes_a[a]]; --b) order_b[b] = order_b[b - 1];
      order_b[b] = a;
    }
    /* rows are sorted too: one walk along each finds all columns */
    for (int a = 0; a < n_basis && !missing; ++a) {
      int64_t at = row_start_n[nodes_a[a]];
      const int64_t end = at + row_length_n[nodes_a[a]];
      int32_t *position_b = position_cab + (c * n_basis + a) * n_basis;
      for (int b = 0; b < n_basis && !missing; ++b) {
        const int32_t wanted = column_n[nodes_a[order_b[b]]];
        while (at < end && columns[at] < wanted) ++at;
        missing = at == end || columns[at] != wanted;
        position_b[order_b[b]] = (int32_t)at;
      }
    }
    if (missing) break;
  }
  free(order_b);
  return c < n_cells ? c : -1;
}

/* ---- Single states ---- */

void tmc_points(int level, int64_t n_states, const double *x_nx, const double *parameters, double *psi_n,
                double *g_nx, double *h_nk) {
  point_batch batch;
  memset(&batch, 0, sizeof batch);
  const_lanes g = (const_lanes)batch.g, h = (const_lanes)batch.h;
  for (int64_t n0 = 0; n0 < n_states; n0 += LANES) {
    const int n_lanes = n_states - n0 < LANES ? (int)(n_states - n0) : LANES;
    for (int v = 0; v < LANES; ++v) {
      const int64_t n = v < n_lanes ? n0 + v : n_states - 1;
      for (int k = 0; k < N_X; ++k) ((lanes)batch.x)[k][v] = x_nx[n * N_X + k];
    }
    evaluate_points(level, &batch, parameters);
    for (int v = 0; v < n_lanes; ++v) {
      const int64_t n = n0 + v;
      psi_n[n] = ((double *)&batch.psi)[v];
      if (level >= TMC_GRADIENT)
        for (int k = 0; k < N_X; ++k) g_nx[n * N_X + k] = g[k][v];
      if (level >= TMC_TANGENT)
        for (int k = 0; k < N_H; ++k) h_nk[n * N_H + k] = h[k][v];
    }
  }
}
