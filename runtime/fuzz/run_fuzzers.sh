#!/usr/bin/env bash
# run_fuzzers.sh SECONDS [BUILD]: every fuzzer for that long, with the address and undefined-behaviour sanitizers.
# Without BUILD it builds in build/fuzz with clang. Corpora grow in BUILD/corpus; a finding lies beside its log and makes the
# exit code 1. For a long run: run_fuzzers.sh 3600.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

[[ ${1-} =~ ^[0-9]+$ ]] || { echo "usage: run_fuzzers.sh SECONDS [BUILD]" >&2; exit 2; }
seconds=$1
build=${2-build/fuzz}

if [[ $# -lt 2 ]]; then
  command -v clang++ >/dev/null || { echo "run_fuzzers.sh: clang++ not found; libFuzzer comes with clang" >&2; exit 2; }
  CC=clang CXX=clang++ cmake -S . -B "$build" -DCMAKE_BUILD_TYPE=RelWithDebInfo -DTENDONFMU_BUILD_FUZZERS=ON \
    -DTENDONFMU_SANITIZE=ON -DTENDONFMU_BUILD_TESTS=OFF >/dev/null
  cmake --build "$build" --parallel 2 >/dev/null
fi

# fuzz PROGRAM
fuzz() {
  local program=$1 name folder corpus arguments limit log
  name=$(basename "$program")
  folder=$(dirname "$program")
  corpus=$build/corpus/$name
  mkdir -p "$corpus" "$build/findings"
  arguments=("$corpus")
  if [[ -d $folder/corpus/$name ]]; then arguments+=("$folder/corpus/$name"); fi
  if [[ $name == *json* || $name == *rig* ]]; then arguments+=("-dict=$folder/keys.dict"); fi
  limit=10 # s
  # a debug build that integrates to the smallest tolerance, or a stiff rig
  if [[ $name == *plant* || $name == *rig* ]]; then limit=60; fi
  log=$build/$name.log
  if "$program" -max_total_time="$seconds" -timeout="$limit" -rss_limit_mb=4096 -print_final_stats=1 \
    -artifact_prefix="$build/findings/$name-" "${arguments[@]}" >"$log" 2>&1; then
    echo "$name: $(sed -n 's/^stat::number_of_executed_units: *//p' "$log") inputs, no finding"
  else
    tail -n 40 "$log" >&2
    echo "$name: FAILED, see $log and $build/findings" >&2
    return 1
  fi
}

export -f fuzz
export build seconds
# As many at once as there are processors; a failure of one ends no other.
find "$build" -type f -perm -u+x -name 'fuzz_*' -print0 | sort -z |
  xargs -0 -r -n 1 -P "$(getconf _NPROCESSORS_ONLN)" bash -c 'fuzz "$1"' fuzz
