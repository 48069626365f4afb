"""The files of a fit: what may be read and written, and an earlier fit as prior."""

from __future__ import annotations

import filecmp
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from tendonfmu.arrays import Data, Numbers
from tendonfmu.errors import InputError
from tendonfmu.estimate.identifiability import LIMIT
from tendonfmu.files import check_output, check_output_folder, read_json
from tendonfmu.model import LAW_NUMBERS, Finger, Number, estimable_numbers, read_finger
from tendonfmu.recordings import Recording

FIT_REPORT: Final = "tendonfmu-fit-1"


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
    seen: dict[Path, tuple[bool, str]] = {}
    for sources, trained in ((training, True), (compared, False)):
        for source in sources:
            if not isinstance(source, str | os.PathLike):
                continue
            file = Path(os.fspath(source)).resolve()
            same = next((other for other in seen if other == file or _same_bytes(other, file)), None)
            if same is not None:
                was_trained, name = seen[same]
                what = "" if same == file else f", as {name}"
                if was_trained and not trained:
                    raise InputError(f"{source}: {role}, but trained on as well{what}; expected another recording")
                raise InputError(f"{source}: given twice{what}; expected each recording once")
            seen[file] = trained, Path(str(source)).name


def _same_bytes(one: Path, other: Path) -> bool:
    """Tell whether two files hold the same bytes; False if one is empty or unreadable, which is reported later."""
    try:
        return one.stat().st_size == other.stat().st_size > 0 and filecmp.cmp(one, other, shallow=False)
    except OSError:
        return False


def check_unseen(training: Iterable[Recording], tests: Iterable[Recording], role: str = "a test") -> None:
    """Check that no test recording holds the samples of a recording that is trained on."""
    known = [(recording, _measured(recording)) for recording in training]
    for test in tests:
        tested = _measured(test)
        for other, measured in known:
            if np.array_equal(tested, measured):
                raise InputError(
                    f"{test.path}: {role}, but trained on as well: the same samples as {other.path}; expected another "
                    "recording"
                )


def _measured(recording: Recording) -> Numbers:
    """Return [N, 2m] tendon forces and positions."""
    return np.hstack([recording.groups["tendon_force"], recording.groups["tendon_position"]])


# --- an earlier fit ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class PreviousFit:
    """Numbers of a previous fit."""

    path: Path  # file of the report or of the description
    values: Mapping[str, float]  # numbers of the description by path (SI)
    names: Sequence[str]  # [k] unknowns that were estimated; empty if the previous fit did not state their covariance
    covariance: Numbers  # [k, k] of these unknowns
    share: float  # effective samples per sample of its residuals, the least of all joints; 1 if unknown


def read_previous_fit(path: Path) -> PreviousFit:
    """Read the report of a fit ("tendonfmu-fit-1"), or the description that a fit wrote."""
    content = read_json(path, "a previous fit: its report, or the description that it wrote")
    if isinstance(content, dict) and content.get("format") == FIT_REPORT:
        return _of_report(path, content)
    finger = read_finger(path)
    every = {number.path: 0.0 for number in estimable_numbers(finger.data)}
    return estimated_numbers(finger) or _with_errors(finger, every)


def estimated_numbers(finger: Finger) -> PreviousFit | None:
    """Return the numbers of a description that were estimated; None if none was."""
    errors = {path: error for path, (_, error) in known_numbers(finger.data).items()}
    return _with_errors(finger, errors) if errors else None


def _with_errors(finger: Finger, errors: Mapping[str, float]) -> PreviousFit:
    values = {number.path: number.value for number in estimable_numbers(finger.data)}
    unknown = unknown_errors(finger.data, errors)
    return PreviousFit(finger.path, values, list(unknown), np.diag(np.square(list(unknown.values()))), 1.0)


