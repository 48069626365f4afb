"""Makes example FMUs with reference results, and tries importers on them, as fmi-standard.org asks of exporting tools.

    python tools/compatibility.py -o DIR [--finger NAME ...] [--page PAGE.md]

DIR/README.md is the table of importers. DIR/2.0/NAME and DIR/3.0/NAME hold NAME.fmu, NAME_in.csv, NAME_ref.csv,
NAME_ref.opt and README.txt. --page writes the same table between the marks of a page.
Exit status: 0 every importer that is installed agrees, 1 one does not, 2 bad usage.
"""

from __future__ import annotations

import argparse
import datetime
import platform
import sys
import tempfile
import warnings
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from fmpy.util import read_csv
from importers import IMPORTERS, Importer, Task, flat_rows

import tendonfmu as tf
from tendonfmu.fmu.reference_results import ABSOLUTE, FOLDER, RELATIVE

ROOT = Path(__file__).resolve().parent.parent
VERSIONS = {2: "2.0", 3: "3.0"}
SHOWN = ("time", "compensated_torque", "friction_torque", "contact")  # fmi-standard.org asks for few columns
BEGIN, END = "<!-- made by tools/compatibility.py -->", "<!-- end of made -->"
NOT_HERE, NOT_OFFERED = "not tried here", "–"


@dataclass(frozen=True)
class Example:
    """A finger and a recording of it. Its name is that of the FMU."""

    description: str
    recording: str
    shows: str  # what the FMU tests


EXAMPLES = {
    "cable_loop": Example(
        "python_tests/reference/cable_loop.json",
        "python_tests/reference/cable_loop_in.csv",
        "one joint and one cable loop, whose force has either sign. In FMI 3.0 every array has one element",
    ),
    "two_joints": Example(
        "examples/demo_recording/two_joints.json",
        "examples/demo_recording/two_joints_unseen.parquet",
        "two joints, four tendons, free motion",
    ),
    "index_finger": Example(
        "examples/demo_recording/index_finger_calibrated.json",
        "examples/demo_recording/index_finger_pushes.parquet",
        "four joints, eight tendons, hundreds of parameters. It is pushed: `contact` becomes true",
    ),
}
README = """\
# FMUs of TendonFMU, with reference results

By the project TendonFMU, not by the Modelica Association. Made by `python tools/compatibility.py` of its repository.
`2.0` and `3.0` (the version of FMI) have a folder for each finger: the FMU (co-simulation), its inputs `NAME_in.csv`,
its reference results `NAME_ref.csv`, and `NAME_ref.opt` with step and tolerance, as fmi-standard.org describes them.
"""
README_OF_FMU = """\
{name}.fmu: friction of a tendon-driven finger, FMI {version} for co-simulation: {shows}.

Set the inputs of the row at t, call DoStep(t, StepSize), and compare the outputs with the row at t + StepSize.
The inputs of the first row have to be set before the initialization mode ends.
The reference is computed by TendonFMU without an FMU. A variable agrees if
|result - reference| <= RelTol * max |reference| + AbsTol in every row.
"""


def write_example(name: str, fmi: int, folder: Path) -> Task:
    """Write the FMU of an example and the files beside it. Return what an importer has to do."""
    example = EXAMPLES[name]
    folder.mkdir(parents=True)
    recording = tf.read_recording(ROOT / example.recording).frame
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tf.InputWarning)  # the cable loop's motion is invented
        fmu = tf.build(ROOT / example.description, folder / f"{name}.fmu", reference=recording, fmi=fmi)
    with zipfile.ZipFile(fmu) as archive:
        ends = ("_in.csv", "_ref.csv", "_ref.opt")
        files = {end: archive.read(f"{FOLDER}/{name}{end}").decode() for end in ends}
    files["_ref.csv"] = shown_columns(files["_ref.csv"])
    for end, text in files.items():
        (folder / f"{name}{end}").write_text(text, encoding="utf-8")
    readme = README_OF_FMU.format(name=name, version=VERSIONS[fmi], shows=example.shows)
    (folder / "README.txt").write_text(readme, encoding="utf-8")
    outputs = read_csv(folder / f"{name}_ref.csv").dtype.names[1:]
    return Task(fmu, fmi, read_csv(folder / f"{name}_in.csv"), outputs)


def shown_columns(table: str) -> str:
    """Return the columns of a CSV table that are shown."""
    rows = [line.split(",") for line in table.splitlines()]
    kept = [k for k, name in enumerate(rows[0]) if name.strip('"').partition("[")[0] in SHOWN]
    return "".join(",".join(row[k] for k in kept) + "\n" for row in rows)


def try_importer(importer: Importer, task: Task) -> tuple[str, bool]:
    """Run an importer. Return the cell of the table, and whether it agrees or was not tried."""
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


def markdown(names: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return the table as Markdown, and what its cells are."""
    header = ("importer", "version", "FMI", *names, "date")
    table = "".join(f"| {' | '.join(line)} |\n" for line in (header, ["---"] * len(header), *rows))
    fingers = "".join(f"- `{name}`: {EXAMPLES[name].shows}.\n" for name in names)
    system = f"{platform.system()} {platform.machine()}"
    return f"""{table}
Cells: the largest deviation of an output from the reference, as a share of the largest value of that output.
An importer agrees up to {RELATIVE:g}. {NOT_OFFERED}: it cannot take the FMU. Made on {system}.

{fingers}"""


def filled_page(page: Path, table: str) -> str:
    """Return a page with another table between its marks."""
    before, begin, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not end:
        raise ValueError(f"{page}: no {BEGIN} ... {END}; expected both")
    return f"{before}{begin}\n\n{table}\n{end}{after}"


def make_all(names: Sequence[str], output: Path, page: Path | None) -> int:
    """Write the folder and the table of the page. Return the exit status."""
    today = datetime.date.today().isoformat()
    with tempfile.TemporaryDirectory(dir=output.parent, prefix=f".{output.name}-") as scratch:
        folder = Path(scratch) / "made"
        tasks = {
            version: [write_example(name, fmi, folder / version / name) for name in names]
            for fmi, version in VERSIONS.items()
        }
        rows, agree = [], True
        for importer in IMPORTERS:
            for version in VERSIONS.values():
                cells, agreements = zip(*(try_importer(importer, task) for task in tasks[version]), strict=True)
                rows.append([importer.name, importer.version() or "", version, *cells, today])
                agree &= all(agreements)
        table = markdown(names, rows)
        (folder / "README.md").write_text(f"{README}\n{table}", encoding="utf-8")
        if page is not None:
            page.write_text(filled_page(page, table), encoding="utf-8")
        folder.rename(output)
    print(table)
    return 0 if agree else 1


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="new folder")
    parser.add_argument("--finger", nargs="+", choices=EXAMPLES, default=list(EXAMPLES), metavar="NAME")
    parser.add_argument("--page", type=Path, metavar="PAGE.md", help="page whose table is replaced")
    options = parser.parse_args(arguments)
    output: Path = options.output.absolute()
    try:
        if output.exists():
            raise ValueError(f"{output}: exists; expected a new folder")
        if options.page is not None:
            filled_page(options.page, "")  # before the long part
        output.parent.mkdir(parents=True, exist_ok=True)
        return make_all(list(dict.fromkeys(options.finger)), output, options.page)
    except (ValueError, OSError) as failed:
        print(f"compatibility: {failed}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
