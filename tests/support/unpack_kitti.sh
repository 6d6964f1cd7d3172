#!/usr/bin/env bash
# unpack_kitti.sh SHARED_DATA OUT_DIR: the KITTI recordings below OUT_DIR, unless they are there already. Each appears whole
# or not at all, so that a test which was stopped leaves nothing to trip over.
set -euo pipefail
[[ -d $2/kitti_raw && -d $2/kitti_odom ]] && exit 0
mkdir -p "$2"
fresh=$(mktemp -d "$2/unpack_XXXXXX")
trap 'rm -rf "$fresh"' EXIT
/usr/bin/python3 "$1/unpack_kitti.py" "$fresh"
for name in kitti_raw kitti_odom; do
  [[ -d $2/$name ]] || mv "$fresh/$name" "$2/$name"
done
