/** \file
 * The one macro: a function body that nvcc compiles for host and device, and g++ for the host. It is always
 * inlined: the CPU's loops are compiled once an instruction set, and no copy of a body may be shared between
 * them. */
#pragma once

#if defined(__CUDACC__)
#define RACELOC_HD __host__ __device__ __forceinline__
#else
#define RACELOC_HD inline __attribute__((always_inline))
#endif
