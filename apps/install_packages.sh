#!/usr/bin/env bash
# Installs the Debian packages that raceloc is built with; with --tests also those that its tests use.
# Does nothing, silently, when all are there.
set -euo pipefail

packages=(
  build-essential cmake ninja-build ccache                                         # the build
  libmrpt-dev libeigen3-dev libceres-dev libsuitesparse-dev libsqlite3-dev libtbb-dev libembree-dev libpcap-dev zlib1g-dev libisal-dev libopenblas0-serial nlohmann-json3-dev
  python3 python3-numpy                                                            # the drives of demo and tests
  gnuplot-nox                                                                      # pictures of raceloc-eval
  mrpt-apps                                                                        # RawLogViewer, rawlog-edit
)
if [[ ${1:-} == --tests ]]; then
  packages+=(libgtest-dev libgmock-dev clang-format clang-tidy)
elif [[ $# -gt 0 ]]; then
  echo "usage: install_packages.sh [--tests]" >&2
  exit 2
fi

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
  [[ $status == installed ]] || missing+=("$package")
done
[[ ${#missing[@]} -gt 0 ]] || exit 0

as_root=(env DEBIAN_FRONTEND=noninteractive)
[[ $(id -u) -eq 0 ]] || as_root=(sudo "${as_root[@]}")
echo "installing: ${missing[*]}"
log=$(mktemp)
trap 'rm -f "$log"' EXIT
if ! { "${as_root[@]}" apt-get update -qq &&
       "${as_root[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}"; } </dev/null >"$log" 2>&1; then
  cat "$log" >&2
  echo "install_packages.sh: apt-get could not install: ${missing[*]}" >&2
  exit 1
fi
