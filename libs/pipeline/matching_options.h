/** \file
 * The sections that mapping and localization have in common: one scan is prepared and matched the same way in
 * both. */
#pragma once

#include <raceloc/gpu/context.h>

#include <string>

#include "cloud/covariances.h"
#include "cloud/crop.h"
#include "core/options.h"
#include "odometry/liv_odometry.h"
#include "odometry/odometry_stream.h"
#include "registration/gicp_options.h"
#include "sensors/rawlog.h"

namespace raceloc {

/** Section [device]. */
struct DeviceOptions {
  gpu::Backend device = gpu::Backend::automatic;
  int threads = 2;
  double self_test_every_s = 10;
  void describe(OptionList& keys);
};

struct MatchingOptions {
  LogOptions log;
  DeviceOptions device;
  CropOptions crop;
  CovarianceOptions covariance;
  GicpOptions registration;
  MotionOptions motion;
  CalibrationOptions calibration;
  OdometryOptions odometry;
  LevelOptions level;

  void load(IniFile& ini);
  [[nodiscard]] std::string iniText() const;
};

/** LIV odometry as the options say. Keeps a reference to the context. */
[[nodiscard]] OdometryStream odometryStream(gpu::Context& context, const MatchingOptions& options);

}  // namespace raceloc
