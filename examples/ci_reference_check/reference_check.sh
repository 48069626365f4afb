#!/bin/sh
# Checks FMUs against reference results: reference_check.sh FMUS [TRACES]
#
#   FMUS/*.fmu against the results that they carry; or
#   FMUS/NAME.fmu against TRACES/NAME_in.csv, NAME_ref.csv, NAME_ref.opt
#
# Exit status: 0 all agree, 1 one does not, 2 a file is missing or bad. PYTHON names a Python with fmpy and numpy.
set -u
if [ $# -lt 1 ] || [ $# -gt 2 ]; then
  echo "usage: reference_check.sh FMUS [TRACES]" >&2
  exit 2
fi
here=$(dirname "$0")
worst=0
checked=0
failed=0
names=

# check FMU [TRACE]
check() {
  "${PYTHON:-python3}" "$here/check_reference.py" "$@"
  status=$?
  checked=$((checked + 1))
  if [ "$status" -ne 0 ]; then
    failed=$((failed + 1))
    names="$names $(basename "$1")"
  fi
  if [ "$status" -gt "$worst" ]; then worst=$status; fi
}

finish() {
  if [ "$failed" -gt 0 ]; then echo "reference_check: $failed of $checked FMUs failed:$names" >&2; fi
  exit "$worst"
}

if ! "${PYTHON:-python3}" -c 'import fmpy, numpy' 2>/dev/null; then
  echo "reference_check: no fmpy and numpy for ${PYTHON:-python3}; expected PYTHON=a Python that has both" >&2
  exit 2
fi

if [ $# -eq 1 ]; then
  for fmu in "$1"/*.fmu; do
    if [ ! -f "$fmu" ]; then
      echo "reference_check: $1: no FMU; expected NAME.fmu in it" >&2
      exit 2
    fi
    check "$fmu"
  done
  finish
fi

for options in "$2"/*_ref.opt; do
  if [ ! -f "$options" ]; then
    echo "reference_check: $2: no trace; expected NAME_ref.opt in it" >&2
    exit 2
  fi
  name=$(basename "$options" _ref.opt)
  check "$1/$name.fmu" "$2/$name"
done
finish
