#!/usr/bin/env bash
# Tries what the pages promise on a fresh machine: makes a minimal Debian on the spot (mmdebstrap, chroot), with this
# machine's package settings and nothing else, and runs there, each in a fresh clone of the last commit,
#   readme   the two commands of README.md; TESTS: what the second is given, for example python_tests/cli
#   wheel    the recipe of docs/reference/packages.md
# at once, each line with the name of its trial in front.
# tools/try_minimal_debian.sh [readme|wheel]     default: both
# Needs root. Exit status: 0 all succeeded.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. tools/setup.sh

suite=bookworm
folder=$(mktemp -d)
trap 'rm -rf --one-file-system "$folder"' EXIT

# Settings of apt and pip: mirrors, certificates, proxies. No package of this machine comes with them.
package_settings() {
  local path
  for path in /etc/apt/sources.list /etc/apt/sources.list.d /etc/apt/apt.conf.d /etc/apt/auth.conf.d /etc/apt/keyrings \
    /usr/share/keyrings /etc/pip.conf "$HOME/.config/pip" "$HOME/.netrc" /etc/resolv.conf /etc/hosts; do
    if [ -e "$path" ]; then echo "$path"; fi
  done
}

# The certificates of this machine have a place of their own: the package ca-certificates writes the usual file anew.
certificates=/etc/ssl/certs/ca-certificates.crt

settings_of_environment() {
  env | grep -iE '^(PIP_[A-Z_]*|https?_proxy|no_proxy)=' | grep -vE '^(PIP_FIND_LINKS|PIP_CERT)=' || true
  if [ -e "$certificates" ]; then printf '%s=/etc/machine-certificates.crt\n' PIP_CERT SSL_CERT_FILE REQUESTS_CA_BUNDLE; fi
}

# make_debian FOLDER
make_debian() {
  local root=$1 sources
  sources=$(find /etc/apt/sources.list.d/debian.sources /etc/apt/sources.list -type f 2>/dev/null | head -n 1)
  mmdebstrap --variant=minbase "$suite" "$root" ${sources:+"$sources"}
  package_settings | xargs tar -ch 2>/dev/null | tar -x -C "$root"
  if [ -d "$root$HOME/.config/pip" ]; then mkdir -p "$root/srv/.config" && cp -r "$root$HOME/.config/pip" "$root/srv/.config/"; fi
  if [ -e "$certificates" ]; then cp "$certificates" "$root/etc/machine-certificates.crt"; fi
}

# in_debian ROOT COMMAND: in a namespace of its own, so that no mount outlives it.
in_debian() {
  local settings
  mapfile -t settings < <(settings_of_environment)
  unshare --mount bash -euo pipefail -c '
    mount -t proc proc "$0/proc" && mount --rbind /sys "$0/sys" && mount --rbind /dev "$0/dev"
    exec chroot "$0" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/srv CI="${CI:-}" "${@:2}" bash -euo pipefail -c "$1"
  ' "$1" "$2" "${settings[@]}" </dev/null
}

# The first block of commands of a page.
commands_of() { sed -n '/^    [^ ]/,/^$/p' "$1" | sed '/^$/q' | sed "s/^    //; s|^\./test|& ${TESTS:-}|"; }

# Each page in a Debian of its own: what one installs, the other must not find.
trial() {
  local name=$1 page=$2 root=$folder/$1 started=$SECONDS
  cp -a "$folder/minimal" "$root"
  git clone --quiet --no-hardlinks . "$root/srv/$name"
  echo "--- $page"
  commands_of "$page"
  in_debian "$root" "cd /srv/$name; set -x; $(commands_of "$page")"
  echo "--- $page: done in $((SECONDS - started)) s"
}

if [ "$(id -u)" -ne 0 ]; then die "needs root: chroot and mounts"; fi
if ! command -v mmdebstrap >/dev/null; then quietly "installing mmdebstrap" apt_install mmdebstrap; fi
quietly "making a minimal Debian" make_debian "$folder/minimal"
declare -A pages=([readme]=README.md [wheel]=docs/reference/packages.md) trials=()
if [ $# -eq 0 ]; then set -- readme wheel; fi
for name in "$@"; do
  trial "$name" "${pages[$name]}" 2>&1 | sed -u "s/^/$name: /" &
  trials[$name]=$!
done
# Not `trial ... || failed=1`: set -e is off in what stands before ||, and a failed step would be passed over.
failed=0
for name in "${!trials[@]}"; do
  wait "${trials[$name]}" || failed=1
done
exit "$failed"
