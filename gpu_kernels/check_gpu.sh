#!/usr/bin/env bash
# Builds gpu_kernels alone on a machine with a GPU and checks it there: parity with the CPU and all other tests,
# compute-sanitizer on small tests, and the times of each kernel on CPU and GPU. Prints one table in Markdown.
# Needs nvcc, CMake, g++ and GoogleTest (installed, or its sources in GK_GTEST_DIR); the times need Google Benchmark
# (installed, or its sources in GK_BENCHMARK_DIR) and the scan pair in ../../shared/data.
#   check_gpu.sh [BUILD_FOLDER]
# Exit status: 0 all good, 1 something failed, 2 no GPU or a tool is missing.
set -uo pipefail
cd "$(dirname "$0")"
build=${1:-../build/check_gpu}
export PATH=$PATH:/usr/local/cuda/bin

missing() {
  echo "check_gpu.sh: $1" >&2
  exit 2
}
command -v nvcc >/dev/null || missing "no nvcc on PATH or in /usr/local/cuda/bin"
command -v cmake >/dev/null || missing "no cmake"
chip=$(nvidia-smi --query-gpu=name,driver_version,compute_cap --format=csv,noheader -i 0 2>/dev/null) ||
  missing "no GPU: nvidia-smi finds none"
capability=$(cut -d, -f3 <<<"$chip" | tr -d ' .')

rows=()
failed=0
step() {  # step NAME COMMAND...: runs it into a log, and makes a row of its verdict
  local name=$1 log
  shift
  log=$build/$(tr ' ' _ <<<"$name").log
  if "$@" >"$log" 2>&1; then
    rows+=("| $name | passed | |")
  else
    rows+=("| $name | FAILED | $log |")
    failed=1
    tail -n 20 "$log" >&2
  fi
}

mkdir -p "$build"
options=(-DCMAKE_BUILD_TYPE=Release -DGK_CUDA=ON "-DGK_CUDA_ARCHS=$capability-real" -DGK_TESTS=ON)
[[ -z ${GK_GTEST_DIR:-} ]] || options+=("-DGK_GTEST_DIR=$GK_GTEST_DIR")
bench=OFF
if [[ -n ${GK_BENCHMARK_DIR:-} ]]; then
  options+=("-DGK_BENCHMARK_DIR=$GK_BENCHMARK_DIR")
  bench=ON
elif [[ -e /usr/include/benchmark/benchmark.h || -e /usr/local/include/benchmark/benchmark.h ]]; then
  bench=ON
fi
step configure cmake -S . -B "$build" "${options[@]}" "-DGK_BENCH=$bench"
step build cmake --build "$build" -j "$(nproc)"
tests=$build/tests/gpu_kernels_test
if [[ $failed -eq 0 ]]; then
  step "tests" "$tests" --gtest_filter='*'
  skipped=$(grep -c '^\[  SKIPPED \].*/cuda' "$build/tests.log")
  [[ $skipped -eq 0 ]] || { rows+=("| tests on the GPU | $skipped SKIPPED | $build/tests.log |") && failed=1; }
  small='Devices/Deskew.TakesTheSmallestScans/cuda:Devices/Deskew.DropsWhatIsNotFinite/cuda:Devices/Prepare.*/cuda:Devices/VoxelGrid.TakesVoxelsOfFewAndOfThousands/cuda:Devices/VoxelGrid.TakesTheSmallestClouds/cuda:Devices/VoxelGrid.DropsAndCountsWhatHasNoVoxel/cuda:Devices/CovarianceKernels.SayWhenTheyKnowNothing/cuda:Devices/Matcher.SaysWhenItRanOut/cuda'
  for tool in memcheck racecheck initcheck synccheck; do
    if command -v compute-sanitizer >/dev/null; then
      step "compute-sanitizer $tool" compute-sanitizer --tool $tool --error-exitcode 1 "$tests" --gtest_filter="$small"
    else
      rows+=("| compute-sanitizer $tool | not there | |")
    fi
  done
  if [[ $bench == ON ]]; then
    step benchmark "$build/gpu_kernels_bench" --benchmark_repetitions=5 --benchmark_min_time=0.1 \
      --benchmark_report_aggregates_only=true --benchmark_out="$build/times.csv" --benchmark_out_format=csv
  fi
fi

printf '\n%s, CUDA %s, %s\n\n| step | verdict or median | log |\n|---|---|---|\n' "$chip" \
  "$(nvcc --version | sed -n 's/.*release \([0-9.]*\).*/\1/p')" "$(date +%F)"
printf '%s\n' "${rows[@]}"
if [[ -f $build/times.csv ]]; then
  echo
  echo "| kernel (0: CPU, 1: CUDA) | median |"
  echo "|---|---|"
  awk -F, '/_median"/ {gsub(/"/, "", $1); printf "| %s | %.3f %s |\n", $1, $3, $5}' "$build/times.csv"
fi
exit $failed
