# Sets up what is missing to build and run TendonFMU. Sourced by ./run, ./test and .ci/run after `cd` to the repository root.
# shellcheck shell=bash
#
#   set_up_system FLAVOUR   compiler, headers and a Python >= 3.10; FLAVOUR `run`, or `test`: GoogleTest as well
#   set_up_python           .venv with the locked packages
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

set_up_system() {
  local flavour=$1 missing
  if [ "$(uname)" = Darwin ]; then
    missing=$(missing_packages brew "$flavour" | xargs)
    [ -n "$missing" ] || return 0
    command -v brew >/dev/null || die "missing: $missing - install them (for example with Homebrew), then call again"
    # shellcheck disable=SC2086
    quietly "installing with Homebrew: $missing" brew install --quiet $missing
  else
    missing=$(missing_packages apt "$flavour" | xargs)
    [ -n "$missing" ] || return 0
    command -v apt-get >/dev/null || die "missing (named as on Debian): $missing - install them, then call again"
    if [ "$(id -u)" -ne 0 ]; then
      command -v sudo >/dev/null || die "missing: $missing - as root: apt-get install --no-install-recommends $missing"
      # Asks for the password here, where the terminal is still the user's.
      sudo -v || die "missing: $missing - as root: apt-get install --no-install-recommends $missing"
    fi
    # shellcheck disable=SC2086
    quietly "installing with apt: $missing" apt_install $missing
  fi
  missing=$(missing_packages apt "$flavour" | xargs)
  [ -z "$missing" ] || die "still missing after the installation (named as on Debian): $missing"
}

# --- Python packages -------------------------------------------------------------------------------------------------

set_up_python() {
  local python stamp=.venv/.tendonfmu-requirements wanted
  wanted="$(digest <requirements.lock) $PWD"
  if is_stamped "$stamp" "$wanted" && .venv/bin/python -c '' 2>/dev/null; then return; fi
  python=$(find_python) || die "no Python >= 3.10 with venv and headers found: set PYTHON to one"
  quietly "making .venv with $("$python" --version)" "$python" -m venv --clear .venv
  quietly "installing the locked Python packages" install_locked requirements.lock
  printf '%s\n' "$wanted" >"$stamp"
}

# An extra, such as `portable` or `peers`, into the same environment.
set_up_extra() {
  local stamp=.venv/.tendonfmu-requirements-$1 wanted
  wanted=$(digest <"requirements-$1.lock")
  if is_stamped "$stamp" "$wanted"; then return; fi
  quietly "installing the Python extra $1" install_locked "requirements-$1.lock"
  printf '%s\n' "$wanted" >"$stamp"
}

install_locked() {
  .venv/bin/python -m pip install --disable-pip-version-check --no-input --quiet --require-hashes -r "$1"
}

# --- the package itself ----------------------------------------------------------------------------------------------

# Everything that ends up in the installed package. CI checks that no other folder is read by its build.
package_sources() {
  find CMakeLists.txt pyproject.toml LICENSE cmake runtime fmu_src modelDescription python examples/fingers examples/demo_recording -type f \
    ! -path '*/__pycache__/*' ! -path 'runtime/tests/*' -print0 2>/dev/null | LC_ALL=C sort -z
}

# Installed as users install it, not in place: what the tests see is what the wheel holds.
set_up_package() {
  local stamp=.venv/.tendonfmu-package wanted
  wanted=$({ package_sources | xargs -0 cat && package_sources && cat .venv/.tendonfmu-requirements; } | digest)
  if is_stamped "$stamp" "$wanted" && [ -x .venv/bin/tendonfmu ]; then return; fi
  quietly "building and installing tendonfmu" install_package
  printf '%s\n' "$wanted" >"$stamp"
}

install_package() {
  PATH="$PWD/.venv/bin:$PATH" .venv/bin/python -m pip install --disable-pip-version-check --no-input --no-index \
    --no-build-isolation --no-deps --force-reinstall .
}
