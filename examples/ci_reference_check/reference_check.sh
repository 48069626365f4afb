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

# check FMU [TRACE]
check() {
  "${PYTHON:-python3}" "$here/check_reference.py" "$@"
  status=$?
  if [ "$status" -gt "$worst" ]; then worst=$status; fi
}

if [ $# -eq 1 ]; then
  for fmu in "$1"/*.fmu; do
    if [ ! -f "$fmu" ]; then
      echo "reference_check: $1: no FMU; expected NAME.fmu in it" >&2
      exit 2
    fi
    check "$fmu"
  done
  exit "$worst"
fi

for options in "$2"/*_ref.opt; do
  if [ ! -f "$options" ]; then
    echo "reference_check: $2: no trace; expected NAME_ref.opt in it" >&2
    exit 2
  fi
  name=$(basename "$options" _ref.opt)
  check "$1/$name.fmu" "$2/$name"
done
exit "$worst"
