"""EMPS diagnosed from the symmetric model: what it lacks, and what is gained by adding it.

    python examples/emps/diagnose.py -o DIR [--pulses]

Trained on DATA_EMPS alone, at its full 1 kHz (a delay below 1 ms is not seen at 100 Hz). With --pulses the gain is
measured on DATA_EMPS_PULSES, which nothing has been chosen with; without, on parts of DATA_EMPS that are left out.
The table has the relative force error, % of the drive's force, the way the benchmark publishes it.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from emps_recordings import KINEMATICS, MASS, PULSES, TRAINING, data_folder, read_emps, relative_as_published

from tendonfmu.cli.console import print_results
from tendonfmu.diagnosis.diagnosis import diagnose
from tendonfmu.diagnosis.result import Diagnosis
from tendonfmu.files.tables import write_table
from tendonfmu.recordings.converters import convert_file
from tendonfmu.report.diagnosis_files import write_diagnosis
from tendonfmu.report.diagnosis_text import lines, tables

NOMINAL = Path(__file__).with_name("emps.json")
PUBLISHED = {TRAINING: 4.08, PULSES: 5.98}  # %, symmetric friction: Janot, Gautier, Brunot 2019
PUBLISHED_ASYMMETRIC = {TRAINING: 3.11}  # %


def converted(folder: Path, name: str) -> Path:
    """What `tendonfmu convert emps FILE --decimation 1` writes."""
    file = folder / f"{name}.parquet"
    write_table(file, convert_file("emps", data_folder() / f"{name}.mat", {"mass": MASS, "decimation": 1}))
    return file


def run(names: list[str], seed: int, jobs: int) -> Diagnosis:
    """Diagnosis of the first, judged on the others."""
    with tempfile.TemporaryDirectory() as scratch:
        training, *tests = [converted(Path(scratch), name) for name in names]
        return diagnose(NOMINAL, [training], tests, kinematics=KINEMATICS, seed=seed, jobs=jobs)


def print_errors(found: Diagnosis, names: list[str]) -> None:
    print("\n| force error, % | " + " | ".join(names) + " |")
    print("| --- |" + " ---: |" * len(names))
    rows = {"published, symmetric": PUBLISHED, "published, asymmetric": PUBLISHED_ASYMMETRIC}
    recordings = {name: read_emps(data_folder() / f"{name}.mat", MASS, decimation=1) for name in names}
    for label, finger in (("refitted nominal", found.nominal_data), ("with its causes", found.extended_data)):
        rows[label] = {name: relative_as_published(finger, recording) for name, recording in recordings.items()}
    for label, errors in rows.items():
        print(f"| {label} | " + " | ".join(f"{errors[name]:.2f}" if name in errors else "" for name in names) + " |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for page, report and extended model")
    parser.add_argument("--pulses", action="store_true", help="measure the gain on the file with pulses")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1, help="processor cores")
    options = parser.parse_args()
    names = [TRAINING, PULSES] if options.pulses else [TRAINING]
    found = run(names, options.seed, options.jobs)
    write_diagnosis(found, options.output)
    print_results(tables(found), lines(found), left="may also be")
    print_errors(found, names)


if __name__ == "__main__":
    main()
