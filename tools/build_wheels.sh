#!/usr/bin/env bash
# Builds the source distribution, and from it (not from the tree) the wheels for Linux x86-64; tries each in a fresh
# environment where there is no compiler, on Python 3.10 to 3.13: tools/build_wheels.sh [FOLDER]     default: build/wheels
#
# Sets up what is missing, as ./run does. FOLDER/dist takes the results. zig compiles against an old C library (GLIBC) and
# links the C++ library in; auditwheel confirms the tag.
#   VERSIONS  of Python, default: 3.10 3.11 3.12 3.13; what is not found is left out
#   PYTHONS   interpreters to build and try with, in place of those
#   EXTRAS    extras installed and imported with the last of them: `logs,mujoco,campaign,notebook`; default: none
# Exit status: 0 all built, tried and alike; anything else: something failed, or no interpreter was found.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. tools/setup.sh
root=$PWD
glibc=2.17
policy=manylinux_2_17_x86_64
python=$root/.venv/bin/python
output=$(realpath -m "${1:-build/wheels}")

say() { printf '%s\n' "$*"; } # to standard output: this is a report

# timed WHAT COMMAND...: its output is shown only if it fails.
timed() {
  local what=$1 started=$SECONDS
  shift
  if ! "$@" >"$output/log" 2>&1 </dev/null; then
    tail -n 60 "$output/log"
    say "FAILED after $((SECONDS - started)) s: $what"
    exit 1
  fi
  say "$what: $((SECONDS - started)) s"
}

find_pythons() {
  local version candidate
  for version in ${VERSIONS:-3.10 3.11 3.12 3.13}; do
    for candidate in "python$version" "${PYENV_ROOT:-$HOME/.pyenv}/versions/$version".*/bin/python ""; do
      if [ -z "$candidate" ]; then
        say "SKIPPED: Python $version not found" >&2
      elif "$candidate" -c "import ensurepip, sys; sys.exit('%d.%d' % sys.version_info[:2] != '$version')" 2>/dev/null; then
        "$candidate" -c 'import sys; print(sys.executable)'
        break
      fi
    done
  done
}

# Compilers that CMake calls: zig for GLIBC 2.17.
make_compilers() {
  local zig name machine
  # Debian's Python.h includes <x86_64-linux-gnu/python3.11/pyconfig.h>, and zig does not look into /usr/include.
  machine=$("$python" -c 'import sysconfig; print(sysconfig.get_config_var("MULTIARCH"))')
  mkdir -p "$output/headers/$machine"
  find "/usr/include/$machine" -maxdepth 1 -name 'python3*' -exec ln -sfn {} "$output/headers/$machine/" \; 2>/dev/null || true
  zig=$("$python" -c 'import importlib.util as u; print(u.find_spec("ziglang").submodule_search_locations[0] + "/zig")')
  for name in cc c++; do
    cat >"$output/$name" <<EOF
#!/bin/sh
exec "$zig" $name -target x86_64-linux-gnu.$glibc "\$@" -isystem "$output/headers"
EOF
    chmod +x "$output/$name"
  done
}

# The pinned versions without their hashes, which pip takes for requirements but not for what a build needs.
make_constraints() { sed -nE 's/^([a-z0-9-]+==[^ ]+( ; [^\\]+)?) \\$/\1/p' locks/test.lock >"$output/constraints.txt"; }

