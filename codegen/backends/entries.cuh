/* ---- What a function of a point reads and writes ----
 * Entries of a point are ``apart`` from each other: 1 in an array of its own, the number of points where the point is the
 * fastest index, so that threads side by side read side by side.
 */

struct readable {
  const double *first;
  long long apart;
  __device__ __forceinline__ double operator[](int k) const { return first[k * apart]; }
};

struct writable {
  double *first;
  long long apart;
  __device__ __forceinline__ double &operator[](int k) const { return first[k * apart]; }
};

struct parameters {
  double value[N_UNIFORM + N_VARYING > 0 ? N_UNIFORM + N_VARYING : 1];
  __device__ __forceinline__ double operator[](int k) const { return value[k]; }
};
