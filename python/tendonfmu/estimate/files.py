"""The files of a fit: the fitted description, and the state that an interrupted fit leaves to continue from."""

from __future__ import annotations

import filecmp
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError, InternalError
from tendonfmu.estimate.structure import Structure, own_copy, set_number
from tendonfmu.files import check_output, check_output_folder, read_json, write_text
from tendonfmu.model import Finger, description_text, native
from tendonfmu.recordings import Recording

UNFINISHED = "tendonfmu-fit-unfinished-1"
DIGITS = 10  # of a fitted number: far finer than any standard error, and static friction stays above coulomb


def check_outputs(output: Path, report: Path | None, figures: Path | None, inputs: Sequence[Path]) -> None:
    """Check that the results of a command can be written, before a long computation."""
    for file in (output, *([report] if report is not None else [])):
        if file.suffix.lower() != ".json":
            raise InputError(f"{file}: expected a name that ends in .json")
        check_output(file, *inputs)
    if report is not None and report.resolve() == output.resolve():
        raise InputError(f"{report}: the same file for description and report; expected two names")
    if figures is not None:
        check_output_folder(figures)


def check_given_once(training: Iterable[object], compared: Iterable[object], role: str = "compared with") -> None:
    """Check that no recording is given twice, as if it were two measurements, or trained on and compared with."""
    # Recordings in memory are not checked, since they may be pieces of one file.
    seen: dict[Path, bool] = {}
    for sources, trained in ((training, True), (compared, False)):
        for source in sources:
            if not isinstance(source, str | os.PathLike):
                continue
            file = Path(source).resolve()
            same = next((each for each in seen if each == file or _same_bytes(each, file)), None)
            if same is not None:
                what = "" if same == file else f", as {same.name}"
                if seen[same] and not trained:
                    raise InputError(f"{source}: {role}, but trained on as well{what}; expected another recording")
                raise InputError(f"{source}: given twice{what}; expected each recording once")
            seen[file] = trained


def _same_bytes(one: Path, other: Path) -> bool:
    """Tell whether two files hold the same bytes; False if one is empty or unreadable, which is reported later."""
    try:
        return one.stat().st_size == other.stat().st_size > 0 and filecmp.cmp(one, other, shallow=False)
    except OSError:
        return False


def check_unseen(training: Iterable[Recording], tests: Iterable[Recording], role: str = "a test") -> None:
    """Check that no test recording holds the samples of a recording that is trained on."""
    known = [(each, _measured(each)) for each in training]
    for test in tests:
        own = _measured(test)
        for other, measured in known:
            if own.shape == measured.shape and np.array_equal(own, measured):
                raise InputError(
                    f"{test.path}: {role}, but trained on as well: the same samples as {other.path}; expected another "
                    "recording"
                )


def _measured(recording: Recording) -> Numbers:
    """Return [N, 2m] tendon forces and positions."""
    return np.hstack([recording.groups["tendon_force"], recording.groups["tendon_position"]])


# --- descriptions -----------------------------------------------------------------------------------------------------


def with_values(structure: Structure, values: Numbers) -> Finger:
    """Replace the estimated numbers in the description of the start."""
    # values: [p]
    data = own_copy(structure.start.data)
    for number in structure.numbers:
        for path in (number.path, number.with_path):
            if path is not None:
                set_number(data, path, float(f"{values[structure.index[path]]:.{DIGITS}g}"))
    if structure.sensor_fault is not None:
        data["sensor_fault"] = dict(structure.sensor_fault)
    text = description_text(data).encode()
    try:
        return Finger(structure.start.path, text, data, native.image_from_json(text))
    except native.NativeError as refused:  # not the user's fault: a fit keeps within every bound
        raise InternalError(f"{structure.start.path}: the fitted description is refused: {refused}") from refused


def with_uncertainty(finger: Finger, directions: Sequence[Sequence[Sequence[float]]], level: float | None) -> Finger:
    """Set `contact.uncertainty`, and `contact.uncertainty_level` if a level is given."""
    contact = {**finger.data["contact"], "uncertainty": directions}
    data = {**finger.data, "contact": contact if level is None else {**contact, "uncertainty_level": level}}
    text = description_text(data).encode()
    return Finger(finger.path, text, data, native.image_from_json(text))


# --- an interrupted fit -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Unfinished:
    """State of an interrupted fit: the best estimate so far."""

    finger: str  # name of the finger
    method: str  # "batch" or "ekf"
    z: Numbers  # [u] unknowns
    unknowns: Sequence[str]  # [u] "path role" of each unknown
    cost: float  # negative log likelihood with the prior, or NaN
    options: Mapping[str, Any]  # options of the fit
    description: Mapping[str, Any]  # description with the values of z


def unfinished_path(output: Path) -> Path:
    """Return the file to which an interrupted fit to `output` writes its state."""
    return output.with_name(f"{output.stem}.unfinished.json")


def write_unfinished(output: Path, found: Unfinished) -> Path:
    """Write the state of an interrupted fit next to its output."""
    content = {
        "format": UNFINISHED,
        "finger": found.finger,
        "method": found.method,
        "cost": found.cost if np.isfinite(found.cost) else None,
        "options": dict(found.options),
        "unknowns": list(found.unknowns),
        "z": [float(value) for value in found.z],
        "description": dict(found.description),
    }
    path = unfinished_path(output)
    write_text(path, json.dumps(content, indent=1, ensure_ascii=False) + "\n")
    return path


def read_unfinished(path: Path) -> Unfinished:
    """Read the state of an interrupted fit."""
    content = read_json(path, "the state of an interrupted fit")
    if not isinstance(content, dict) or content.get("format") != UNFINISHED:
        found = content.get("format") if isinstance(content, dict) else None
        raise InputError(f'{path}: format = {json.dumps(found)}; expected "{UNFINISHED}", that of an interrupted fit')
    numbers, names, data = content.get("z"), content.get("unknowns"), content.get("description")
    if not isinstance(numbers, list) or not all(type(z) in (int, float) for z in numbers):
        raise InputError(f"{path}: z: expected a list of numbers")
    if not isinstance(names, list) or len(names) != len(numbers) or not isinstance(data, dict):
        raise InputError(
            f"{path}: unknowns, description: expected one name for each of the {len(numbers)} z, and an object"
        )
    return Unfinished(
        finger=str(content.get("finger")),
        method=str(content.get("method")),
        z=np.array(numbers, dtype=float),
        unknowns=[str(name) for name in names],
        cost=float("nan") if content.get("cost") is None else float(content["cost"]),
        options=content.get("options") or {},
        description=data,
    )


def resumed_start(path: Path, unknowns: Sequence[str]) -> Numbers:
    """Return [u] the unknowns to continue from. Raises InputError unless both fits estimate the same unknowns."""
    found = read_unfinished(path)
    if list(found.unknowns) == list(unknowns):
        return found.z
    other = sorted(set(found.unknowns) ^ set(unknowns))
    what = f"{other[0]} is not in both" if other else "in another order"
    raise InputError(
        f"{path}: the interrupted fit has {len(found.unknowns)} unknowns, this fit has {len(unknowns)} ({what}); "
        "expected the same finger, --asymmetric, --only, --fix and --share"
    )
