#include "raceloc/gpu/deskew.h"

#include <algorithm>
#include <cfloat>
#include <utility>

#include "api/check.hpp"
#include "api/deskew_job.hpp"
#include "core/backend.hpp"

namespace raceloc::gpu {

std::vector<SweepStep> sweepSteps(const SweepView& sweep, bool timed, std::vector<SweepStep> into) {
  require(sweep.size >= 1, "number of transforms", sweep.size, ">= 1");
  require(sweep.duration_s >= 0 && std::isfinite(sweep.duration_s), "duration_s", sweep.duration_s,
          "finite and >= 0");
  const Affine* end = sweep.T_end_lidar + sweep.size;
  const Affine* first = timed && sweep.duration_s > 0 ? sweep.T_end_lidar : end - 1;
  into.clear();
  for (const Affine* T = first; T != end; ++T) {
    const Affine& next = T + 1 == end ? *T : T[1];
    SweepStep step{};
    for (std::size_t k = 0; k < kAffine; ++k) {
      require(std::isfinite((*T)[k]), "entry of a transform", (*T)[k], "finite");
      step.at[k] = (*T)[k];
      step.change[k] = next[k] - (*T)[k];
    }
    into.push_back(step);
  }
  return into;
}

DeskewJob deskewJob(const PointsView& scan_lidar, const float* time_s, const SweepView& sweep,
                    const std::vector<SweepStep>& steps, const Crop& crop) {
  requireCountable(scan_lidar.size);
  requirePositive("max_range_m", crop.max_range_m);
  for (const auto& [name, value_m] :
       {std::pair("min_range_m", crop.min_range_m), std::pair("own_car_front_m", crop.own_car_front_m),
        std::pair("own_car_rear_m", crop.own_car_rear_m),
        std::pair("own_car_half_width_m", crop.own_car_half_width_m)})
    require(value_m >= 0 && std::isfinite(value_m), name, value_m, "finite and >= 0");
  const auto squared = [](float range_m) { return std::min(range_m * range_m, FLT_MAX); };
  const auto moving_steps = static_cast<float>(steps.size() - 1);
  return {scan_lidar,
          time_s,
          steps.data(),
          steps.size(),
          moving_steps > 0 ? moving_steps / sweep.duration_s : 0.0F,
          {squared(crop.min_range_m), squared(crop.max_range_m), crop.own_car_front_m, crop.own_car_rear_m,
           crop.own_car_half_width_m}};
}

Deskewed deskew(Context& context, const PointsView& scan_lidar, const float* time_s, const SweepView& sweep,
                const Crop& crop, Deskewed into) {
  BackendBase& backend = context.implementation();
  backend.sweep_steps = sweepSteps(sweep, time_s != nullptr, std::move(backend.sweep_steps));
  return backend.deskew(deskewJob(scan_lidar, time_s, sweep, backend.sweep_steps, crop), std::move(into));
}

}  // namespace raceloc::gpu