build_source() {
  # Every file of a source distribution has the same time, so ninja would take objects of other sources for these.
  rm -rf "$output/dist" "$output/source" "$output/objects"
  mkdir -p "$output/dist" "$output/source"
  timed "source distribution" "$python" -c \
    "import sys; from scikit_build_core.build import build_sdist as build; build(sys.argv[1])" "$output/dist"
  tar -xzf "$output"/dist/*.tar.gz -C "$output/source" --strip-components 1
}

# One build folder and one place of headers for all interpreters: what knows no Python is compiled once.
compile_wheel() {
  local machine defines
  machine=$("$python" -c 'import sysconfig; print(sysconfig.get_config_var("MULTIARCH"))')
  defines="TENDONFMU_HEADERS_FROM_PYTHON=ON;TENDONFMU_HEADERS_PYTHON=$python"
  defines+=";TENDONFMU_SUNDIALS_FOLDER=$root/build/sundials;CMAKE_LIBRARY_ARCHITECTURE=$machine"
  CC=$output/cc CXX=$output/c++ PATH="$root/.venv/bin:$PATH" CMAKE_GENERATOR=Ninja SKBUILD_CMAKE_DEFINE=$defines \
    SKBUILD_BUILD_DIR=$output/objects PIP_CONSTRAINT=$output/constraints.txt PYTHONPATH='' \
    "$1" -m pip wheel --disable-pip-version-check --no-input --no-deps --wheel-dir "$output/raw" "$output/source"
}

repair_wheel() {
  PATH="$root/.venv/bin:$PATH" "$python" -m auditwheel repair --plat "$policy" --wheel-dir "$output/dist" "$1" || return 1
  if [[ $1 == *-abi3-* ]]; then "$python" -m abi3audit --strict --verbose "$1" || return 1; fi
  "$python" tools/wheel/check_wheel.py "$output/dist" --glibc "$glibc"
}

# Which wheel pip would take is pip's to say: asked by each interpreter, without dependencies.
wheel_for() {
  "$1" -m pip download --disable-pip-version-check --quiet --no-index --no-deps --only-binary :all: \
    --find-links "$output/dist" --dest "$output/chosen" "tendonfmu==$version" >/dev/null 2>&1
}

build_wheels() {
  local interpreter raw reason
  for interpreter in "$@"; do
    if wheel_for "$interpreter"; then continue; fi
    rm -rf "$output/raw"
    timed "wheel by $("$interpreter" --version)" compile_wheel "$interpreter"
    raw=$(ls "$output"/raw/*.whl)
    for reason in "$output"/objects/*_missing.txt; do
      if [ -s "$reason" ]; then say "FAILED: $(basename "$reason" .txt): $(cat "$reason")"; exit 1; fi
    done
    timed "auditwheel, $policy" repair_wheel "$raw"
  done
}

# try_wheel INTERPRETER NAME [EXTRAS]: installed from FOLDER/dist and the index, wheels only; tried without any environment.
try_wheel() {
  local interpreter=$1 place=$scratch/$2 extras=${3:-}
  "$interpreter" -m venv "$place"
  timed "install on $("$interpreter" --version)${extras:+ with $extras}" env PATH="$scratch/nothing" "$place/bin/python" -m pip \
    install --disable-pip-version-check --no-input --only-binary :all: --constraint "$output/constraints.txt" \
    --find-links "$output/dist" "tendonfmu${extras:+[$extras]} @ file://$(chosen_wheel "$place/bin/python")"
  timed "  check, build, run, fit, simulate" tried "$place" "$2"
}

chosen_wheel() {
  rm -rf "$output/chosen"
  wheel_for "$1"
  ls "$output"/chosen/*.whl
}

# HOME: some packages keep a cache there.
tried() {
  env -i PATH="$scratch/nothing" HOME="$scratch/home" LC_ALL=C.UTF-8 OPENBLAS_NUM_THREADS=1 \
    "$1/bin/python" -I tools/wheel/try_wheel.py "$scratch/work-$2" --version "$version" \
    --rig examples/rigs/index_finger.json >"$output/tried-$2.json"
}

set_up_system run
set_up_sundials
set_up_python
set_up_extra wheel
mkdir -p "$output"
rm -rf "$output"/tried-*.json
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
mkdir "$scratch/nothing" "$scratch/home"
if [ -n "${PYTHONS:-}" ]; then read -ra pythons <<<"$PYTHONS"; else mapfile -t pythons < <(find_pythons); fi
if [ "${#pythons[@]}" -eq 0 ]; then
  say "FAILED: no Python 3.10 to 3.13 found; name some in PYTHONS"
  exit 1
fi
# An environment of each: a system's Python may be without pip.
for index in "${!pythons[@]}"; do
  "${pythons[$index]}" -m venv "$scratch/python-$index"
  pythons[index]=$scratch/python-$index/bin/python
done

make_compilers
make_constraints
build_source
version=$(sed -n 's/^Version: //p' "$output/source/PKG-INFO")
build_wheels "${pythons[@]}"
last=$((${#pythons[@]} - 1))
for index in "${!pythons[@]}"; do
  name=$("${pythons[$index]}" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
  if [ "$index" -eq "$last" ]; then try_wheel "${pythons[$index]}" "$name" "${EXTRAS:-}"; else try_wheel "${pythons[$index]}" "$name"; fi
done
tree=$("$python" -I -c 'import importlib.metadata as m; print(m.version("tendonfmu"))' 2>/dev/null || true)
if [ "$tree" = "$version" ]; then
  timed "the same with the package in .venv" "$python" tools/wheel/try_wheel.py "$scratch/work-tree" \
    --version "$version" --rig examples/rigs/index_finger.json
  cp "$output/log" "$output/tried-tree.json"
else
  say "NOT compared with the package in .venv: it is ${tree:-not installed}"
fi
"$python" tools/wheel/compare_trials.py "$output"/tried-*.json
ls -l "$output/dist"
