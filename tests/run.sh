#!/usr/bin/env bash
# Everything that has to pass, from a fresh clone: packages, build, format, clang-tidy, tests, tests under ASan, UBSan and TSan.
# Ends with the time of each stage and ctest's own summary of the main build; exits with 1 if any stage failed.
set -euo pipefail
cd "$(dirname "$0")/.."
exec </dev/null

# Objects compiled in another clone are as good.
export CCACHE_BASEDIR=$PWD CCACHE_NOHASHDIR=1 CTEST_OUTPUT_ON_FAILURE=1
main=build/tests
sanitized=build/sanitize
threads=build/threads
jobs=$(nproc)
mkdir -p "$main"
failed=()
times=()

stage() {  # stage NAME COMMAND...: runs it, notes its time, and goes on when it fails
  local name=$1 start=$SECONDS verdict=passed
  shift
  printf '\n=== %s\n' "$name"
  if ! "$@"; then
    verdict=FAILED
    failed+=("$name")
  fi
  times+=("$(printf '%-26s %5d s  %s' "$name" $((SECONDS - start)) "$verdict")")
}

build() {  # the main build, optimized as it ships
  cmake -G Ninja -S . -B "$main" -DCMAKE_BUILD_TYPE=Release -DRACELOC_TESTS=ON && cmake --build "$main" -j "$jobs"
}

format() {
  find libs apps gpu_kernels tests -regex '.*\.\(h\|hpp\|cpp\|cu\|cuh\)' -print0 |
    xargs -0 clang-format --dry-run -Werror
}

tidy() { tests/support/tidy.py "$main" libs apps gpu_kernels; }

main_tests() {
  ctest --test-dir "$main" -j "$jobs" --timeout 900 --no-tests=error 2>&1 | tee "$main/ctest.log"
}

sanitized_tests() {  # only what is labelled `fast`; for time, circuits are the short ones, and no rates of the wall detector
  local -x ASAN_OPTIONS=detect_leaks=1:strict_string_checks=1 UBSAN_OPTIONS=print_stacktrace=1:halt_on_error=1
  local -x LSAN_OPTIONS=suppressions=$PWD/tests/support/leaks.supp:print_suppressions=0
  cmake -G Ninja -S . -B "$sanitized" -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS_DEBUG=-O1 -DRACELOC_TESTS=ON \
    -DRACELOC_CUDA=OFF -DRACELOC_SANITIZE=address,undefined -DCMAKE_UNITY_BUILD=ON &&
    cmake --build "$sanitized" -j "$jobs" --target fast_tests &&
    ctest --test-dir "$sanitized" -j "$jobs" --timeout 900 --no-tests=error -L fast -E '/(monza_like|everland_like|ims|tms)|^(RoadCourse|Ground)\.'
}

threaded_tests() {  # what hands logs and tiles from thread to thread; TBB and Embree are not instrumented
  local -x TSAN_OPTIONS=halt_on_error=1:suppressions=$PWD/tests/support/tsan.supp
  cmake -G Ninja -S . -B "$threads" -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS_DEBUG=-O1 -DRACELOC_TESTS=ON \
    -DRACELOC_CUDA=OFF -DRACELOC_SANITIZE=thread -DCMAKE_UNITY_BUILD=ON &&
    cmake --build "$threads" -j "$jobs" --target core_bounded_queue_unit_test sensors_unit_test \
      sensors_live_unit_test map_unit_test &&
    "$threads"/bin/core_bounded_queue_unit_test --gtest_brief=1 && "$threads"/bin/sensors_unit_test --gtest_brief=1 &&
    "$threads"/bin/sensors_live_unit_test --gtest_brief=1 &&
    "$threads"/bin/map_unit_test --gtest_brief=1 --gtest_filter='TileWindow*'
}

summary() {
  printf '\n=== summary\n'
  printf '%s\n' "${times[@]}"
  printf '%-26s %5d s\n' total "$SECONDS"
  [[ ${#failed[@]} -eq 0 ]] || printf 'FAILED: %s\n' "${failed[*]}"
  [[ ! -f $main/ctest.log ]] || sed -n '/ tests passed, .* tests failed out of /,$p' "$main/ctest.log"
  [[ ${#failed[@]} -eq 0 ]]
}

rm -f "$main/ctest.log"
stage packages bash apps/install_packages.sh --tests
stage build build
stage clang-format format
if [[ " ${failed[*]} " != *" build "* ]]; then
  stage tests main_tests
  stage clang-tidy tidy
  stage "sanitized tests" sanitized_tests
  stage "threaded tests" threaded_tests
fi
summary
