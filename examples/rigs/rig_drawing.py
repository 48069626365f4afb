"""Where the parts of a rig's finger lie in a drawing to scale, in mm; `rig_plots.py` draws it.

Links have their lengths, tendons the distance of their moment arms. The finger is stretched out (all angles 0) and
seen from the side and from above.

Seen from the side x points right and z up. A positive angle about y therefore bends down, and a tendon with a positive
moment arm runs below. Seen from above y points up, and a positive arm about z lies above.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

MM = 1e3
PARALLEL = 0.7  # cosine; from here on a joint's axis counts as parallel to that of a view
GAP = 0.45  # mm, least distance of two lines at a joint
STATION = 9.0  # mm, between the marks of neighbouring friction effects before a joint
STAGGER = 1.7  # mm, between neighbouring tendons' marks
ENTRY, FAN = -37.0, -47.0  # mm, where the tendons reach their arms, and where they spread for their names
NAME_SPACING = 2.7  # mm
SPRING = 9.0  # mm
BEYOND = 7.0  # mm, from a tendon's last joint to its end


@dataclass(frozen=True)
class DrawnBody:
    """A link as a solid cylinder with its mass and its moment of inertia along the finger."""

    begin: float  # along x
    end: float
    radius: float


@dataclass(frozen=True)
class DrawnRoute:
    """A tendon in one view."""

    name: str  # its name
    flexor: bool  # whether it bends the finger
    colour: int  # index among the tendons of its kind
    line: Points  #
    spring: Points
    pulleys: Points  # marks of friction; `varying_edges` where it varies with an angle
    edges: Points
    varying_edges: Points


@dataclass(frozen=True)
class View:
    """The finger seen along one axis."""

    title: str  # "from the side" or "from above"
    joints: list[tuple[str, float]]
    routes: list[DrawnRoute]  # its tendons
    stations: list[tuple[str, float]]


@dataclass(frozen=True)
class RigDrawing:
    """A finger in two views."""

    name: str  # name of the rig
    bodies: list[DrawnBody]  # links, the base first; links without length are left out
    side: View  # the views
    top: View
    left: float  # ends of the drawing along x
    right: float


def rig_drawing(expanded: Mapping[str, Any]) -> RigDrawing:
    """Return the drawing of an expanded rig (`Rig.expanded`). The finger lies along x, joint axes along y and z."""
    physics, finger = expanded["physics"], expanded["finger"]
    links = physics["links"]
    offsets = np.array([link.get("offset", [0.0, 0.0, 0.0]) for link in links])
    x: Points = MM * np.cumsum(offsets[:, 0])
    tip = float(x[-1] + MM * physics.get("tip", [0.0, 0.0, 0.0])[0])
    ends = [*x[1:], tip]
    bodies = [
        DrawnBody(float(begin), float(end), MM * float(np.sqrt(2.0 * link["inertia"][0] / link["mass"])))
        for link, begin, end in zip(links, x, ends, strict=True)
        if end > begin
    ]
    names = [joint.get("name", f"joint {j}") for j, joint in enumerate(finger["joints"], start=1)]
    R: Points = MM * np.array([tendon["moment_arms"] for tendon in finger["tendons"]])
    stations = _stations(x)
    axes = np.array([link["axis"] for link in links], dtype=float)
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    views = []
    for title, axis, up in (("from the side", 1, -1.0), ("from above", 2, 1.0)):
        seen = np.flatnonzero(np.abs(axes[:, axis]) > PARALLEL)
        heights = up * R * np.sign(axes[:, axis])
        marked = stations if axis == 1 else {}
        labels = [(f"{kind} {j + 1}", at) for (kind, j), at in marked.items() if _present(finger["tendons"], kind, j)]
        routes = _routes(finger["tendons"], x, seen, heights, R, marked)
        views.append(View(title, [(names[j], float(x[j])) for j in seen], routes, labels))
    return RigDrawing(expanded["name"], bodies, views[0], views[1], FAN - SPRING, tip)


def _stations(x: Points) -> dict[tuple[str, int], float]:
    """Map (kind, joint) to the x of its marks: the edge before the pulley; joints in one place follow one another."""
    found: dict[tuple[str, int], float] = {}
    place = np.inf
    for j in reversed(range(len(x))):
        place = min(place - STATION, float(x[j]))
        found["pulley", j] = place
        place -= STATION
        found["edge", j] = place
    return found


def _laws(tendon: Mapping[str, Any], kind: str) -> Sequence[Any]:
    return tendon.get(f"{kind}_friction") or []


def _present(tendons: Sequence[Mapping[str, Any]], kind: str, j: int) -> bool:
    return any(len(_laws(tendon, kind)) > j and _laws(tendon, kind)[j] is not None for tendon in tendons)


def _apart(heights: Points) -> Points:
    """Spread heights [m] at one joint to at least GAP apart on each side; 0 stays."""
    result: Points = heights.copy()
    for side in (1.0, -1.0):
        before = 0.0
        for i in sorted(np.flatnonzero(heights * side > 0.0), key=lambda i: float(abs(heights[i]))):
            before = max(float(abs(heights[i])), before + GAP)
            result[i] = side * before
    return result


def _routes(
    tendons: Sequence[Mapping[str, Any]],
    x: Points,
    seen: NDArray[np.intp],
    heights: Points,
    R: Points,
    stations: Mapping[tuple[str, int], float],
) -> list[DrawnRoute]:
    m = len(tendons)
    last = [int(np.flatnonzero(R[i])[-1]) for i in range(m)]
    flexor = [bool(R[i, last[i]] > 0.0) for i in range(m)]
    spread = heights.copy()
    for j in seen:
        spread[:, j] = _apart(heights[:, j])
    # names in the order in which the tendons arrive
    first = int(seen[0]) if len(seen) else 0
    order = np.argsort(-spread[:, first], kind="stable")
    start = np.empty(m)
    start[order] = NAME_SPACING * (0.5 * (m - 1) - np.arange(m))
    routes = []
    for i, tendon in enumerate(tendons):
        # at a joint without an arm only tendons with arms farther on pass, through its axis
        passed = [j for j in seen if j <= last[i]]
        if not passed:
            continue
        end = float(x[last[i]]) + BEYOND
        line = np.array(
            [
                (FAN, start[i]),
                (ENTRY, spread[i, passed[0]]),
                *[(float(x[j]), spread[i, j]) for j in passed],
                (end, spread[i, passed[-1]]),
            ]
        )
        same = [k for k in range(m) if flexor[k] == flexor[i]]
        shift = STAGGER * (same.index(i) - 0.5 * (len(same) - 1))
        marks: dict[str, list[tuple[float, float]]] = {"pulley": [], "edge": [], "varying": []}
        for (kind, j), at in stations.items():
            laws = _laws(tendon, kind)
            if j <= last[i] and len(laws) > j and laws[j] is not None:
                varying = kind == "edge" and len(laws[j].get("angles") or []) > 1
                place = at + shift
                height = float(np.interp(place, line[:, 0], line[:, 1]))
                marks["varying" if varying else kind].append((place, height))
        routes.append(
            DrawnRoute(
                name=tendon.get("name", f"tendon {i + 1}"),
                flexor=flexor[i],
                colour=same.index(i),
                line=line,
                spring=_spring(float(start[i])),
                pulleys=_points(marks["pulley"]),
                edges=_points(marks["edge"]),
                varying_edges=_points(marks["varying"]),
            )
        )
    return routes


def _points(pairs: list[tuple[float, float]]) -> Points:
    return np.array(pairs, dtype=float).reshape(-1, 2)


def _spring(height: float) -> Points:
    share = np.linspace(0.0, 1.0, 14)
    swing = np.array([0.0, 0.0, *[0.8, -0.8] * 5, 0.0, 0.0])
    return np.column_stack([FAN - SPRING * (1.0 - share), height + swing])
