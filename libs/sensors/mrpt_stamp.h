/** \file
 * Stamps at the border to MRPT: seconds since the epoch (UTC) against ticks of 100 ns. */
#pragma once

#include <mrpt/core/Clock.h>

#include <cmath>
#include <cstdint>

namespace raceloc {

constexpr std::int64_t kEpochTicks =
    116'444'736'000'000'000;  ///< 1970-01-01 on MRPT's clock, which starts in 1601

/** Rounded to the microsecond, so that a stamp that was read is written back unchanged. */
[[nodiscard]] inline mrpt::Clock::time_point toMrptStamp(double stamp_s) {
  return mrpt::Clock::time_point(mrpt::Clock::duration(kEpochTicks + 10 * std::llround(stamp_s * 1e6)));
}

[[nodiscard]] inline double fromMrptStamp(mrpt::Clock::time_point stamp) {
  return static_cast<double>(stamp.time_since_epoch().count() - kEpochTicks) / 1e7;
}

}  // namespace raceloc
