/** \file
 * The self-test of a device, on devices with defects. */
#include "api/self_test.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "tests/emu/emulated_machine.hpp"

namespace raceloc::gpu::test {
namespace {

/** The CPU's backend with a defect in what it gives back. */
class Faulty : public BackendBase {
 public:
  std::function<void(Deskewed&)> in_deskewed = [](Deskewed&) {};
  std::function<void(Points&)> in_grid = [](Points&) {};
  std::function<void(Covariances&)> in_covariances = [](Covariances&) {};
  std::function<void(StandingCells&)> in_standing = [](StandingCells&) {};
  std::function<void(std::vector<std::int32_t>&)> in_clusters = [](std::vector<std::int32_t>&) {};
  std::function<void(Pass&)> in_pass = [](Pass&) {};

  [[nodiscard]] Backend kind() const override { return Backend::cuda; }
  [[nodiscard]] std::string description() const override { return "faulty"; }
  Deskewed deskew(const DeskewJob& job, Deskewed into) override {
    Deskewed out = x_cpu->deskew(job, std::move(into));
    in_deskewed(out);
    return out;
  }
  Points voxelGrid(const PointsView& points, double voxel_size_m, std::size_t& dropped,
                   Points into) override {
    Points out = x_cpu->voxelGrid(points, voxel_size_m, dropped, std::move(into));
    in_grid(out);
    return out;
  }
  Covariances covariances(const PointsView& points, const CovarianceOptions& options,
                          Covariances into) override {
    Covariances out = x_cpu->covariances(points, options, std::move(into));
    in_covariances(out);
    return out;
  }
  PreparedScan prepare(const DeskewJob& job, double voxel_size_m, const CovarianceOptions& options,
                       Deskewed* full, PreparedScan into) override {
    return x_cpu->prepare(job, voxel_size_m, options, full, std::move(into));
  }
  StandingCells standingCells(const PointsView& points, const StandingOptions& options,
                              std::vector<std::uint8_t>* is_standing, StandingCells into) override {
    StandingCells out = x_cpu->standingCells(points, options, is_standing, std::move(into));
    in_standing(out);
    return out;
  }
  std::vector<std::int32_t> clusters(const PointsView& points, float radius_m,
                                     std::vector<std::int32_t> into) override {
    std::vector<std::int32_t> out = x_cpu->clusters(points, radius_m, std::move(into));
    in_clusters(out);
    return out;
  }
  std::unique_ptr<MapMirror> mirror() override { return nullptr; }
  PassRunner& passes(const PointsView& source, const CovariancesView& covariances, const VoxelTable& table,
                     const MapMirror* mirror, const MatchOptions& options) override {
    x_passes.faulty = this;
    x_passes.inner = &x_cpu->passes(source, covariances, table, mirror, options);
    return x_passes;
  }

 private:
  struct Passes : PassRunner {
    Pass run(const Transform& T) override {
      Pass pass = inner->run(T);
      faulty->in_pass(pass);
      return pass;
    }
    void freeze() override { inner->freeze(); }
    Faulty* faulty = nullptr;
    PassRunner* inner = nullptr;
  };
  std::unique_ptr<BackendBase> x_cpu = makeCpuBackend(1);
  Passes x_passes;
};

TEST(SelfTest, PassesWhatIsRight) {
  Faulty right;
  EXPECT_EQ(selfTest(right), "");
  DeviceBackend<emu::Machine> emulated(1);
  EXPECT_EQ(selfTest(emulated), "");
}

std::string verdictOn(const std::function<void(Faulty&)>& spoil) {
  Faulty faulty;
  spoil(faulty);
  return selfTest(faulty);
}

TEST(SelfTest, SeesAWrongDeskewedScan) {
  EXPECT_NE(
      verdictOn([](Faulty& f) { f.in_deskewed = [](Deskewed& d) { ++d.indices[5]; }; }).find("deskewed"),
      std::string::npos);
  EXPECT_NE(verdictOn([](Faulty& f) {
              f.in_deskewed = [](Deskewed& d) { d.points.z[7] = std::nextafter(d.points.z[7], 9.0F); };
            }).find("deskewed"),
            std::string::npos);
}

TEST(SelfTest, SeesAWrongVoxelGrid) {
  EXPECT_NE(verdictOn([](Faulty& f) { f.in_grid = [](Points& p) { p.x[7] += 1e-5F; }; }).find("voxel grid"),
            std::string::npos);
}

TEST(SelfTest, SeesWrongCovariances) {
  EXPECT_NE(verdictOn([](Faulty& f) {
              f.in_covariances = [](Covariances& C) { C.yz[100] = std::numeric_limits<float>::quiet_NaN(); };
            }).find("covariances differ"),
            std::string::npos);
  EXPECT_NE(verdictOn([](Faulty& f) {
              f.in_covariances = [](Covariances& C) { ++C.neighbours[3]; };
            }).find("neighbours"),
            std::string::npos);
}

TEST(SelfTest, SeesWrongCellsAndClusters) {
  EXPECT_NE(verdictOn([](Faulty& f) {
              f.in_standing = [](StandingCells& c) { c.highest_m.back() += 0.01F; };
            }).find("standing cells"),
            std::string::npos);
  EXPECT_NE(verdictOn([](Faulty& f) {
              f.in_clusters = [](std::vector<std::int32_t>& labels) { ++labels.front(); };
            }).find("clusters"),
            std::string::npos);
}

TEST(SelfTest, SeesTheGuessComingBack) {
  const std::string verdict = verdictOn([](Faulty& f) {
    f.in_pass = [](Pass& pass) {
      for (std::size_t k = kB; k < kB + 6; ++k) pass.sums[k] = 0;  // no gradient: converged at once
    };
  });
  EXPECT_NE(verdict.find("gives the guess back"), std::string::npos) << verdict;
}

TEST(SelfTest, SeesAWrongOrUndefinedPose) {
  const auto withGradient = [](double factor) {
    return verdictOn(
        [factor](Faulty& f) { f.in_pass = [factor](Pass& pass) { pass.sums[kHtt] *= factor; }; });
  };
  EXPECT_NE(withGradient(std::nan("")), "");
  EXPECT_NE(verdictOn([](Faulty& f) { f.in_pass = [](Pass& pass) { pass.sums[kB + 3] += 500; }; }), "");
}

}  // namespace
}  // namespace raceloc::gpu::test
