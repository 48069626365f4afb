#!/usr/bin/env bash
# Writes the locked requirements from the lists in pyproject.toml. Needs `uv` on the PATH; run by hand after a list changed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# Versions that hold for Python 3.10 and every later one, with hashes, and without the address of any index.
compile() {
  local output=$1
  shift
  uv pip compile --quiet --universal --python-version 3.10 --generate-hashes --no-emit-index-url --no-emit-find-links \
    --no-annotate --no-header --output-file "$output" "$@"
}

compile requirements.lock pyproject.toml --group build --group test
compile requirements-portable.lock --group portable --constraints requirements.lock
compile requirements-wheel.lock --group wheel --constraints requirements.lock --constraints requirements-portable.lock
compile requirements-coupling.lock --group coupling --constraints requirements.lock
compile requirements-foreign.lock --group foreign --constraints requirements.lock
compile requirements-viewers.lock --group viewers --constraints requirements.lock
compile requirements-site.lock --group site
