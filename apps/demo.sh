#!/usr/bin/env bash
# Builds raceloc and takes a simulated car round Lucas Oil Raceway: a survey lap and a bit at 72 km/h become a map, a race lap at 100 km/h, in
# which one GPS jumps by 20 m for a while, is localized on it. Ends with the figures and where to look.
set -euo pipefail
cd "$(dirname "$0")/.."

run() {
  printf '\n$ %s\n' "$(printf '%q ' "$@")"
  "$@"
}

bash apps/install_packages.sh
run cmake -G Ninja -S . -B build/demo -DRACELOC_TESTS=OFF
run cmake --build build/demo
export PATH=$PWD/build/demo/bin:$PATH

simulate=(raceloc-sim --track share/tracks/lor.ini --car ini/sim/indy.ini --devices 'lidar_front gps_* imu vehicle')
run "${simulate[@]}" --top-speed 20 --laps 1.2 --seed 1 -o build/survey.rawlog
run "${simulate[@]}" --seed 2 --faults ini/sim/faults/gps_step_20m.ini -o build/race.rawlog
run raceloc-map -c ini/map.ini --replace -o build/lor.rlmap build/survey.rawlog
run raceloc-live -c ini/live.ini -m build/lor.rlmap -i build/race.rawlog -o build/race_out.rawlog --trajectory build/race.tum
run raceloc-eval --truth build/race_truth.tum --estimate build/race.tum --report build/report.html

cat <<END

Now look at it:
  build/report.html                    the figures and pictures above, in a browser
  RawLogViewer build/race_out.rawlog   each scan with the estimate and what the gate believed
  build/lor.html                       how good the map is, in a browser
  SceneViewer3D build/lor.3Dscene      the map
  raceloc-sim --help                   other circuits, cars and faults
END
