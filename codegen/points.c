/* ---- Single states ---- */

void tmc_points(int level, int64_t n_states, const double *x_nx, const double *parameters, double *psi_n,
                double *g_nx, double *h_nk) {
  double x[N_X][LANES], psi[LANES], g[N_X][LANES], h[N_H][LANES];
  memset(g, 0, sizeof g); /* entries that vanish identically are never written */
  memset(h, 0, sizeof h);
  double ones[N_VARYING + 1], read[N_READ];
  for (int k = 0; k < N_VARYING; ++k) ones[k] = 1.0;
  const double *p = parameters_read(0, 1, parameters, ones, read);
  for (int64_t n0 = 0; n0 < n_states; n0 += LANES) {
    const int n_lanes = n_states - n0 < LANES ? (int)(n_states - n0) : LANES;
    for (int v = 0; v < LANES; ++v) {
      const int64_t n = v < n_lanes ? n0 + v : n_states - 1;
      for (int k = 0; k < N_X; ++k) x[k][v] = x_nx[n * N_X + k];
    }
    if (level == TMC_ENERGY)
      point_energy((const double(*)[LANES])x, p, psi);
    else if (level == TMC_GRADIENT)
      point_gradient((const double(*)[LANES])x, p, psi, g);
    else
      point_tangent((const double(*)[LANES])x, p, psi, g, h);
    for (int v = 0; v < n_lanes; ++v) {
      const int64_t n = n0 + v;
      psi_n[n] = psi[v];
      if (level >= TMC_GRADIENT)
        for (int k = 0; k < N_X; ++k) g_nx[n * N_X + k] = g[k][v];
      if (level >= TMC_TANGENT)
        for (int k = 0; k < N_H; ++k) h_nk[n * N_H + k] = h[k][v];
    }
  }
}
