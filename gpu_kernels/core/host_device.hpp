/** \file
 * The one macro: a function body that nvcc compiles for host and device, and g++ for the host. */
#pragma once

#if defined(__CUDACC__)
#define RACELOC_HD __host__ __device__ __forceinline__
#else
#define RACELOC_HD inline
#endif
