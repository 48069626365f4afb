# Sets up what is missing to build and run TendonFMU. Sourced by ./run, ./test and .ci/run after `cd` to the repository root.
# shellcheck shell=bash
#
#   set_up_system FLAVOUR   compiler, headers and a Python >= 3.10; FLAVOUR `run`, or `test`: GoogleTest as well
#   set_up_sundials         SUNDIALS for the simulated finger, unpacked into build/sundials; going on without it is possible
#   set_up_python           .venv with the locked packages
#   set_up_java_clients     FMI4j and Maestro in build/clients, for tools/nightly
#   set_up_package          tendonfmu itself, rebuilt when a source changed
#
# Stamps make a second call skip what is done: each holds a digest of what its step depends on.

say() { printf '%s\n' "$*" >&2; }
die() {
  say "$@"
  exit 1
}

# Runs a long step quietly; its output is shown only when it fails.
quietly() {
  local what=$1 log started=$SECONDS
  shift
  mkdir -p build
  log=$(mktemp build/setup-XXXXXX)
  say "$what ..."
  if ! "$@" >"$log" 2>&1 </dev/null; then
    cat "$log" >&2
    rm -f "$log"
    die "failed after $((SECONDS - started)) s: $what"
  fi
  rm -f "$log"
  say "$what: $((SECONDS - started)) s"
}

digest() {
  if command -v sha256sum >/dev/null; then sha256sum; else shasum -a 256; fi
}

is_stamped() { [ -f "$1" ] && [ "$(cat "$1")" = "$2" ]; }

# --- system packages -------------------------------------------------------------------------------------------------

