"""How well a fit knows its numbers: standard error over value of each, and the correlations of the unknowns."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.drawing import Dots, MatrixPanel, Panel, Sheet
from tendonfmu.estimate import FitPicture, identifiability
from tendonfmu.files import are, counted

_SHOWN = (1e-3, 10.0)  # standard error over value
_TICKS = ((1e-3, "0.1 %"), (1e-2, "1 %"), (1e-1, "10 %"), (1.0, "100 %"), (10.0, "1000 %"))
_STRONG, _MANY = 0.5, 100  # correlation; with more unknowns than this, such entries are drawn larger
_NARROWEST = 0.035  # share of all unknowns; smaller groups share a name beside the correlation matrix
_KINDS = {
    "friction": "joint friction",
    "load_friction": "load friction",
    "pulley_friction": "pulley",
    "edge_friction": "edge",
}
_ORDER = ("static", "coulomb", "stribeck_velocity", "viscous")
_PLACE = re.compile(r"(joints|tendons)\[(\d+)\]")


@dataclass(frozen=True)
class Pair:
    """Two unknowns and the correlation of their errors."""

    first: str
    second: str
    correlation: float


# --- standard error over value ----------------------------------------------------------------------------------------


def kind_of(path: str) -> tuple[int, int, str]:
    """Return rank and name of the kind of a number: where it acts, and which number of a law it is."""
    key = path.rsplit(".", 1)[-1]
    for rank, (place, name) in enumerate(_KINDS.items()):
        if re.search(rf"\.{place}(\[|\.)", path) and key in _ORDER:
            return rank, _ORDER.index(key), f"{name}: {key.replace('_', ' ')}"
    if ".cover." in path:
        return len(_KINDS), 0, "cover: stiffness"
    name = re.sub(r"\[\d+\]", "", path).replace("_", " ").replace(".", ": ", 1)
    return len(_KINDS) + 1, 0, name


def relative_error(entry: Mapping[str, Any]) -> float:
    """Return standard error over value of a number of the report; infinite where there is none."""
    error, value = entry.get("standard_error"), entry.get("value")
    if error is None or not value or not np.isfinite(error):
        return float("inf")
    return abs(float(error) / float(value))


def error_sheet(picture: FitPicture) -> Sheet:
    """Show every estimated number as a dot, by kind."""
    entries = picture.report["parameters"]
    kinds = sorted({kind_of(entry["path"]) for entry in entries})
    row_of = {kind: row for row, kind in enumerate(kinds)}
    members: list[list[Mapping[str, Any]]] = [[] for _ in kinds]
    for entry in entries:
        members[row_of[kind_of(entry["path"])]].append(entry)
    names = tuple(
        f"{name}  {sum(bool(each['identified']) for each in found)}/{len(found)}"
        for (_, _, name), found in zip(kinds, members, strict=True)
    )
    known, of = sum(bool(entry["identified"]) for entry in entries), len(entries)
    panel = Panel(
        title="Standard error over value",
        alt=f"Standard error over value of {of} numbers by kind, on a logarithmic axis; {known} are identified: "
        + "; ".join(names)
        + ".",
        x_label="standard error / value",
        y_label="",
        size="large",
        dots=tuple(_dots(members)),
        log_x=True,
        x_limits=_SHOWN,
        ticks=_TICKS,
        rows=names,
        line=identifiability.LIMIT,
        height=90 + 24 * len(names),
    )
    return Sheet(
        section="errors",
        name="standard_errors",
        title="How well each number is known",
        caption="Each kind shows how many of its numbers are identified. The line is at "
        f"{100 * identifiability.LIMIT:.0f} % of the value. Dots beyond the axis are drawn at its end.",
        keys=(("identified", "identified"), ("unidentified", "not identified")),
        panels=(panel,),
    )


def _dots(members: list[list[Mapping[str, Any]]]) -> Iterator[Dots]:
    """Place the dots of a row side by side in the order of the description, so that none hides another."""
    for style, wanted in (("identified", True), ("unidentified", False)):
        x, y = [], []
        for row, found in enumerate(members):
            for k, entry in enumerate(found):
                if bool(entry["identified"]) == wanted:
                    x.append(float(np.clip(relative_error(entry), *_SHOWN)))
                    y.append(row + (0.6 * (k + 0.5) / len(found) - 0.3))
        yield Dots(style, np.array(x), np.array(y))


# --- correlation ------------------------------------------------------------------------------------------------------


def correlation(covariance: Numbers) -> Numbers:
    """Return the correlations [p, p] of a covariance; 0 where the variance is 0."""
    size = np.sqrt(np.diag(covariance))
    scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    return np.asarray(np.clip(covariance * scale[:, None] * scale[None, :], -1.0, 1.0))


def unknown_name(path: str, role: str) -> str:
    """Return the path of an unknown in the fit's own form: the last part says its role."""
    return path if role == "value" else f"{path.rsplit('.', 1)[0]}.{role}"