def _of_report(path: Path, report: Mapping[str, Any]) -> PreviousFit:
    try:
        values = {entry["path"]: float(entry["value"]) for entry in report["parameters"]}
        correlation = report["correlation"]
        errors = correlation.get("standard_errors")
        names = correlation["paths"] if errors is not None else []
        error = np.array(errors if errors is not None else [], dtype=np.float64)
        matrix = np.array(correlation["matrix"], dtype=np.float64) if len(names) else np.zeros((0, 0))
        worth = report["innovations"].get("effective") or {"samples": [1.0], "worth": [1.0]}
        share = float(np.min(np.array(worth["worth"], dtype=float) / np.array(worth["samples"], dtype=float)))
        covariance = matrix * np.outer(error, error)
        sound = covariance.shape == (len(names), len(names)) and bool(np.isfinite(covariance).all())
    except (KeyError, TypeError, ValueError, AttributeError) as wrong:
        raise InputError(
            f"{path}: {wrong}: expected a whole report of tendonfmu fit, with parameters, correlation and innovations"
        ) from None
    if not (sound and 0 < share <= 1):
        raise InputError(f"{path}: correlation, innovations.effective: expected a finite number for each unknown")
    return PreviousFit(path, values, list(names), covariance, share)


def with_previous_values(finger: Finger, previous: PreviousFit) -> Finger:
    """Return the finger with the previous values of all numbers that both have."""
    numbers = [number for number in estimable_numbers(finger.data) if number.path in previous.values]
    if not numbers:
        raise InputError(
            f"{previous.path}: none of its {len(previous.values)} numbers is one of {finger.path}; expected the report "
            "or the description of an earlier fit of the same finger"
        )
    return finger.replace({path: previous.values[number.path] for number in numbers for path in number.paths})


# --- `estimated` in a description -------------------------------------------------------------------------------------
# An entry is a number of the description, or the Coulomb friction of a place (mean over its working points and sides),
# or that of a tendon (sum over its places), which are often known where their parts are not. It counts as long as the
# description has that value. So it lapses when somebody writes another number.


DIGITS = 4  # of a standard error


def with_estimates(finger: Finger, numbers: Sequence[Number], covariance: Numbers, size: Numbers) -> Finger:
    """Return the finger with an entry for all that is known within `LIMIT` of its size [p]."""
    value = np.array([number.value for number in numbers])
    weights = {number.path: np.eye(len(numbers))[k] for k, number in enumerate(numbers)} | _coulomb_sums(numbers)
    entries = dict(finger.data.get("estimated") or {})
    for path, weight in weights.items():
        error = float(np.sqrt(max(weight @ covariance @ weight, 0.0)))
        entries.pop(path, None)
        if error <= LIMIT * float(weight @ size):
            entries[path] = [float(weight @ value), float(f"{error:.{DIGITS}g}")]
    return finger.with_data({**finger.data, "estimated": entries or None})


def known_numbers(data: Data) -> dict[str, tuple[float, float]]:
    """Return value and standard error, by path, of what was estimated and that nobody has changed since."""
    entries = data.get("estimated") or {}
    numbers = estimable_numbers(data) if entries else []
    present = {number.path: number.value for number in numbers} | {
        path: float(weight @ [number.value for number in numbers]) for path, weight in _coulomb_sums(numbers).items()
    }
    return {
        path: (float(value), float(error))
        for path, (value, error) in entries.items()
        if path in present and np.isclose(value, present[path], rtol=1e-9, atol=0.0)
    }


def unknown_errors(data: Data, errors: Mapping[str, float]) -> dict[str, float]:
    """Return the standard errors of numbers by a fit's unknowns: static − coulomb is `.drop`, 1/vs is `.rate`."""
    names = dict(zip(LAW_NUMBERS, ("drop", "coulomb", "rate", "viscous"), strict=True))
    result = {}
    for number in estimable_numbers(data):
        if number.path in errors:
            place, _, key = number.path.rpartition(".")
            factor = number.value**-2 if key == "stribeck_velocity" else 1.0
            result[f"{place}.{names.get(key, key)}"] = factor * errors[number.path]
    return result


def _coulomb_sums(numbers: Sequence[Number]) -> dict[str, Numbers]:
    """Return the weights [p] of the Coulomb friction of each place, and of each tendon."""
    places: dict[str, list[int]] = {}
    for k, number in enumerate(numbers):
        if number.effect is not None and number.key == "coulomb":
            places.setdefault(number.effect.path, []).append(k)
    sums: dict[str, Numbers] = {}
    for path, members in places.items():
        sums[path] = np.zeros(len(numbers))
        sums[path][members] = 1.0 / len(members)
    for path in places:
        tendon = path.partition(".")[0]
        if tendon.startswith("tendons["):
            sums[tendon] = sums.get(tendon, 0.0) + sums[path]
    return sums
