/** \file
 * What the filter costs: a step and a correction, a measurement in order, and one that is 0.2 s late. */
#include <cstdio>
#include <ctime>
#include <random>
#include <vector>

#include "core/statistics.h"
#include "fusion/history.h"

namespace {

using namespace raceloc;
constexpr double kSpeed_mps = 70;

/** Of this thread's CPU: what else runs here does not count. */
double cpu_us() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e6 * static_cast<double>(now.tv_sec) + 1e-3 * static_cast<double>(now.tv_nsec);
}

template <class Work>
double microseconds(const Work& work) {
  const double before = cpu_us();
  work();
  return cpu_us() - before;
}

PoseFix fixAt(const std::string& source, double x_m, std::mt19937& engine) {
  std::normal_distribution<double> normal(0, 0.05);
  const double east_m = normal(engine), north_m = normal(engine);
  return {source, {x_m + east_m, north_m}, 0.01 * Eigen::Matrix2d::Identity(), HeadingKind::body, 0, 0.003};
}

void print(const char* what, const std::vector<double>& us) {
  double sum = 0;
  for (const double t : us) sum += t;
  std::printf("%-44s mean %6.2f us, median %6.2f, p99 %6.2f, p99.9 %6.2f\n", what,
              sum / static_cast<double>(us.size()), quantile(us, 0.5), quantile(us, 0.99),
              quantile(us, 0.999));
}

}  // namespace

int main() {
  std::mt19937 engine(1);
  const CarState start = startState({0, 0}, 0, {});
  std::vector<double> step, in_order, late;

  FusionFilter filter(start, {}, {});
  for (int i = 1; i <= 20'000; ++i) {
    const std::vector<PoseFix> fixes{fixAt("scan_match", 0.01 * i * kSpeed_mps, engine)};
    step.push_back(microseconds([&] {
      filter.predict(0.01, kSpeed_mps, 0);
      (void)filter.correct(fixes);
    }));
  }
  print("predict and correct, one source", step);

  FusionHistory history({}, {}, start, {0, kSpeed_mps, 0});
  std::vector<TimedFix> delayed;
  for (int i = 1; i <= 20'000; ++i) {
    const double t = 0.01 * i;
    (void)history.add(Control{t, kSpeed_mps, 0});
    if (i % 5 == 0)
      for (const char* receiver : {"gps_left", "gps_right"}) {
        const TimedFix fix{t, fixAt(receiver, t * kSpeed_mps, engine)};
        in_order.push_back(microseconds([&] { (void)history.add(fix); }));
      }
    if (i % 10 == 0) delayed.push_back({t - 0.003, fixAt("scan_match", (t - 0.003) * kSpeed_mps, engine)});
    if (i % 10 == 0 && delayed.size() > 2) {
      const TimedFix fix = delayed[delayed.size() - 3];  // 0.2 s after it was measured
      late.push_back(microseconds([&] { (void)history.add(fix); }));
    }
  }
  print("a fix in order, three sources", in_order);
  print("a fix 0.2 s late: 20 steps, 5 decisions again", late);
}
