"""Which parts of a valid description are implausible for a finger: units, signs, tendons that cannot hold a joint.

All findings are warnings, since a description may be of another machine, such as a crane. The limits are far from the
values of fingers, and wrong units are far beyond them: by a factor of 57 at least.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.model.description import Finger, laws, sides
from tendonfmu.model.description_numbers import bias_is_constant, number_of

LONGEST_ARM = 0.3  # m; arms of fingers have 2 to 20 mm, those of a wrist 50
SHORTEST_ARM = 1e-4  # m
SOFTEST = 100.0  # N/m; 10 N would stretch it by 0.1 m; tendons have 1e3 to 1e6
STIFFEST_COVER = 5.0  # N·m/rad; covers have 0.01 to 0.1
FULL_TURN = 2 * np.pi  # rad
TENDON_THRESHOLD, JOINT_THRESHOLD = 0.02, 0.5  # m/s, rad/s; no finger counts faster motion as rest
STRONGEST_FORCE = 1000.0  # N, of a finger's tendon; times the longest arm, it exceeds every contact torque
ALL_FRICTION = 1.0  # of the tendon's force; no pulley takes all of it
UNREACHED = 1e-6  # of the torque that the tendons should make


@dataclass(frozen=True)
class Finding:
    """Something that is wrong, or probably is."""

    severity: str  # "error" (no fit of it is sound) or "warning"
    # of a recording: "sign", "exchange", "scale", "clock", "unfit", "routing", "columns", "pushing", "against", "held",
    # "clipped", "coarse", "gaps", "lost" or "jitter". Of a description: "moment_arms", "stiffness", "cover",
    # "friction", "angles", "threshold" or "bias"
    kind: str
    path: Path  # the recording or description
    columns: tuple[str, ...]  # columns of the recording, or keys of the description
    seen: str  # the observation, with numbers
    probably: str  # its probable cause
    write: str  # what to do about it
    # for each column, what to write into its entry of the map of columns: "sign", "scale", or "exchange" with the name
    # of another column
    entries: Mapping[str, Mapping[str, float | str]] = field(default_factory=dict)

    def line(self) -> str:
        """Return the whole finding in one line."""
        where = f"{self.path}: {_listed(self.columns)}: " if self.columns else f"{self.path}: "
        return f"{where}{self.seen}; probably {self.probably}; {self.write}"


def _listed(columns: tuple[str, ...]) -> str:
    """List at most four of the columns by name."""
    few = ", ".join(columns[:4])
    return few if len(columns) <= 4 else f"{few} and {len(columns) - 4} more"


def description_findings(finger: Finger) -> list[Finding]:
    """Find implausible values of a valid description."""
    data = finger.data
    arms = np.asarray(finger.moment_arms, dtype=float)
    rows = [
        *_covers(data),
        *_moment_arms(arms, data),
        *_directions(arms, data, finger.joint_names),
        *_stiffness(data),
        *_laws(data),
        *_angles(data),
        *_thresholds(data, arms),
        *_bias(data),
    ]
    return [
        Finding("warning", kind, finger.path, (key,), seen, probably, write)
        for kind, key, seen, probably, write in rows
    ]


def is_direct_drive(arms: Numbers) -> bool:
    """Return whether all moment arms are 1 m. arms: [m, n] (m)."""
    return bool(np.all(np.abs(arms[arms != 0.0]) == 1.0))


Row = tuple[str, str, str, str, str]  # kind, key, seen, probably, write


# --- moment arms ------------------------------------------------------------------------------------------------------


def _moment_arms(arms: Numbers, data: Mapping[str, Any]) -> Iterator[Row]:
    if is_direct_drive(arms):
        return
    sizes = np.abs(arms[arms != 0.0])
    i, j = np.unravel_index(int(np.abs(arms).argmax()), arms.shape)
    key = f"tendons[{i + 1}].moment_arms[{j + 1}]"
    if sizes.max() > LONGEST_ARM:
        yield "moment_arms", key, f"{arms[i, j]:g} m", "moment arms in mm", "expected m: 0.009 for 9 mm"
    elif sizes.max() < SHORTEST_ARM:
        yield "moment_arms", key, f"{arms[i, j]:g} m at most", "moment arms in km or a wrong power of ten", "expected m"


def _directions(arms: Numbers, data: Mapping[str, Any], names: list[str]) -> Iterator[Row]:
    """Report joints that the tendons cannot turn both ways, while the other joints rest."""
    pulls = np.array([not tendon.get("bidirectional") for tendon in data["tendons"]])
    # a cable loop is two tendons
    columns = np.concatenate([arms, -arms[~pulls]]).T
    for j, name in enumerate(names):
        key = f"tendons[*].moment_arms[{j + 1}]"
        both = [is_reached(columns, j, sign) for sign in (1.0, -1.0)]
        if all(both):
            continue
        used = columns[j][columns[j] != 0.0]
        if len(used) and (np.all(used > 0.0) or np.all(used < 0.0)):
            seen = f"all of one sign at joint {name}"
            cover = (data["joints"][j].get("cover") or {}).get("stiffness")
            back = f"; only its cover of {cover:g} N.m/rad turns it back" if cover else ""
            yield (
                "moment_arms",
                key,
                f"{seen}{back}",
                "a missing minus sign of the tendons on the other side",
                "expected both signs",
            )
        else:
            way = "either way" if not any(both) else "up" if not both[0] else "down"
            seen = f"no tensions turn joint {name} {way} and leave the other joints at rest"
            yield "moment_arms", key, seen, "a wrong sign among the moment arms", "expected tendons that can do so"


def is_reached(columns: Numbers, joint: int, sign: float) -> bool:
    """Return whether forces ≥ 0 make a torque at one joint alone. columns: [n, c] moment arms, one column per force."""
    from scipy.optimize import nnls  # takes 0.2 s to import

    scale = float(np.abs(columns).max())
    target = np.zeros(len(columns))
    target[joint] = sign
    return bool(nnls(columns / scale, target)[1] <= UNREACHED)


# --- sizes ------------------------------------------------------------------------------------------------------------


def _stiffness(data: Mapping[str, Any]) -> Iterator[Row]:
    for i, tendon in enumerate(data["tendons"], start=1):
        if tendon["stiffness"] < SOFTEST:
            seen = f"{tendon['stiffness']:g} N/m: 10 N stretch it by {10.0 / tendon['stiffness']:.3g} m"
            yield "stiffness", f"tendons[{i}].stiffness", seen, "a stiffness in N/mm", "expected N/m: 4000 for 4 N/mm"


def _covers(data: Mapping[str, Any]) -> Iterator[Row]:
    for j, joint in enumerate(data["joints"], start=1):
        cover = joint.get("cover") or {}
        stiffness, rest = cover.get("stiffness") or 0.0, cover.get("rest_angle") or 0.0
        if abs(stiffness) > STIFFEST_COVER:
            key, seen = f"joints[{j}].cover.stiffness", f"{stiffness:g} N.m/rad"
            yield "cover", key, seen, "a stiffness in N.mm/rad", "expected N.m/rad: 0.02 for 20 N.mm/rad"
        if abs(rest) > FULL_TURN:
            yield "angles", f"joints[{j}].cover.rest_angle", f"{rest:g} rad", "an angle in degrees", "expected rad"


def _laws(data: Mapping[str, Any]) -> Iterator[Row]:
    taking = {"pulley_friction", "edge_friction"}
    most = [max(abs(side["static"]) for side in sides(law)) for _, kind, law in laws(data) if kind in taking]
    if most and max(most) >= ALL_FRICTION:
        seen = f"static friction of {max(most):g} takes all of the tendon's force"
        yield (
            "friction",
            "tendons[*]",
            seen,
            "a friction in percent or in N",
            "expected a share of the force: 0.03 for 3 %",
        )


def _angles(data: Mapping[str, Any]) -> Iterator[Row]:
    for i, tendon in enumerate(data["tendons"], start=1):
        for j, edge in enumerate(tendon.get("edge_friction") or [], start=1):
            angles = (edge or {}).get("angles") or [0.0]
            if max(abs(angle) for angle in angles) > FULL_TURN:
                seen = f"{min(angles):g} to {max(angles):g} rad"
                yield "angles", f"tendons[{i}].edge_friction[{j}].angles", seen, "angles in degrees", "expected rad"


def _thresholds(data: Mapping[str, Any], arms: Numbers) -> Iterator[Row]:
    if is_direct_drive(arms):
        return
    given = data.get("velocity_threshold") or {}
    for name, most, unit, wrong in (
        ("tendon", TENDON_THRESHOLD, "m/s", "mm/s"),
        ("joint", JOINT_THRESHOLD, "rad/s", "degrees/s"),
    ):
        value = given.get(name) or 0.0
        if value > most:
            seen = f"{value:g} {unit}: every slower motion counts as rest"
            yield "threshold", f"velocity_threshold.{name}", seen, f"a velocity in {wrong}", f"expected {unit}"
    for j, threshold in enumerate(data["contact"]["threshold"], start=1):
        most = STRONGEST_FORCE * float(np.abs(arms[:, j - 1]).max())
        if threshold > most:
            seen = f"{threshold:g} N.m: more than a tendon with {STRONGEST_FORCE:g} N can cause"
            yield "threshold", f"contact.threshold[{j}]", seen, "a torque in N.mm", "expected N.m: 0.03 for 30 N.mm"


def _bias(data: Mapping[str, Any]) -> Iterator[Row]:
    rate, bias = number_of(data, "bias.forget_rate"), data.get("bias") or {}
    remembers = any(row["effect"] == "presliding" for row in data.get("extensions") or ())
    if rate > 0.0 and bias.get("forgetting") != "absorption" and bias_is_constant(data) and not remembers:
        seen = f"{rate:g} 1/s with a bias that never learns (drift_variance 0, initial_variance 0)"
        yield "bias", "bias.forget_rate", seen, "friction that every rest leaves in the bias", "expected forget_rate 0"
