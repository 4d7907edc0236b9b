/* What a kernel of derivatives with respect to parameters exports. */

/* Number of derivative rows that the energy uses: 2 (F only) or 6 (F and G). */
extern const int tmc_n_rows;

/* Derivatives with respect to the parameters at single states, p being those of the array.
 *   x_nx   [n_states][N_X]  F - I and G, in the order of Appendix C
 *   y_nx   [n_states][N_X]  a direction of x at each state
 *   e_nk   [n_states][n_parameters]  out: d psi / d p_k
 *   r_nk   [n_states][n_parameters]  out: d (y . d psi / d x) / d p_k
 */
void tmc_by_parameters(int64_t n_states, const double *x_nx, const double *y_nx, const double *parameters,
                       double *e_nk, double *r_nk);
