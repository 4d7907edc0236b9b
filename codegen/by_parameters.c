/* ---- Single states ---- */

enum { N_P = N_UNIFORM + N_VARYING, AT_LEAST_1 = N_P > 0 ? N_P : 1 };

void tmc_by_parameters(int64_t n_states, const double *x_nx, const double *y_nx, const double *parameters,
                       double *e_nk, double *r_nk) {
  double x[N_X][LANES], y[N_X][LANES], e[AT_LEAST_1][LANES], r[AT_LEAST_1][LANES];
  memset(e, 0, sizeof e); /* entries that vanish identically are never written */
  memset(r, 0, sizeof r);
  double ones[N_VARYING + 1], read[N_READ];
  for (int k = 0; k < N_VARYING; ++k) ones[k] = 1.0;
  const double *p = parameters_read(0, 1, parameters, ones, read);
  for (int64_t n0 = 0; n0 < n_states; n0 += LANES) {
    const int n_lanes = n_states - n0 < LANES ? (int)(n_states - n0) : LANES;
    for (int v = 0; v < LANES; ++v) {
      const int64_t n = v < n_lanes ? n0 + v : n_states - 1;
      for (int k = 0; k < N_X; ++k) {
        x[k][v] = x_nx[n * N_X + k];
        y[k][v] = y_nx[n * N_X + k];
      }
    }
    point_by_parameters((const double(*)[LANES])x, (const double(*)[LANES])y, p, e, r);
    for (int v = 0; v < n_lanes; ++v)
      for (int k = 0; k < N_P; ++k) {
        e_nk[(n0 + v) * N_P + k] = e[k][v];
        r_nk[(n0 + v) * N_P + k] = r[k][v];
      }
  }
}
