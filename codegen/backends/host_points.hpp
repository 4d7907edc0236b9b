
/* The kernels of points.cuh for a program on the host. */

extern "C" {

extern const int tmc_n_rows;
const int tmc_n_rows = NAME::N_ROWS;

void device_points(int level, unsigned blocks, unsigned threads, long long n, const double *x_kn, const double *p_k,
                   const double *factor_kc, long long n_cells, const int *cell_n, double *psi_n, double *g_kn,
                   double *h_kn) {
  NAME::parameters p = {};
  for (int k = 0; k < NAME::N_UNIFORM + NAME::N_VARYING; ++k) p.value[k] = p_k[k];
  launch_on_host(blocks, threads, [=] {
    if (level == 0)
      NAME::NAME_energy(n, x_kn, p, factor_kc, n_cells, cell_n, psi_n);
    else if (level == 1)
      NAME::NAME_gradient(n, x_kn, p, factor_kc, n_cells, cell_n, psi_n, g_kn);
    else
      NAME::NAME_tangent(n, x_kn, p, factor_kc, n_cells, cell_n, psi_n, g_kn, h_kn);
  });
}
}
