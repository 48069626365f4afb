"""The da Vinci jaw diagnosed from constant joint friction: trained on even loads, judged on odd ones.

    python examples/davinci/diagnose.py -o DIR

Run 07 is given whole: it jams at 17.08 s, an event to be found, not friction to be fitted. The table has the rms of
compensated minus external torque over all samples, run 07 up to 16.5 s, before and after.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from jaw_recordings import FAST, FAULT, data_folder, rms, torque_error

from tendonfmu.cli.console import print_results
from tendonfmu.diagnosis.diagnosis import diagnose
from tendonfmu.diagnosis.result import Diagnosis
from tendonfmu.files.tables import write_table
from tendonfmu.model.native import run_recording
from tendonfmu.recordings.converters import convert_file
from tendonfmu.recordings.recording import read_recording
from tendonfmu.report.diagnosis_files import write_diagnosis
from tendonfmu.report.diagnosis_text import lines, tables

NOMINAL = Path(__file__).with_name("jaw_nominal.json")
EVEN, ODD = ("00", "02", "04", "06", "08"), ("01", "03", "05", "07", "09")
PRETENSION = 13.0  # N; the least whole number at which the closing cable always pulls


def converted(folder: Path, name: str) -> Path:
    """What `tendonfmu convert davinci FILE --pretension 13` writes."""
    file = folder / f"{name}.parquet"
    write_table(file, convert_file("davinci", data_folder() / f"{name}.TXT", {"pretension": PRETENSION}))
    return file


def errors(finger: dict[str, object], file: Path) -> np.ndarray:
    """[N] N·m: compensated minus external torque, before a fault."""
    recording = read_recording(file)
    missed = torque_error(recording, run_recording(finger, recording.arrays()))
    return np.asarray(missed[recording.time <= FAULT.get(file.stem, np.inf)])


def print_errors(found: Diagnosis, files: dict[str, Path]) -> None:
    print("\n| rms, mN·m | refitted nominal | with its causes |")
    print("| --- | ---: | ---: |")
    models = [dict(found.nominal_data), dict(found.extended_data)]
    missed = {name: [errors(model, file) for model in models] for name, file in files.items()}
    groups = {name: (name,) for name in (*EVEN, *ODD)} | {"even: trained": EVEN, "odd": ODD, "0.5 Hz": FAST}
    for label, names in groups.items():
        pooled = [1e3 * rms(np.concatenate([missed[name][k] for name in names])) for k in range(2)]
        print(f"| {label} | {pooled[0]:.1f} | {pooled[1]:.1f} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for page, report and extended model")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1, help="processor cores")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        files = {name: converted(Path(scratch), name) for name in (*EVEN, *ODD, *FAST)}
        found = diagnose(
            NOMINAL,
            [files[name] for name in EVEN],
            [files[name] for name in ODD],
            seed=options.seed,
            jobs=options.jobs,
        )
        write_diagnosis(found, options.output)
        print_results(tables(found), lines(found), left="may also be")
        print_errors(found, files)


if __name__ == "__main__":
    main()
