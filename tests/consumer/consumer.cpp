#include <cstdio>

#include "core/types.h"
#include "registration/gicp_options.h"

int main() {
  const raceloc::Pose T_map_body = raceloc::poseFromRpy({1, 2, 3}, 0, 0, 0.5);
  std::puts(raceloc::iniText("registration", raceloc::GicpOptions{}).c_str());
  return raceloc::yawOf(T_map_body) > 0 ? 0 : 1;
}
