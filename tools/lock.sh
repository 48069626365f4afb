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

compile locks/test.lock pyproject.toml --group build --group test
for group in interop wheel; do compile "locks/$group.lock" --group "$group" --constraints locks/test.lock; done
compile locks/site.lock --group site
