# Named steps with their times, for .ci/run and tools/nightly. Sourced after tools/setup.sh.
# shellcheck shell=bash

failures=()
times=()

# step NAME COMMAND...: runs it, says how long it took, and keeps a failure for close_steps.
step() {
  local name=$1 started=$SECONDS result=ok
  shift
  echo "=== $name"
  if ! ("$@") </dev/null; then
    result=FAILED
    failures+=("$name")
  fi
  times+=("$(printf '%6d s  %-6s  %s' $((SECONDS - started)) "$result" "$name")")
  echo "=== $name: $result, $((SECONDS - started)) s"
}

print_times() {
  printf '%s\n' "=== time by step" "${times[@]}"
  printf '%6d s  in all\n' "$SECONDS"
}

# Compiles through ccache where it can be had: a second run, also of a clone in another folder, compiles what changed.
use_ccache() {
  if ! command -v ccache >/dev/null && ! apt_install ccache >/dev/null 2>&1; then return 0; fi
  export CMAKE_C_COMPILER_LAUNCHER=ccache CMAKE_CXX_COMPILER_LAUNCHER=ccache CCACHE_BASEDIR=$PWD CCACHE_NOHASHDIR=1
}

# build_quietly FOLDER [CMake options]: with warnings as errors; shows the end of the log only on failure.
build_quietly() {
  local folder=$1
  shift
  if ! { cmake -S . -B "$folder" -G Ninja -DPython_EXECUTABLE="$PWD/.venv/bin/python" -DTENDONFMU_WERROR=ON "$@" &&
    cmake --build "$folder" --parallel 2; } >"$folder.log" 2>&1; then
    grep -A 12 -E 'error|FAILED' "$folder.log" | head -n 100 || tail -n 60 "$folder.log"
    return 1
  fi
}

# sanitized FOLDER COMPILER CXX_COMPILER [CMake options]: address and undefined-behaviour sanitizers.
build_sanitized() {
  local folder=$1 cc=$2 cxx=$3
  shift 3
  build_quietly "$folder" -DCMAKE_C_COMPILER="$cc" -DCMAKE_CXX_COMPILER="$cxx" -DCMAKE_BUILD_TYPE=Debug \
    -DTENDONFMU_BUILD_TESTS=ON -DTENDONFMU_SANITIZE=ON "$@"
}

# What tests use if it is there, a failure for each that a distribution lacks: tests then say what they skip.
install_optional() {
  local packages
  command -v apt-get >/dev/null || return 0
  for packages in "$@"; do
    # shellcheck disable=SC2086  # several names in one entry
    if dpkg-query -W $packages >/dev/null 2>&1 || apt_install $packages >build/apt.log 2>&1; then continue; fi
    echo "NOT installed: $packages ($(tail -n 1 build/apt.log))"
  done
}

# clang with its sanitizer and fuzzer runtime: a package of its own on Debian 12, a part of libclang-common before. Its
# version is known once clang is there.
install_clang() {
  local version
  install_optional clang
  if echo '#include <fuzzer/FuzzedDataProvider.h>' | clang++ -x c++ -fsyntax-only - 2>/dev/null; then return 0; fi
  version=$(clang --version | sed -n 's/.*clang version \([0-9]*\).*/\1/p')
  apt_install "libclang-rt-$version-dev" >/dev/null 2>&1 || install_optional "libclang-common-$version-dev"
}

# A locale with a decimal comma, which numbers in texts must not follow.
make_comma_locale() {
  if command -v localedef >/dev/null; then localedef -i de_DE -f UTF-8 de_DE.UTF-8 || echo "NOT made: locale de_DE.UTF-8"; fi
}
