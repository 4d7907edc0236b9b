/* Words of CUDA C++ for a compiler of plain C++: a thread is a turn of a loop. Device source can be checked with it where
 * there is no GPU; it is not for computing. */

#include <math.h>

#define __global__
#define __device__
#define __forceinline__ inline __attribute__((always_inline))

struct index_on_host {
  unsigned x, y, z;
};

inline index_on_host gridDim, blockDim, blockIdx, threadIdx;

template <class Kernel>
void launch_on_host(unsigned blocks, unsigned threads, Kernel kernel) {
  gridDim = {blocks, 1, 1};
  blockDim = {threads, 1, 1};
  for (blockIdx = {0, 0, 0}; blockIdx.x < blocks; ++blockIdx.x)
    for (threadIdx = {0, 0, 0}; threadIdx.x < threads; ++threadIdx.x) kernel();
}

