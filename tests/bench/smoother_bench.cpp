/** \file
 * Pose graphs, batch and incremental: `smoother_bench [GRAPH.g2o ...]`, without names the public ones. CPU time of
 * the process, because the machine may be busy. `gtsam_smoother.py` prints the same of GTSAM. */
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <random>
#include <string>
#include <vector>

#include "graph/g2o_file.h"
#include "graph/smoother.h"

namespace {

using namespace raceloc;

double cpu_ms() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

double quantile(std::vector<double> values, double share) {
  const auto at = static_cast<std::size_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(at), values.end());
  return values[at];
}

double sum(const std::vector<double>& values, std::size_t from, std::size_t to) {
  double total = 0;
  for (std::size_t i = from; i < to; ++i) total += values[i];
  return total;
}

void batch(const std::string& path) {
  const PoseGraph graph = readG2o(path);
  std::vector<double> ms;
  OptimiseResult result{};
  for (int k = 0; k < 5; ++k) {
    PoseGraph copy = graph;
    const double start_ms = cpu_ms();
    result = optimise(copy, {100, 1e-6});
    ms.push_back(cpu_ms() - start_ms);
  }
  std::printf("batch %s: chi2 %.6g -> %.6g in %d iterations, median %.0f ms\n", path.c_str(),
              2 * result.initial_cost, 2 * result.final_cost, result.iterations, quantile(ms, 0.5));
}

/** One update a pose, with all its edges to poses before. \return CPU time of each [ms] */
std::vector<double> replay(const PoseGraph& graph, Smoother& smoother) {
  std::vector<std::vector<Factor>> factors_at(graph.T_map_body.size());
  for (const Factor& factor : graph.factors) {
    const std::size_t j = secondKey(factor);
    factors_at[j == kNoPose ? firstKey(factor) : std::max(firstKey(factor), j)].push_back(factor);
  }
  std::vector<double> ms;
  for (std::size_t i = 0; i < graph.T_map_body.size(); ++i) {
    Pose guess = graph.T_map_body[i];
    for (const Factor& factor : factors_at[i])
      if (const auto* edge = std::get_if<BetweenFactor>(&factor); edge && edge->j == i && edge->i + 1 == i)
        guess = smoother.graph().T_map_body[edge->i] * edge->T_i_j;
    const double start_ms = cpu_ms();
    smoother.update({guess}, factors_at[i]);
    ms.push_back(cpu_ms() - start_ms);
  }
  return ms;
}

void incremental(const std::string& path) {
  const PoseGraph graph = readG2o(path);
  Smoother smoother({}, graph.held);
  const auto ms = replay(graph, smoother);
  const double chi2 = chiSquareOf(smoother.graph());
  const double start_ms = cpu_ms();
  smoother.finish({100, 1e-6});
  std::printf(
      "incremental %s: %.2f s, median %.2f ms, p99 %.1f, max %.1f, %d renewals, chi2 %.6g; finish %.0f ms, "
      "chi2 %.6g\n",
      path.c_str(), sum(ms, 0, ms.size()) / 1e3, quantile(ms, 0.5), quantile(ms, 0.99), quantile(ms, 1),
      smoother.renewals(), chi2, cpu_ms() - start_ms, chiSquareOf(smoother.graph()));
}

/** Laps of 2.5 km with a key pose every 5 m, a fix every 10th; a loop to the lap before at the end of each. */
void laps(std::size_t poses, bool with_loops) {
  constexpr std::size_t kLap = 500;
  std::mt19937 engine(1);
  std::normal_distribution<double> normal;
  const auto around = [&](double sigma_rad, double sigma_m) {
    Vector6d xi;
    for (int k = 0; k < 6; ++k) xi(k) = normal(engine) * (k < 3 ? sigma_rad : sigma_m);
    return se3Exp(xi);
  };
  Matrix6d covariance = Matrix6d::Identity() * 4e-6;
  covariance.bottomRightCorner<3, 3>() = 1e-4 * Eigen::Matrix3d::Identity();
  const Matrix6d W = whiteningOf(covariance);
  PoseGraph graph;
  for (std::size_t i = 0; i < poses; ++i) {
    const double angle_rad = 2 * M_PI * static_cast<double>(i) / kLap;
    graph.T_map_body.push_back(
        poseFromRpy({400 * std::cos(angle_rad), 400 * std::sin(angle_rad), 0}, 0, 0, angle_rad + M_PI / 2));
    const Pose& T = graph.T_map_body[i];
    if (i == 0) graph.factors.emplace_back(PriorFactor{0, T, 10 * W, {}});
    if (i > 0)
      graph.factors.emplace_back(
          BetweenFactor{i - 1, i, graph.T_map_body[i - 1].inverse() * T * around(0.002, 0.01), W, {}});
    if (i % 10 == 0)
      graph.factors.emplace_back(PositionFactor{
          i,
          T.translation() + 0.05 * Eigen::Vector3d(normal(engine), normal(engine), normal(engine)),
          Eigen::Vector3d::Zero(),
          20 * Eigen::Matrix3d::Identity(),
          {RobustLoss::Kind::cauchy, 3}});
    if (with_loops && i >= kLap && i % kLap == 0)
      graph.factors.emplace_back(BetweenFactor{i - kLap,
                                               i,
                                               graph.T_map_body[i - kLap].inverse() * T * around(0.002, 0.01),
                                               W,
                                               {RobustLoss::Kind::cauchy, 3}});
  }
  Smoother smoother({});
  const auto ms = replay(graph, smoother);
  std::printf("%zu key poses %s: %d renewals, median %.3f ms, p99 %.2f, max %.0f; mean per key pose", poses,
              with_loops ? "with a loop a lap" : "without loops", smoother.renewals(), quantile(ms, 0.5),
              quantile(ms, 0.99), quantile(ms, 1));
  for (std::size_t to = 1000; to <= poses; to *= 2)
    std::printf(" %.3f (%zu-%zu)", sum(ms, to / 2, to) / static_cast<double>(to / 2), to / 2, to);
  std::printf(" %.3f (%zu-%zu)\n", sum(ms, poses / 2, poses) / static_cast<double>(poses - poses / 2),
              poses / 2, poses);
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> paths(argv + 1, argv + argc);
  if (paths.empty())
    for (const char* name : {"parking-garage.g2o", "sphere2500.txt"})
      paths.push_back(std::string(RACELOC_ROOT "/../shared/data/g2o/") + name);
  for (const auto& path : paths) batch(path);
  laps(20000, false);
  laps(20000, true);
  incremental(paths.front());
}
