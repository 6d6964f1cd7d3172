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

std::vector<const Loops*> loopsHere() {
  __builtin_cpu_init();
  std::vector<const Loops*> here;
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512cd"))
    here.push_back(&x86_64_v4::loops);
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2") &&
      __builtin_cpu_supports("fma"))
    here.push_back(&x86_64_v3::loops);
  if (__builtin_cpu_supports("sse4.2") && __builtin_cpu_supports("popcnt")) here.push_back(&x86_64_v2::loops);
  return here;
}
#else
namespace plain {
extern const Loops loops;
}
std::vector<const Loops*> loopsHere() { return {&plain::loops}; }
#endif

}  // namespace raceloc::gpu
