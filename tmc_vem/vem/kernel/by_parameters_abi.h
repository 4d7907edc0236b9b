/* Derivatives with respect to the parameters of an energy, of a batch of cells, each with respect to the value that the
 * parameter has in the cell.
 *   u_ni         [n_nodes][2]   displacement degrees of freedom
 *   adjoint_ni   [n_nodes][2]   those of an adjoint field; NULL for none
 *   parameters   [n_parameters] in the declared order
 *   energy_ck    [n_cells][n_parameters]  out: of the energy
 *   residual_ck  [n_cells][n_parameters]  out: of the product of the adjoint field and the residual (52); 0 without one
 * Friction is no part of it. Returns -1, or -2 if memory ran out.
 */
int64_t tmc_cells_by_parameters(const tmc_batch *batch, const double *u_ni, const double *adjoint_ni,
                                const double *parameters, double *energy_ck, double *residual_ck);
