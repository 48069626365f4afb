"""Seeded random `extensions` of any finger: every effect, every kind of place, several of a kind, some at their least.

Sizes are chosen so that each term matters in the outputs; rows are valid by docs/reference/semantics/effects.md.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

Row = dict[str, Any]
Make = Callable[[np.random.Generator, int, int, int, int], Row]  # rng, joints, tendons, j, i -> row

MAGNITUDES = ("stiffness", "sine", "cosine", "inertia", "coulomb", "correction", "slope", "amplitude", "hardening",
              "width", "delay")  # fmt: skip


def either(rng: np.random.Generator, size: float) -> float:
    """Of either sign, up to `size`."""
    return float(size * rng.uniform(0.2, 1.0) * rng.choice([-1.0, 1.0]))


def somewhere(rng: np.random.Generator, j: int, i: int, at_joint: Row, at_tendon: Row) -> Row:
    return {"joint": j} | at_joint if rng.random() < 0.5 else {"tendon": i} | at_tendon


def drift(rng: np.random.Generator, n: int, m: int, j: int, i: int) -> Row:
    place = somewhere(rng, j, i, {}, {}) if rng.random() < 0.7 else {}
    return place | {"amplitude": rng.uniform(-0.9, 1.0), "time_constant": float(10.0 ** rng.uniform(-1.0, 1.0))}


def gravity(rng: np.random.Generator, n: int, m: int, j: int, i: int) -> Row:
    numbers = {"sine": either(rng, 0.05), "cosine": either(rng, 0.05)}
    if rng.random() < 0.3:
        del numbers[str(rng.choice(["sine", "cosine"]))]
    return {"joint": j} | numbers


def load_at(rng: np.random.Generator, n: int, m: int, j: int, i: int) -> Row:
    place = {"joint": j} if rng.random() < 0.5 else {}
    share = {"beyond": 0.4 * i - 0.5} if (i + j) % 2 else {}
    return place | {"tendon": i, "coulomb": either(rng, 0.5)} | share


def distance(rng: np.random.Generator, rad: float, m: float) -> tuple[float, float]:
    size = float(10.0 ** rng.uniform(-0.7, 0.7))
    return size * rad, size * m


def presliding(rng: np.random.Generator, n: int, m: int, j: int, i: int) -> Row:
    rad, metres = distance(rng, 0.01, 1e-4)
    places: list[Row] = [{}, {"joint": j}, {"tendon": i}, {"level": j}, {"tendon": i, "joint": j}]
    place = places[int(rng.choice(5, p=[0.2, 0.35, 0.25, 0.1, 0.1]))]
    row: Row = dict(place)
    at_joint = place.keys() == {"joint"}
    if rng.random() < 0.4:
        row["stiffness"] = 0.5 / rad if at_joint else 2.0 / metres  # reaches some tenths of a N·m, some N
    else:
        row["displacement"] = rad if at_joint else metres if place else 40.0 * rad  # s, of both velocity thresholds
    if rng.random() < 0.4:
        row["relaxation_time"] = float(10.0 ** rng.uniform(-2.0, 1.0))
    if rng.random() < 0.4:
        row["follows_limit"] = float(rng.choice([1.0, rng.uniform(0.0, 1.0)]))
    if rng.random() < 0.2:
        row["filtered_travel"] = float(rng.choice([1.0, rng.uniform(0.0, 1.0)]))
    return row | ({"share": rng.uniform(0.2, 2.0)} if rng.random() < 0.3 else {})


def second_element(rng: np.random.Generator, row: Row) -> Row:
    """The numbers of another element of a place, softer than the first."""
    key = "stiffness" if "stiffness" in row else "displacement"
    return {key: row[key] * (0.2 if key == "stiffness" else 5.0), "share": rng.uniform(0.2, 2.0)}


def stribeck(rng: np.random.Generator, n: int, m: int, j: int, i: int) -> Row:
    rad, metres = distance(rng, 0.2, 0.004)
    place = somewhere(rng, j, i, {"stribeck_velocity": rad}, {"stribeck_velocity": metres})
    return place | {"amplitude": rng.uniform(-0.95, 1.0)}


def backlash(rng: np.random.Generator, n: int, m: int, j: int, i: int) -> Row:
    rad, metres = distance(rng, 0.01, 1e-4)
    return somewhere(rng, j, i, {"width": rad}, {"width": metres})


def delay(rng: np.random.Generator, n: int, m: int, j: int, i: int) -> Row:
    return {"delay": either(rng, 0.05 if rng.random() < 0.3 else 0.005)}


MAKE: dict[str, Make] = {
    "cover_hardening": lambda rng, n, m, j, i: (
        {"joint": j, "stiffness": either(rng, 0.1)} | ({"quadratic": 0.05 * i - 0.12} if i % 2 else {})
    ),
    "gravity": gravity,
    "inertia": lambda rng, n, m, j, i: {"joint": j, "inertia": either(rng, 1e-3)},
    "inertia_variation": lambda rng, n, m, j, i: (
        {"joint": 1 + (j - 1) % max(n - 1, 1), "cosine": either(rng, 1e-3)}
        | ({"sine": either(rng, 1e-3)} if i % 2 else {})
    ),
    "joint_coupling": lambda rng, n, m, j, i: (
        {"joint": 1 + (j - 1) % max(n - 1, 1), "stiffness": either(rng, 0.05)}
        | ({"reaction": 0.3 * i - 0.5} if i % 2 else {})
    ),
    "preload_friction": load_at,
    "load_friction": lambda rng, n, m, j, i: {"joint": j, "tendon": i, "coulomb": either(rng, 1e-3)},
    "force_gain": lambda rng, n, m, j, i: {"tendon": i, "correction": either(rng, 0.2)},
    "force_offset": lambda rng, n, m, j, i: {"tendon": i, "correction": either(rng, 1.0)},
    "moment_arm": lambda rng, n, m, j, i: {"joint": j, "tendon": i, "correction": either(rng, 2e-3)},
    "moment_arm_variation": lambda rng, n, m, j, i: (
        {"joint": j, "tendon": i, "slope": either(rng, 2e-3)} | ({"correction": 1e-3 * i - 2e-3} if i % 2 else {})
    ),
    "pulley_eccentricity": lambda rng, n, m, j, i: (
        {"joint": j, "tendon": i, "sine": either(rng, 1e-3)}
        | ({"cosine": either(rng, 1e-3)} if i % 2 else {})
        | ({"turns": 1.2 + 0.9 * i} if j % 2 else {})
    ),
    "presliding": presliding,
    "cord_stretch": lambda rng, n, m, j, i: {"stiffness": float(10.0 ** rng.uniform(3.5, 5.5))},
    "friction_drift": drift,
    "stribeck": stribeck,
    "tendon_nonlinearity": lambda rng, n, m, j, i: {"tendon": i, "hardening": float(10.0 ** rng.uniform(5.0, 7.0))},
    "backlash": backlash,
    "time_delay": delay,
}
MOST = {"time_delay": 1, "backlash": 1, "tendon_nonlinearity": 1, "cord_stretch": 1, "presliding": 2}  # at a place
PLACES = ("joint", "tendon", "level")

OPTIONAL = ("presliding", "friction_drift", "stribeck", "backlash")  # of joint and tendon


def random_extensions(
    rng: np.random.Generator, joints: int, tendons: int, source: int = 1, thresholds: bool = True
) -> list[Row]:
    """Two to fourteen rows in any order; what a kinematics source does not see is there too, but rarely.

    thresholds: the velocity thresholds are above 0, so that presliding may be everywhere.
    """
    names = list(MAKE)
    likely = np.ones(len(names))
    if source != 1:
        likely[names.index("tendon_nonlinearity")] = 0.2
    likely[[names.index("joint_coupling"), names.index("inertia_variation")]] *= joints > 1
    rows: list[Row] = []
    for name in rng.choice(names, int(rng.integers(2, 15)), p=likely / likely.sum()):
        made = MAKE[name](rng, joints, tendons, int(rng.integers(1, joints + 1)), int(rng.integers(1, tendons + 1)))
        row = {"effect": str(name)} | made
        if name == "presliding" and row.keys().isdisjoint(PLACES) and "displacement" in row and not thresholds:
            row["joint"] = joints
        place = [row.get(key) for key in ("effect", *PLACES)]
        same = [[other.get(key) for key in ("effect", *PLACES)] for other in rows].count(place)
        if same >= MOST.get(str(name), 14):
            continue
        if rng.random() < 0.08 and name not in ("presliding", "cord_stretch"):  # legal for every one of these
            row |= {key: 0.0 for key in MAGNITUDES if key in row}
        if name in OPTIONAL and rng.random() < 0.1:
            row |= {key: None for key in PLACES[: 3 if name == "presliding" else 2] if key not in row}  # absent
        rows.append(row)
        if name == "presliding" and same == 0 and rng.random() < 0.5:  # a second element, and cords that stretch
            rows.append({key: row[key] for key in row if key in ("effect", *PLACES)} | second_element(rng, row))
            if not any(other["effect"] == "cord_stretch" for other in rows):
                rows.append({"effect": "cord_stretch"} | MAKE["cord_stretch"](rng, joints, tendons, 1, 1))
    return rows


def random_axes(rng: np.random.Generator, joints: int) -> dict[str, Any]:
    """`links` and `tip`: what `gravity` sees of the joints' axes."""
    links = [{"axis": rng.normal(0.0, 1.0, 3).tolist()} for _ in range(joints)]
    return {"links": links, "tip": [0.02, 0.0, 0.01]}