# A Python that can make a virtual environment and build an extension module against its headers.
python_is_usable() {
  "$1" - >/dev/null 2>&1 <<'PY'
import ensurepip, os, sys, sysconfig, venv
sys.exit(not (sys.version_info >= (3, 10) and os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h"))))
PY
}

# The lock is made for 3.10 and later and tried with 3.10 to 3.13, so those come first.
find_python() {
  local candidate
  for candidate in ${PYTHON:-python3 /usr/bin/python3 python3.13 python3.12 python3.11 python3.10 python3.14}; do
    if command -v "$candidate" >/dev/null && python_is_usable "$candidate"; then
      command -v "$candidate"
      return
    fi
  done
  return 1
}

has_compiler() { command -v "${CXX:-c++}" >/dev/null && command -v "${CC:-cc}" >/dev/null; }

# Asks the compiler, which knows where headers are on every platform.
has_header() {
  local prefix=""
  if [ "$(uname)" = Darwin ] && command -v brew >/dev/null; then prefix="-I$(brew --prefix)/include"; fi
  # shellcheck disable=SC2086
  printf '#include <%s>\n' "$1" | "${CXX:-c++}" -std=c++17 $prefix -fsyntax-only -x c++ - >/dev/null 2>&1
}

has_file_header() { [ -e "/usr/include/$1" ] || [ -e "/usr/local/include/$1" ] || has_header "$1"; }

# Names of the missing packages: first argument apt or brew, second the flavour.
missing_packages() {
  local family=$1 flavour=$2
  if ! has_compiler; then
    if [ "$family" = apt ]; then echo g++; else echo gcc; fi
  fi
  if ! find_python >/dev/null; then
    if [ "$family" = apt ]; then echo python3 python3-venv python3-dev; else echo python@3.13; fi
  fi
  if ! has_file_header nlohmann/json.hpp; then
    if [ "$family" = apt ]; then echo nlohmann-json3-dev; else echo nlohmann-json; fi
  fi
  if [ "$flavour" = test ] && ! has_file_header gtest/gtest.h; then
    if [ "$family" = apt ]; then echo libgtest-dev; else echo googletest; fi
  fi
}

apt_install() {
  local as_root=()
  if [ "$(id -u)" -ne 0 ]; then as_root=(sudo); fi
  # Package lists may be absent or stale on a fresh machine: refresh them only if the first try fails.
  if [ -z "$(find /var/lib/apt/lists -name '*_Packages*' 2>/dev/null | head -n 1)" ] ||
    ! apt_get_install "$@" >/dev/null 2>&1; then
    "${as_root[@]}" apt-get update -qq
    apt_get_install "$@"
  fi
}

apt_get_install() {
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@"
}

# What only the simulated finger and `fit` need: everything else is built without it.
missing_beyond_model() {
  if ! has_file_header eigen3/Eigen/Core; then
    if [ "$1" = apt ]; then echo libeigen3-dev; else echo eigen; fi
  fi
}

# install_packages FAMILY PACKAGES...
install_packages() {
  local family=$1
  shift
  if [ "$family" = brew ]; then
    command -v brew >/dev/null || die "missing: $* - install them (for example with Homebrew), then call again"
    quietly "installing with Homebrew: $*" brew install --quiet "$@"
  else
    command -v apt-get >/dev/null || die "missing (named as on Debian): $* - install them, then call again"
    if [ "$(id -u)" -ne 0 ]; then
      command -v sudo >/dev/null || die "missing: $* - as root: apt-get install --no-install-recommends $*"
      # Asks for the password here, where the terminal is still the user's.
      sudo -v || die "missing: $* - as root: apt-get install --no-install-recommends $*"
    fi
    quietly "installing with apt: $*" apt_install "$@"
  fi
}

set_up_system() {
  local flavour=$1 family=apt missing beyond
  if [ "$(uname)" = Darwin ]; then family=brew; fi
  missing=$(missing_packages "$family" "$flavour" | xargs)
  beyond=$(missing_beyond_model "$family")
  if [ -n "$missing" ]; then
    # shellcheck disable=SC2086
    install_packages "$family" $missing $beyond
    missing=$(missing_packages apt "$flavour" | xargs)
    [ -z "$missing" ] || die "still missing after the installation (named as on Debian): $missing"
  elif [ -n "$beyond" ]; then
    (install_packages "$family" "$beyond") || say "going on without $beyond: there will be no simulated finger and no fit"
  fi
}

# --- SUNDIALS --------------------------------------------------------------------------------------------------------

# Installing libsundials-dev brings 300 packages (MPI, Fortran, PETSc); unpacked alone it has all that CVODE needs: headers
# and static libraries. cmake/Sundials.cmake finds it in build/sundials/package, judges it, and fetches a release of the
# SUNDIALS project where it is unusable (Debian 13's and Homebrew's are bound to MPI) or where there is no apt.
set_up_sundials() {
  local folder=build/sundials stamp=build/sundials/.apt version
  if ! command -v apt-get >/dev/null || ! command -v dpkg-deb >/dev/null || [ -n "$(installed_sundials)" ]; then return 0; fi
  # A success is for good; what failed is tried again on another day, or when the stamp is removed.
  if is_stamped "$stamp" unpacked && [ -e "$folder/package/usr/include/cvode/cvode.h" ]; then return 0; fi
  if is_stamped "$stamp" "failed $(date +%F)"; then return 0; fi
  version=$(apt_version libsundials-dev)
  if [ -n "$version" ] && [ "${version%%.*}" -lt 6 ]; then return 0; fi
  mkdir -p "$folder"
  if (quietly "unpacking libsundials-dev $version" unpack_sundials "$folder"); then
    printf 'unpacked\n' >"$stamp"
  else
    printf 'failed %s\n' "$(date +%F)" >"$stamp"
    say "going on without the package libsundials-dev: CMake will look for SUNDIALS elsewhere"
  fi
}

installed_sundials() {
  find /usr/lib /usr/local/lib -maxdepth 2 -name libsundials_cvode.a 2>/dev/null | head -n 1
}

# Version that apt would install, without epoch; nothing if its lists do not have the package, or are not there.
apt_version() {
  apt-cache policy "$1" 2>/dev/null | sed -n 's/^ *Candidate: *\([0-9]*:\)\{0,1\}\([0-9][^ ]*\)$/\2/p'
}

# Needs no root unless the package lists are absent or stale.
unpack_sundials() (
  folder=$1 as_root=()
  if [ "$(id -u)" -ne 0 ]; then as_root=(sudo -n); fi
  rm -rf "$folder/package" "$folder"/libsundials-dev_*.deb
  cd "$folder" || return 1
  if [ -z "$(apt_version libsundials-dev)" ] || ! download_package libsundials-dev; then
    "${as_root[@]}" apt-get update -qq && download_package libsundials-dev || return 1
  fi
  # Without the examples: two thirds of it.
  mkdir package && dpkg-deb --fsys-tarfile libsundials-dev_*.deb |
    tar -x -C package ./usr/include ./usr/lib ./usr/share/doc/libsundials-dev/copyright || return 1
  rm -f libsundials-dev_*.deb
)

# As root, apt would hand the download to its user _apt, who may not be allowed into this folder.
download_package() {
  apt-get -qq -o APT::Sandbox::User=root -o Acquire::Retries=1 -o Acquire::http::Timeout=20 -o Acquire::https::Timeout=20 \
    download "$1"
}

# --- Python packages -------------------------------------------------------------------------------------------------

set_up_python() {
  local python stamp=.venv/.tendonfmu-requirements wanted
  wanted="$(digest <locks/test.lock) $PWD"
  if is_stamped "$stamp" "$wanted" && .venv/bin/python -c '' 2>/dev/null; then return; fi
  python=$(find_python) || die "no Python >= 3.10 with venv and headers found: set PYTHON to one"
  quietly "making .venv with $("$python" --version)" "$python" -m venv --clear .venv
  quietly "installing the locked Python packages" install_locked locks/test.lock
  printf '%s\n' "$wanted" >"$stamp"
}

# What locks/interop.lock or locks/wheel.lock lists, into the same environment.
set_up_extra() {
  local stamp=.venv/.tendonfmu-requirements-$1 wanted
  wanted=$(digest <"locks/$1.lock")
  if is_stamped "$stamp" "$wanted"; then return; fi
  quietly "installing the Python extra $1" install_locked "locks/$1.lock"
  printf '%s\n' "$wanted" >"$stamp"
}

# FMI4j and Maestro, from Maven Central into build/clients: python_tests/pages/test_java_clients.py runs them.
set_up_java_clients() {
  local folder=build/clients stamp=build/clients/.java wanted
  wanted=$(digest <tools/java_clients.xml)
  if is_stamped "$stamp" "$wanted"; then return; fi
  if ! command -v mvn >/dev/null || ! command -v javac >/dev/null; then
    say "no mvn or no javac on the PATH"
    return 1
  fi
  mkdir -p "$folder"
  quietly "fetching FMI4j and Maestro" mvn --batch-mode --file tools/java_clients.xml package
  printf '%s\n' "$wanted" >"$stamp"
}

install_locked() {
  .venv/bin/python -m pip install --disable-pip-version-check --no-input --quiet --require-hashes -r "$1"
}

# --- the package itself ----------------------------------------------------------------------------------------------

# Everything that ends up in the installed package. CI checks that no other folder is read by its build.
package_sources() {
  # Folders that are not there are no error.
  { find CMakeLists.txt pyproject.toml LICENSE THIRD_PARTY_LICENSES.txt cmake runtime fmu_src modelDescription python \
    examples/fingers examples/rigs examples/demo_recording -type f ! -path '*/__pycache__/*' ! -path 'runtime/tests/*' \
    -print0 2>/dev/null || true; } | LC_ALL=C sort -z
}

# Installed as users install it, not in place: what the tests see is what the wheel holds.
set_up_package() {
  local stamp=.venv/.tendonfmu-package wanted
  wanted=$({ package_sources | xargs -0 cat && package_sources && cat .venv/.tendonfmu-requirements &&
    { ls -d build/sundials/package 2>/dev/null || true; }; } | digest)
  if is_stamped "$stamp" "$wanted" && [ -x .venv/bin/tendonfmu ]; then return; fi
  quietly "building and installing tendonfmu" install_package
  printf '%s\n' "$wanted" >"$stamp"
  say_what_is_missing
}

# pip hides what CMake says.
say_what_is_missing() {
  say_reason "the simulated finger" simulated_finger_missing.txt
  say_reason "the estimation of parameters (tendonfmu fit)" estimation_missing.txt
}

# say_reason WHAT FILE: the file in the build folder of the package holds why it is not there, or nothing.
say_reason() {
  local reason
  for reason in build/package-*/"$2"; do
    if [ -s "$reason" ]; then say "built without $1: $(cat "$reason")"; fi
  done
}

install_package() {
  PATH="$PWD/.venv/bin:$PATH" .venv/bin/python -m pip install --disable-pip-version-check --no-input --no-index \
    --no-build-isolation --no-deps --force-reinstall .
}
