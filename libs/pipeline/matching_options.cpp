#include "pipeline/matching_options.h"

#include "core/labels.h"

namespace raceloc {

void DeviceOptions::describe(OptionList& keys) {
  keys.add("device", device,
           {{"auto", gpu::Backend::automatic}, {"cpu", gpu::Backend::cpu}, {"cuda", gpu::Backend::cuda}},
           "where the kernels run; auto: on a GPU if one answers");
  keys.add("threads", threads, between(1, 256), "at work on the CPU; they change no bit of a result");
  keys.add(
      "self_test_every_s", self_test_every_s, atLeast(0),
      "a GPU is compared with the CPU again after so long [s], and left if it differs; 0: only at the start");
}

void MatchingOptions::load(IniFile& ini) {
  ini.load("log", log);
  ini.load("device", device);
  ini.load("crop", crop);
  ini.load("covariance", covariance);
  ini.load("registration", registration);
  ini.load("motion", motion);
  ini.load("calibration", calibration);
  ini.load("odometry", odometry);
  ini.load("level", level);
}

std::string MatchingOptions::iniText() const {
  return raceloc::iniText("log", log) + "\n" + raceloc::iniText("device", device) + "\n" +
         raceloc::iniText("crop", crop) + "\n" + raceloc::iniText("covariance", covariance) + "\n" +
         raceloc::iniText("registration", registration) + "\n" + raceloc::iniText("motion", motion) + "\n" +
         raceloc::iniText("calibration", calibration) + "\n" + raceloc::iniText("odometry", odometry) + "\n" +
         raceloc::iniText("level", level);
}

OdometryStream odometryStream(gpu::Context& context, const MatchingOptions& o) {
  return {MotionHistory(o.motion, o.calibration),
          LivOdometry(context, o.odometry, o.crop, o.covariance, o.registration, o.level),
          ScanQueue(labelsNamed(o.log.lidar_labels))};
}

}  // namespace raceloc
