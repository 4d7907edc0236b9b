/* ---- The entry points ---- */

int64_t tmc_cells(int level, const tmc_batch *batch, const double *u_ni, const double *parameters, double *energy_c,
                  double *min_j_c, double *residual_ni, const tmc_tangents *tangents) {
  if (level >= TMC_TANGENT)
    return cells_with_tangent(batch, u_ni, parameters, energy_c, min_j_c, residual_ni, tangents);
  if (level == TMC_ENERGY) residual_ni = NULL;
  return cells_below_tangent(batch, u_ni, parameters, energy_c, min_j_c, residual_ni);
}

/* ---- The largest admissible step of cells ---- */

int64_t tmc_max_step(const tmc_batch *batch, const double *u_ni, const double *du_ni, double *step_c) {
  workspace work;
  if (!allocate(&work, batch, 0)) return -2;
  const int n_q = batch->n_points, n_1 = batch->n_first;
  vec gradients[STATES][8]; /* [x][i], i of u and of du */
  for (int64_t c0 = 0; c0 < batch->n_cells; c0 += LANES) {
    take_shapes(&work, batch, c0);
    gather_nodes(batch, c0, u_ni, 4, work.u_ai);
    gather_nodes(batch, c0, du_ni, 4, work.u_ai + 2);
    piecewise_coefficients(4, &work, batch);
    vec step = (vec){0.0} + INFINITY;
    for (int q = 0, end; q < n_q; q = end) {
      end = piece_end(batch, q);
      first_gradient(4, &work, batch, batch->piece_q[q], work.polynomials);
      for (int q0 = q, q1; q0 < end; q0 = q1) {
        q1 = states_end(end, q0);
        product(0, 0, q1 - q0, 8, n_1, first_values(&work, batch, q0), first_stride(batch), work.polynomials, 8, *gradients, 8);
        for (int p = 0; p < q1 - q0; ++p) limit(&step, gradients[p]);
      }
    }
    for (int v = 0; v < LANES && c0 + v < batch->n_cells; ++v) step_c[c0 + v] = ((double *)&step)[v];
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
