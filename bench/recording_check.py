"""How often `tendonfmu check` finds what is wrong with a recording: python bench/recording_check.py --half even -o T.md

Each sound test recording of the foreign cases is corrupted in every way of `python_tests/foreign/corruptions.py` and
checked; sound ones are checked as they are, without their joint angles, and against descriptions with rough numbers.
Constants of the product are chosen on odd cases; figures that are published come from even ones.
"""

from __future__ import annotations

import argparse
import copy
import importlib
import json
import sys
import tempfile
import zlib
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from tendonfmu.model.description import Finger, read_finger
from tendonfmu.model.plausibility import Finding
from tendonfmu.recordings.match import belongs
from tendonfmu.recordings.recording import GROUPS, Recording

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python_tests" / "foreign"))

from corruptions import Corruption, applicable, columns_of, corrupt, corruptions
from foreign_case import Nominal

FAMILIES = {"recorded": "recorded", "mujoco": "fingers_in_mujoco", "numpy": "fingers_in_numpy"}
ROUGH = (0.05, 0.15)  # relative errors of moment arms and stiffness, standard deviation
PARTS = ("train", "test")
Counts = dict[tuple[str, str], Counter[str]]


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


def cases(half: str, made: Path | None, only: list[str] | None) -> Iterator[tuple[str, Nominal, str, pd.DataFrame]]:
    """(case, description, part, recording) of a half, from a folder of made ones or made now."""
    rest = {"odd": 1, "even": 0}[half]
    if made is not None:
        for file in sorted(made.glob("*_train.parquet")):
            name = file.name.removesuffix("_train.parquet")
            if int(name.split("_")[-1]) % 2 == rest and (not only or name in only):
                nominal = json.loads((made / f"{name}.json").read_text(encoding="utf-8"))
                for part in PARTS:
                    yield name, nominal, part, pd.read_parquet(made / f"{name}_{part}.parquet")
        return
    for family, module_name in FAMILIES.items():
        try:
            module = importlib.import_module(module_name)
        except ModuleNotFoundError as missing:
            print(f"SKIPPED: the family {family}: {missing.name} is not installed", file=sys.stderr)
            continue
        for number in module.numbers() if family == "recorded" else module.NUMBERS:
            if number % 2 == rest and (not only or f"{family}_{number:02d}" in only):
                case = module.make(number)
                for part in PARTS:
                    yield case.name, case.nominal, part, getattr(case, part)


# --- judgement --------------------------------------------------------------------------------------------------------


def is_explained(findings: list[Finding], corruption: Corruption, chosen: list[str], elements: int) -> bool:
    """Whether the findings say what was done: the right kind at the right columns, with the right factor.

    Where a finding names several corrections as equally likely, one of them has to be right. elements: columns of the
    group that was corrupted.
    """
    columns = list(chosen)
    if corruption.name.startswith("joint_velocity"):
        columns = [column.replace("position", "velocity") for column in chosen]
    said = [finding for finding in findings if finding.kind in corruption.kinds]
    if corruption.kinds == ("exchange",):
        return _is_reordered(said, corruption, columns, elements)
    if corruption.factor is None or corruption.group == "time":
        named = {column for finding in said for column in finding.columns}
        return bool(said) and (corruption.group == "time" or set(columns) <= named)
    return _is_mended(said, columns, corruption.factor)


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


def check_clean(name: str, nominal: Nominal, frame: pd.DataFrame, counts: Counts, verbose: bool) -> None:
    bare = frame.drop(columns=columns_of(frame, "joint_position"))
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    finger = described(nominal)
    tried = {"as recorded": (finger, frame)}
    if len(bare.columns) < len(frame.columns):
        tried["without joint angles"] = (finger, bare)
    for std in ROUGH:
        rough = described(roughened(nominal, std, rng))
        tried[f"arms and stiffness off by {100 * std:.0f} %"] = (rough, frame)
    for what, (against, given) in tried.items():
        findings = belongs(against, [recording_of(name, given)])
        count = counts[("sound", what)]
        count["all"] += 1
        count["errors"] += any(finding.severity == "error" for finding in findings)
        count["warnings"] += any(finding.severity == "warning" for finding in findings)
        if verbose:
            for finding in findings:
                print(f"sound, {what}: {finding.severity}: {finding.line()}", file=sys.stderr)


def check_corrupted(
    name: str, finger: Finger, frame: pd.DataFrame, corruption: Corruption, counts: Counts, verbose: bool
) -> None:
    rng = np.random.default_rng(zlib.crc32(f"{name} {corruption.name}".encode()))
    changed, chosen = corrupt(frame, corruption, rng)
    findings = belongs(finger, [recording_of(name, changed)])
    count = counts[(corruption.family, corruption.name)]
    elements = len(columns_of(changed, corruption.group))
    explained = is_explained(findings, corruption, chosen, elements)
    count["all"] += 1
    count["false"] += any(finding.kind not in corruption.kinds for finding in findings)
    count["found"] += bool(findings)
    count["explained"] += explained
    if verbose and not explained:
        said = " | ".join(finding.line() for finding in findings) or "nothing"
        print(f"MISSED {name}: {corruption.family}: {corruption.name} {chosen}: {said}", file=sys.stderr)
    false = [finding.line() for finding in findings if finding.kind not in corruption.kinds]
    if verbose and false:
        print(f"BESIDE {name}: {corruption.family}: {corruption.name} {chosen}: {' | '.join(false)}", file=sys.stderr)


def markdown(counts: Counts) -> str:
    """Two tables: of sound recordings, and of corrupted ones."""
    lines = ["| sound recordings | | with errors | with warnings |", "| --- | ---: | ---: | ---: |"]
    lines += [
        f"| {name} | {count['all']} | {count['errors']} | {count['warnings']} |"
        for (family, name), count in counts.items()
        if family == "sound"
    ]
    lines += ["", "| fault | | recordings | found | explained | something false beside |"]
    lines.append("| --- | --- | ---: | ---: | ---: | ---: |")
    total: Counter[str] = Counter()
    for (family, name), count in counts.items():
        if family != "sound":
            lines.append(f"| {family} | {name} | {_cells(count)} |")
            total.update(count)
    lines.append(f"| **all** | | {_cells(total)} |")
    return "\n".join(lines) + "\n"


def _cells(count: Counter[str]) -> str:
    return " | ".join(str(count[name]) for name in ("all", "found", "explained", "false"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--half", choices=("odd", "even"), default="even", help="cases of odd or even number")
    parser.add_argument("--cases", type=Path, metavar="DIR", help="folder of cases made before; default: made now")
    parser.add_argument("--only", nargs="+", metavar="CASE", help="only cases of these names")
    parser.add_argument("--family", action="append", help="only faults of this family; may be repeated")
    parser.add_argument("--verbose", action="store_true", help="say what is missed, and what is false")
    parser.add_argument("-o", "--output", type=Path, help="default: standard output")
    given = parser.parse_args()
    counts: Counts = defaultdict(Counter)
    wanted = [each for each in corruptions() if not given.family or each.family in given.family]
    for name, nominal, part, frame in cases(given.half, given.cases, given.only):
        check_clean(f"{name}_{part}", nominal, frame, counts, given.verbose)
        if part == "test":
            finger = described(nominal)
            for corruption in wanted:
                if applicable(frame, corruption):
                    check_corrupted(name, finger, frame, corruption, counts, given.verbose)
        print(f"{name}_{part}", file=sys.stderr)
    table = markdown(counts)
    if given.output is None:
        print(table)
    else:
        given.output.write_text(table, encoding="utf-8")


if __name__ == "__main__":
    main()
