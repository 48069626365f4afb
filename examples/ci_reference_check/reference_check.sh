#!/bin/sh
# Checks every FMU that has a reference trace: reference_check.sh FMUS TRACES
#
#   FMUS/NAME.fmu against TRACES/NAME_in.csv, NAME_ref.csv, NAME_ref.opt
#
# Exit status: 0 all agree, 1 one does not, 2 a file is missing or bad. PYTHON names a Python with fmpy and numpy.
set -u
if [ $# -ne 2 ]; then
  echo "usage: reference_check.sh FMUS TRACES" >&2
  exit 2
fi
here=$(dirname "$0")
worst=0
for options in "$2"/*_ref.opt; do
  if [ ! -f "$options" ]; then
    echo "reference_check: $2: no trace; expected NAME_ref.opt in it" >&2
    exit 2
  fi
  name=$(basename "$options" _ref.opt)
  "${PYTHON:-python3}" "$here/check_reference.py" "$1/$name.fmu" "$2/$name"
  status=$?
  if [ "$status" -gt "$worst" ]; then worst=$status; fi
done
exit "$worst"
