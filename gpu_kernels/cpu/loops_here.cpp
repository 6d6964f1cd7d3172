#include "cpu/loops.hpp"

namespace raceloc::gpu {

#if defined(__x86_64__)
namespace x86_64_v2 {
extern const Loops loops;
}
namespace x86_64_v3 {
extern const Loops loops;
}
namespace x86_64_v4 {
extern const Loops loops;
}

const Loops& loopsHere() {
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512cd"))
    return x86_64_v4::loops;
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2") &&
      __builtin_cpu_supports("fma"))
    return x86_64_v3::loops;
  return x86_64_v2::loops;
}
#else
namespace plain {
extern const Loops loops;
}
const Loops& loopsHere() { return plain::loops; }
#endif

}  // namespace raceloc::gpu
