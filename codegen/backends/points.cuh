/* ---- Many points ----
 * One thread a point; where there are fewer threads than points, a thread goes on with another. No thread reads what
 * another one writes, so results do not depend on how many there are.
 *   n          points
 *   x_kn       [N_X][n]        F - I and G, in the order of the arrays of a point
 *   p          parameters, by value: they are in constant memory then
 *   factor_kc  [N_VARYING][n_cells]  what multiplies those that vary; not read if there are none
 *   cell_n     [n]             the cell of a point; NULL if every point has factors of its own, n_cells being n
 *   psi_n      [n]             out
 *   g_kn       [N_X][n]        out, zero before: entries that vanish for every state are not written
 *   h_kn       [N_H][n]        out, zero before: upper triangle of the Hessian, row by row
 */

__device__ __forceinline__ long long first_point() { return blockIdx.x * (long long)blockDim.x + threadIdx.x; }

__device__ __forceinline__ long long all_threads() { return gridDim.x * (long long)blockDim.x; }

__device__ __forceinline__ readable factors(const double *factor_kc, long long n_cells, const int *cell_n,
                                            long long point) {
  return {N_VARYING == 0 ? factor_kc : factor_kc + (cell_n ? cell_n[point] : point), n_cells};
}

extern "C" __global__ void NAME_energy(
    long long n, const double *__restrict__ x_kn, parameters p, const double *__restrict__ factor_kc, long long n_cells,
    const int *__restrict__ cell_n, double *__restrict__ psi_n) {
  for (long long q = first_point(); q < n; q += all_threads())
    point_energy({x_kn + q, n}, p, factors(factor_kc, n_cells, cell_n, q), psi_n[q]);
}

extern "C" __global__ void NAME_gradient(
    long long n, const double *__restrict__ x_kn, parameters p, const double *__restrict__ factor_kc, long long n_cells,
    const int *__restrict__ cell_n, double *__restrict__ psi_n, double *__restrict__ g_kn) {
  for (long long q = first_point(); q < n; q += all_threads())
    point_gradient({x_kn + q, n}, p, factors(factor_kc, n_cells, cell_n, q), psi_n[q], {g_kn + q, n});
}

extern "C" __global__ void NAME_tangent(
    long long n, const double *__restrict__ x_kn, parameters p, const double *__restrict__ factor_kc, long long n_cells,
    const int *__restrict__ cell_n, double *__restrict__ psi_n, double *__restrict__ g_kn,
    double *__restrict__ h_kn) {
  for (long long q = first_point(); q < n; q += all_threads())
    point_tangent({x_kn + q, n}, p, factors(factor_kc, n_cells, cell_n, q), psi_n[q], {g_kn + q, n}, {h_kn + q, n});
}
