#!/usr/bin/env bash
# Builds the documentation site with MkDocs into FOLDER (default build/site): tools/build_site.sh [FOLDER]
# Broken links, anchors and references are errors. MkDocs has an environment of its own, build/site-venv.
# Notebooks are shown as `tools/run_notebooks.sh build/notebooks` last ran them, or without outputs.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
output=$(realpath -m "${1:-build/site}")
environment=build/site-venv

if [ "$(cat "$environment/requirements" 2>/dev/null)" != "$(cat locks/site.lock)" ]; then
  "${PYTHON:-python3}" -m venv --clear "$environment"
  "$environment/bin/python" -m pip install --disable-pip-version-check --no-input --quiet --require-hashes -r locks/site.lock
  cp locks/site.lock "$environment/requirements"
fi
# A notice of the theme about other software is no finding of this build.
export NO_MKDOCS_2_WARNING=1
# Without --quiet: that would hide the warnings from --strict, too.
if ! "$environment/bin/mkdocs" build --strict --site-dir "$output" >build/site.log 2>&1; then
  grep -v '^INFO' build/site.log >&2
  exit 1
fi
echo "$output/index.html"
