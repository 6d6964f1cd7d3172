#!/usr/bin/env bash
# Builds raceloc and takes it through one drive: import, map, localization, figures. The drive is KITTI's 2011_09_26_0013
# when ../shared/data is there, else a synthetic one.
set -euo pipefail
cd "$(dirname "$0")/.."

run() {
  printf '\n$ %s\n' "$*"
  "$@"
}

bash apps/install_packages.sh
run cmake -G Ninja -S . -B build/demo -DRACELOC_TESTS=OFF
run cmake --build build/demo
export PATH=$PWD/build/demo/bin:$PATH

if [[ -f ../shared/data/unpack_kitti.py ]]; then
  run python3 ../shared/data/unpack_kitti.py build/data
  drive=build/data/kitti_raw/2011_09_26/2011_09_26_drive_0013_sync
  map=build/kitti13
else
  run tests/support/make_drive.py build/data/synthetic
  drive=build/data/synthetic/2020_01_01/2020_01_01_drive_0001_sync
  map=build/synthetic
fi
run raceloc-import kitti-raw $drive --decimate even -o build/survey.rawlog --truth build/truth.tum
run raceloc-import kitti-raw $drive --decimate odd -o build/race.rawlog
run raceloc-map -c ini/map.ini -o $map.rlmap build/survey.rawlog
run raceloc-live -c ini/live.ini -m $map.rlmap -i build/race.rawlog -o build/race_out.rawlog --trajectory build/race.tum
run raceloc-eval --truth build/truth.tum --estimate build/race.tum --report build/report.html

cat <<END

Now look at it:
  build/report.html                    the figures and pictures above, in a browser
  RawLogViewer build/race_out.rawlog   each scan with the estimate and what the gate believed
  SceneViewer3D $map.3Dscene           the map
END
