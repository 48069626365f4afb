"""How often `tendonfmu check` finds what is wrong with a recording (fingers/corruptions.py).

    python -m evidence.recordings.check -o FOLDER --half even

Constants of the product are chosen on odd cases; figures that are published come from even ones. rows/CASE.json in the
folder has what was said of each recording.
"""

from __future__ import annotations

import copy
import json
import tempfile
import zlib
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from evidence import tables
from evidence.fingers.corruptions import Corruption, applicable, columns_of, corrupt, corruptions
from evidence.fingers.families import cases_of, module_of
from evidence.fingers.foreign import Nominal
from evidence.runner import parser, publish, run_cases
from evidence.tables import Row
from tendonfmu.model import Finding, Finger, read_finger
from tendonfmu.recordings import Recording, belongs
from tendonfmu.recordings.recording import GROUPS

ROUGH = (0.05, 0.15)  # relative errors of moment arms and stiffness, standard deviation
PARTS = ("train", "test")


def recording_of(name: str, frame: pd.DataFrame) -> Recording:
    """The frame as the product's reader would give it."""
    groups = {group: frame[columns_of(frame, group)].to_numpy() for group in GROUPS if columns_of(frame, group)}
    return Recording(Path(name), frame["time"].to_numpy(), groups)


def described(nominal: Nominal) -> Finger:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "finger.json"
        file.write_text(json.dumps(nominal), encoding="utf-8")
        return read_finger(file)


def roughened(nominal: Nominal, std: float, rng: np.random.Generator) -> Nominal:
    """Moment arms and stiffness off by so much."""
    rough = copy.deepcopy(nominal)
    for tendon in rough["tendons"]:
        tendon["moment_arms"] = [arm * np.exp(std * rng.standard_normal()) for arm in tendon["moment_arms"]]
        tendon["stiffness"] *= np.exp(std * rng.standard_normal())
    return rough


# --- cases ------------------------------------------------------------------------------------------------------------


def checked(family: str, number: int) -> Row:
    """All that is checked of a finger: its sound recordings, and its test recording with every corruption."""
    case = module_of(family).make(number)
    rows = [row for part in PARTS for row in check_clean(f"{case.name}_{part}", case.nominal, getattr(case, part))]
    finger = described(case.nominal)
    suited = (corruption for corruption in corruptions() if applicable(case.test, corruption))
    return {"rows": rows + [check_corrupted(case.name, finger, case.test, corruption) for corruption in suited]}


# --- judgement --------------------------------------------------------------------------------------------------------


def is_explained(findings: list[Finding], corruption: Corruption, chosen: list[str], elements: int) -> bool:
    """Whether the findings say what was done: the right kind at the right columns, with the right factor.

    Where a finding names several corrections as equally likely, one of them has to be right. elements: columns of the
    group that was corrupted.
    """
    columns = list(chosen)
    if corruption.name.startswith("joint_velocity"):
        columns = [column.replace("position", "velocity") for column in chosen]
    right = [finding for finding in findings if finding.kind in corruption.kinds]
    if corruption.kinds == ("exchange",):
        return _is_reordered(right, corruption, columns, elements)
    if corruption.factor is None or corruption.group == "time":
        named = {column for finding in right for column in finding.columns}
        is_whole = corruption.group in ("time", *named) or "time" in named
        return bool(right) and (is_whole or set(columns) <= named)
    return _is_mended(right, columns, corruption.factor)


def _is_reordered(said: list[Finding], corruption: Corruption, columns: list[str], elements: int) -> bool:
    """Whether each column is to be read from where it went; or a sentence says so."""
    group = columns[0].split("[")[0]
    at = sorted(int(column.split("[")[1][:-1]) for column in columns)
    if "last first" in corruption.name:
        source = {k: elements + 1 - k for k in range(1, elements + 1) if k != elements + 1 - k}
    else:  # what belongs to the next one stands at this one
        source = {following: this for this, following in zip(at, at[1:] + at[:1], strict=True)}
    entries = {column: entry.get("exchange") for finding in said for column, entry in finding.entries.items()}
    if all(entries.get(f"{group}[{k}]") == f"{group}[{other}]" for k, other in source.items()):
        return True
    swaps = [f"{group}[{k}] exchanged with {group}[{other}]" for k, other in source.items() if k < other]
    reads = [f"{group}[{k}] read from the column of {group}[{other}]" for k, other in source.items()]
    words = swaps if all(source[other] == k for k, other in source.items()) else reads
    return any(all(word in finding.line() for word in words) for finding in said)


