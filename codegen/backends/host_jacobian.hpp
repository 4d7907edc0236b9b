
extern "C" void device_jacobian(unsigned blocks, unsigned threads, long long n, const double *x_kn, double *J_n) {
  launch_on_host(blocks, threads, [=] { NAME::NAME_jacobian(n, x_kn, J_n); });
}
