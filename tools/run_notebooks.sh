#!/usr/bin/env bash
# Runs the notebooks of examples/notebooks and keeps what they show: tools/run_notebooks.sh FOLDER
# The notebooks of the repository have no outputs, so that a change of them can be read. The site shows those of FOLDER
# (site_notebooks.py). An error in a cell is an error here.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
output=$(realpath -m "$1")
rm -rf "$output"
mkdir -p "$output"
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
export PLOTLY_RENDERER=plotly_mimetype # figures as JSON, which the site draws with one copy of plotly.js
for notebook in examples/notebooks/*.ipynb; do
  rm -rf "${place:?}"/*
  mkdir "$place/notebooks"
  cp "$notebook" "$place/notebooks"
  ln -s "$PWD/examples/demo_recording" "$PWD/examples/fingers" "$place"
  .venv/bin/jupyter execute --inplace --timeout=600 "$place/notebooks/$(basename "$notebook")"
  cp "$place"/notebooks/*.ipynb "$output"
done
.venv/bin/python -c 'from plotly.offline import get_plotlyjs; print(get_plotlyjs(), end="")' >"$output/plotly.min.js"
