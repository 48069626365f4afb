"""Tries importers on FMUs of three fingers, and prints the table of docs/reference/compatibility.md.

    python tools/compatibility.py [FINGER ...]

Each FMU carries its reference results (`tendonfmu build --reference`). Exit status: 0 every importer that is installed
agrees with them, 1 one does not.
"""

from __future__ import annotations

import argparse
import datetime
import platform
import sys
import tempfile
import warnings
import zipfile
from pathlib import Path

import numpy as np
from fmpy.util import read_csv
from importers import IMPORTERS, Importer, Task, flat_rows

import tendonfmu as tf
from tendonfmu.fmu.running import ABSOLUTE, FOLDER, RELATIVE

ROOT = Path(__file__).resolve().parent.parent
VERSIONS = {2: "2.0", 3: "3.0"}
SHOWN = ("time", "compensated_torque", "friction_torque", "contact")
FINGERS = {  # description and recording
    # One joint and one cable loop, whose force has either sign. In FMI 3.0 every array has one element.
    "cable_loop": ("python_tests/reference/cable_loop.json", "python_tests/reference/cable_loop_in.csv"),
    "two_joints": ("examples/demo_recording/two_joints.json", "examples/demo_recording/two_joints_unseen.parquet"),
    "index_finger": (  # pushed: `contact` becomes true
        "examples/demo_recording/index_finger_calibrated.json",
        "examples/demo_recording/index_finger_pushes.parquet",
    ),
}
NOT_HERE, NOT_OFFERED = "not tried here", "–"


def make_task(name: str, fmi: int, folder: Path) -> Task:
    """What an importer has to do with the FMU of a finger."""
    folder.mkdir(parents=True)
    description, recording = (ROOT / file for file in FINGERS[name])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tf.InputWarning)  # the cable loop's motion is invented
        fmu = tf.build(description, folder / f"{name}.fmu", reference=tf.read_recording(recording).frame, fmi=fmi)
    with zipfile.ZipFile(fmu) as archive:
        tables = {end: archive.read(f"{FOLDER}/{name}{end}").decode() for end in ("_in.csv", "_ref.csv")}
    rows = [line.split(",") for line in tables["_ref.csv"].splitlines()]
    kept = [k for k, column in enumerate(rows[0]) if column.strip('"').partition("[")[0] in SHOWN]
    tables["_ref.csv"] = "".join(",".join(row[k] for k in kept) + "\n" for row in rows)
    for end, text in tables.items():
        (folder / f"{name}{end}").write_text(text, encoding="utf-8")
    outputs = read_csv(folder / f"{name}_ref.csv").dtype.names[1:]
    return Task(fmu, fmi, read_csv(folder / f"{name}_in.csv"), outputs)


def try_importer(importer: Importer, task: Task) -> tuple[str, bool]:
    """The cell of the table, and whether the importer agrees or was not tried."""
    if importer.version() is None:
        return NOT_HERE, True
    if reason := importer.refuses(task):
        return f"{NOT_OFFERED} ({reason})", True
    reference = flat_rows(read_csv(task.fmu.with_name(f"{task.fmu.stem}_ref.csv")), task.outputs)[1:]
    try:
        rows = importer.run(task)
        deviation, largest = np.abs(rows - reference).max(axis=0), np.abs(reference).max(axis=0)
    except (ImportError, OSError) as missing:  # a library that the importer needs
        return f"{NOT_HERE} ({missing})", True
    except Exception as failed:  # importers have no error class of their own
        return "**failed**: " + " ".join(repr(failed).replace("|", "/").split()), False
    share = float((deviation / np.where(largest > 0, largest, 1.0)).max())
    agrees = bool((deviation <= RELATIVE * largest + ABSOLUTE).all())  # NaN agrees with nothing
    return (f"{share:.1e}" if share else "0") + ("" if agrees else " **differs**"), agrees


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("fingers", nargs="*", metavar="FINGER", help=", ".join(FINGERS))
    names = options.parse_args().fingers or list(FINGERS)
    today, all_agree = datetime.date.today().isoformat(), True
    lines = [("importer", "version", "FMI", *names, "date"), ["---"] * (4 + len(names))]
    with tempfile.TemporaryDirectory() as folder:
        tasks = {
            version: [make_task(name, fmi, Path(folder) / version / name) for name in names]
            for fmi, version in VERSIONS.items()
        }
        for importer in IMPORTERS:
            for version in VERSIONS.values():
                cells, agreements = zip(*(try_importer(importer, task) for task in tasks[version]), strict=True)
                lines.append([importer.name, importer.version() or "", version, *cells, today])
                all_agree &= all(agreements)
    print("\n".join(f"| {' | '.join(line)} |" for line in lines))
    system = f"{platform.system()} {platform.machine()}"
    print(f"\nAn importer agrees up to {RELATIVE:g} of an output's largest. Made on {system}.")
    return 0 if all_agree else 1


if __name__ == "__main__":
    sys.exit(main())