def _is_mended(said: list[Finding], columns: list[str], factor: float) -> bool:
    """Whether the map's entries multiply the columns, and no others, by the factor; or a sentence says so."""
    product: dict[str, float] = defaultdict(lambda: 1.0)
    for finding in said:
        for column, entry in finding.entries.items():
            product[column] *= float(entry.get("sign", 1.0)) * float(entry.get("scale", 1.0))
    wrong = [column for column, value in product.items() if column not in columns and abs(value - 1.0) > 1e-6]
    if not wrong and all(abs(product[column] / factor - 1.0) < 1e-3 for column in columns):
        return True
    word = "sign -1" if factor == -1.0 else f"scale {factor:.6g}"
    group = columns[0].split("[")[0]
    whole = f"{group}[1..{len(columns)}]" if len(columns) > 1 else columns[0]
    return len(said) == 1 and f"{whole}: {word}" in said[0].line()


# --- counting ---------------------------------------------------------------------------------------------------------


def check_clean(name: str, nominal: Nominal, frame: pd.DataFrame) -> list[Row]:
    """Findings about a sound recording, as it is and against rough descriptions."""
    bare = frame.drop(columns=columns_of(frame, "joint_position"))
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    finger = described(nominal)
    tried = {"as recorded": (finger, frame)}
    if len(bare.columns) < len(frame.columns):
        tried["without joint angles"] = (finger, bare)
    for std in ROUGH:
        rough = described(roughened(nominal, std, rng))
        tried[f"arms and stiffness off by {100 * std:.0f} %"] = (rough, frame)
    rows = []
    for what, (against, given) in tried.items():
        findings = belongs(against, [recording_of(name, given)])
        row = {f"{kind}s": any(finding.severity == kind for finding in findings) for kind in ("error", "warning")}
        said = [f"{finding.severity}: {finding.line()}" for finding in findings]
        rows.append({"case": name, "family": "sound", "fault": what, "said": said, **row})
    return rows


def check_corrupted(name: str, finger: Finger, frame: pd.DataFrame, corruption: Corruption) -> Row:
    """Findings about a corrupted recording, and whether they say what was done."""
    rng = np.random.default_rng(zlib.crc32(f"{name} {corruption.name}".encode()))
    changed, chosen = corrupt(frame, corruption, rng)
    findings = belongs(finger, [recording_of(name, changed)])
    elements = len(columns_of(changed, corruption.group))
    return {
        "case": name,
        "family": corruption.family,
        "fault": corruption.name,
        "columns": chosen,
        "found": bool(findings),
        "explained": is_explained(findings, corruption, chosen, elements),
        "false": any(finding.kind not in corruption.kinds for finding in findings),
        "said": [finding.line() for finding in findings],
    }


def report(rows: Sequence[Row]) -> str:
    """Two tables: of sound recordings, and of corrupted ones."""

    def sums(*keys: str) -> Any:
        return lambda group: [str(len(group)), *(str(sum(row[key] for row in group)) for key in keys)]

    sound, broken = tables.where(rows, family="sound"), [row for row in rows if row["family"] != "sound"]
    cells = sums("found", "explained", "false")
    lines = [*tables.by(broken, ["family", "fault"], cells), ["**all**", "", *cells(broken)]]
    head = ["fault", "", "recordings", "found", "explained", "something false beside"]
    clean = tables.by(sound, ["fault"], sums("errors", "warnings"))
    first = tables.table(["sound recordings", "", "with errors", "with warnings"], clean)
    return f"{first}\n\n{tables.table(head, lines, 2)}\n"


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--half", choices=("odd", "even"), default="even", help="cases of odd or even number")
    given = options.parse_args()
    rows = run_cases(checked, cases_of(given.half), given.output, given.workers, given.scheduler)
    publish(given.output / f"{given.half}.md", report([row for case in rows for row in case["rows"]]))


if __name__ == "__main__":
    main()