def strongest_pairs(picture: FitPicture, count: int) -> list[Pair]:
    """Return the pairs of unknowns whose errors are most strongly correlated, strongest first."""
    matrix = np.abs(correlation(picture.covariance))
    rows, columns = np.triu_indices(len(matrix), 1)
    strength = matrix[rows, columns]
    best = np.argsort(-strength, kind="stable")[:count]
    names = [unknown_name(unknown.path, unknown.role) for unknown in picture.unknowns]
    values = correlation(picture.covariance)
    return [Pair(names[a], names[b], float(values[a, b])) for a, b in zip(rows[best], columns[best], strict=True)]


def correlation_sheet(picture: FitPicture) -> Sheet:
    """Show the correlations of all unknowns, ordered by where they act."""
    places = [_place(unknown.path) for unknown in picture.unknowns]
    order = sorted(range(len(places)), key=lambda k: places[k])
    matrix = correlation(picture.covariance)[np.ix_(order, order)]
    groups = _groups(picture, [places[k] for k in order])
    above = int(np.count_nonzero(np.abs(np.triu(matrix, 1)) > 0.9))
    panel = MatrixPanel(
        title="Correlation of the estimates",
        alt=f"Correlation matrix of {len(order)} unknowns, ordered by joint and tendon; {counted(above, 'pair')} "
        f"{are(above)} correlated by more than 0.9.",
        matrix=matrix,
        groups=groups,
        marked=_marked(matrix),
        names=tuple(unknown_name(picture.unknowns[k].path, picture.unknowns[k].role) for k in order),
    )
    return Sheet(
        section="correlation",
        name="correlation",
        title="What the data cannot distinguish",
        caption="Correlation of the errors of all unknowns, in the fit's own form (coulomb, drop = static − coulomb, "
        "rate = 1/stribeck_velocity, viscous), ordered by where they act. Red: their difference is known better than "
        "either of them; blue: their sum is. "
        + ("Entries with a strong correlation are drawn enlarged." if len(panel.marked) else ""),
        keys=(("positive", "+1"), ("uncorrelated", "0"), ("opposed", "−1")),
        panels=(panel,),
    )


def _marked(matrix: Numbers) -> NDArray[np.intp]:
    """Find strong entries off the diagonal that would be too small to see among many."""
    if len(matrix) < _MANY:
        return np.empty((0, 2), dtype=np.intp)
    return np.argwhere((np.abs(matrix) >= _STRONG) & ~np.eye(len(matrix), dtype=bool))


def _groups(picture: FitPicture, places: list[tuple[int, int]]) -> tuple[tuple[str, int, int], ...]:
    """Return name, begin and end of the unknowns of each joint and tendon; small neighbours of a kind share a name."""
    begins = [k for k in range(len(places)) if k == 0 or places[k] != places[k - 1]]
    merged: list[tuple[int, int]] = []
    for begin, end in zip(begins, [*begins[1:], len(places)], strict=True):
        if merged and places[merged[-1][0]][0] == places[begin][0]:
            before, middle = merged[-1]
            if min(end - begin, middle - before) < _NARROWEST * len(places):
                merged[-1] = (before, end)
                continue
        merged.append((begin, end))
    names = []
    for begin, end in merged:
        first, last = (_place_name(picture, places[k]) for k in (begin, end - 1))
        names.append((first if first == last else f"{first} … {last}", begin, end))
    return tuple(names)


def _place(path: str) -> tuple[int, int]:
    """Return a sort key: joints before tendons before the rest, then the number of the joint or tendon."""
    found = _PLACE.match(path)
    return (2, 0) if found is None else ((0 if found[1] == "joints" else 1), int(found[2]))


def _place_name(picture: FitPicture, place: tuple[int, int]) -> str:
    kind, number = place
    if kind == 2:
        return "others"
    return (picture.joint_names if kind == 0 else picture.tendon_names)[number - 1]
