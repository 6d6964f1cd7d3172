/** \file
 * A GPU that computes wrongly says nothing: it is asked again and again. */
#pragma once

#include <raceloc/gpu/context.h>

#include <limits>

namespace raceloc {

/** Repeats the self-test of a context; one that fails goes on with the CPU's kernels and says so by reason(). */
class DeviceWatch {
 public:
  /** \param every_s time of the log between two tests [s]; 0: none */
  DeviceWatch(gpu::Context& context, double every_s) : x_context(context), x_every_s(every_s) {}

  void at(double stamp_s) {
    if (x_every_s <= 0 || x_context.backend() == gpu::Backend::cpu) return;
    if (stamp_s < x_next_s) return;
    const bool first = x_next_s == std::numeric_limits<double>::lowest();  // the context has just been tested
    x_next_s = stamp_s + x_every_s;
    if (!first) (void)x_context.passesSelfTest();
  }

 private:
  gpu::Context& x_context;
  double x_every_s;
  double x_next_s = std::numeric_limits<double>::lowest();
};

}  // namespace raceloc
