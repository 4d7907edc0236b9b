/* ---- Parameters ----
 * A function of a point reads what is the same everywhere, and behind it, in lanes, what varies from cell to cell.
 */

enum { N_READ = N_UNIFORM + N_VARYING * LANES + 1 };

/* Parameters of LANES cells, from ``first`` on, of ``n``; factor_nk [n][N_VARYING] multiplies those that vary. */
static inline const double *parameters_read(int64_t first, int64_t n, const double *parameters, const double *factor_nk,
                                            double *read) {
  if (N_VARYING == 0) return parameters;
  memcpy(read, parameters, N_UNIFORM * sizeof(double));
  for (int v = 0; v < LANES; ++v) {
    const double *factor_k = factor_nk + (first + v < n ? first + v : n - 1) * N_VARYING;
    for (int k = 0; k < N_VARYING; ++k) read[N_UNIFORM + k * LANES + v] = parameters[N_UNIFORM + k] * factor_k[k];
  }
  return read;
}
